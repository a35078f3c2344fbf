//! Compressed primitives (`KHR_draco_mesh_compression`, Khronos, 2017; the format of Google's Draco).

use std::collections::HashMap;

use draco_core::{
    DataType, DecodeLimits, DecoderBuffer, ErrorKind, Mesh, MeshDecoder, PointAttribute, PointIndex,
};

use super::accessor::{Component, Element};
use super::expansion::check_expansion;
use super::file::{File, List};
use super::json::{Read, Value};
use crate::contained::contained;
use crate::diagnostic::quoted;

/// The elements of the accessors that compressed primitives fill, by accessor index: tightly packed, as in a
/// buffer view of their own.
pub(super) fn filled(file: &File<'_>) -> Read<HashMap<usize, Vec<u8>>> {
    let mut filled: HashMap<usize, Vec<u8>> = HashMap::new();
    // The view and attribute that filled each accessor: primitives may share both.
    let mut sources: HashMap<usize, (usize, u64)> = HashMap::new();
    for &mesh in file.list(List::Meshes) {
        for primitive in mesh.need("primitives")?.array()? {
            if let Some(extension) = primitive.extension("KHR_draco_mesh_compression")? {
                unpack(file, primitive, extension, &mut filled, &mut sources)?;
            }
        }
    }
    Ok(filled)
}

/// The attribute number used for the indices.
const INDICES: u64 = u64::MAX;

fn unpack(
    file: &File<'_>,
    primitive: Value<'_>,
    extension: Value<'_>,
    filled: &mut HashMap<usize, Vec<u8>>,
    sources: &mut HashMap<usize, (usize, u64)>,
) -> Read<()> {
    if let Some(mode) = primitive.get("mode")?
        && mode.whole(0)? != 4
    {
        return Err(mode.unexpected("compressed primitive that is no list of triangles", "4"));
    }
    let (view, bytes) = {
        let (index, view) = file.view(extension.need("bufferView")?)?;
        let bytes = view.bytes.ok_or_else(|| {
            crate::FormatError::from(extension.wrong("the buffer of what is needed here has no data"))
        })?;
        (index, bytes)
    };
    // The required accessors, with the attributes of the stream.
    let mut wanted = vec![];
    let own = primitive.need("attributes")?;
    for (name, id) in extension.need("attributes")?.members()? {
        let accessor = own.get(&name)?.ok_or_else(|| {
            let wrong =
                id.wrong("compressed attribute that the primitive does not have").found(quoted(&name));
            crate::FormatError::from(wrong)
        })?;
        let layout = Layout::read(file, accessor)?;
        wanted.push((layout, id.whole(0)?, id));
    }
    let indices_value = primitive.need("indices")?;
    let indices = Layout::read(file, indices_value)?;
    if indices.element != Element::Scalar
        || !matches!(indices.component, Component::U8 | Component::U16 | Component::U32)
    {
        return Err(indices_value
            .wrong("accessor of a wrong type")
            .expected("SCALAR of unsigned numbers")
            .into());
    }
    let mut is_new = false;
    let all = wanted.iter().map(|(layout, id, _)| (layout, *id)).chain([(&indices, INDICES)]);
    for (layout, id) in all {
        match sources.insert(layout.accessor, (view, id)) {
            None => is_new = true,
            Some(before) if before == (view, id) => {}
            Some(_) => {
                return Err(extension
                    .wrong("accessor that two compressed primitives fill")
                    .found(layout.accessor)
                    .into());
            }
        }
    }
    if !is_new {
        return Ok(());
    }

    let unpacked: u64 =
        wanted.iter().map(|(layout, ..)| layout.bytes()).fold(indices.bytes(), u64::saturating_add);
    let packed = bytes.len() as u64;
    check_expansion(file, extension, "compressed data", packed, unpacked)?;
    // Corners, and the tables for them, during decoding.
    let hold = file.budget.hold(unpacked.saturating_mul(4), "compressed primitive")?;
    // Streams have numbers of up to 64 bits, and attributes that are not needed.
    let limits = DecodeLimits::default()
        .with_max_faces(indices.count / 3)
        .with_max_points(indices.count)
        .with_max_decoded_bytes(unpacked.saturating_mul(8).saturating_add(1 << 16));
    let place = extension.place();
    let mesh = contained("compressed primitive", &place, || {
        let mut buffer = DecoderBuffer::new(bytes).with_limits(limits);
        let mut mesh = Mesh::new();
        MeshDecoder::new().decode(&mut buffer, &mut mesh).map_err(|error| {
            let wrong = extension.wrong("damaged compressed primitive");
            let wrong = match error.kind() {
                ErrorKind::LimitExceeded => wrong.found("more than its accessors hold"),
                _ => wrong.found(quoted(&error.to_string())),
            };
            crate::FormatError::from(wrong)
        })?;
        Ok(mesh)
    })?;
    drop(hold);

    let (points, corners) = (mesh.num_points() as u64, 3 * mesh.num_faces() as u64);
    if corners != indices.count {
        let wrong = indices_value.wrong("accessor of another length than what fills it").found(indices.count);
        return Err(wrong.expected(corners).into());
    }
    let mut faces = file.budget.vec(indices.bytes(), "indices")?;
    for corner in mesh.faces().iter().flatten() {
        put(&mut faces, f64::from(corner.0), indices.component);
    }
    filled.insert(indices.accessor, faces);
    for (layout, id, value) in wanted {
        let found = u32::try_from(id).ok().and_then(|id| mesh.attribute_by_unique_id(id));
        let Some(attribute) = found else {
            return Err(value.wrong("attribute that the compressed data does not have").found(id).into());
        };
        let numbers = layout.element.numbers();
        if points != layout.count || usize::from(attribute.num_components()) != numbers {
            let wrong = value.wrong("attribute of another kind than its accessor");
            let found = format!("{points} times {} numbers", attribute.num_components());
            return Err(wrong.found(found).expected(format!("{} times {numbers}", layout.count)).into());
        }
        let mut bytes = file.budget.vec(layout.bytes(), "attribute")?;
        for point in 0..points as u32 {
            for i in 0..numbers {
                let number = number(attribute, point, i)
                    .ok_or_else(|| value.wrong("attribute without a value for every vertex"))?;
                put(&mut bytes, number, layout.component);
            }
        }
        filled.insert(layout.accessor, bytes);
    }
    Ok(())
}

/// The element layout of an accessor.
struct Layout {
    accessor: usize,
    component: Component,
    element: Element,
    count: u64,
}

impl Layout {
    fn read(file: &File<'_>, index: Value<'_>) -> Read<Self> {
        let (accessor, value) = file.at(List::Accessors, index)?;
        let component = Component::read(value.need("componentType")?)?;
        let element = Element::read(value.need("type")?)?;
        if matches!(element, Element::Mat2 | Element::Mat3 | Element::Mat4) {
            return Err(value.wrong("compressed matrices").into());
        }
        Ok(Self { accessor, component, element, count: value.need("count")?.whole(1)? })
    }

    fn bytes(&self) -> u64 {
        self.count.saturating_mul((self.element.numbers() * self.component.bytes()) as u64)
    }
}

/// One component of one vertex.
fn number(attribute: &PointAttribute, point: u32, i: usize) -> Option<f64> {
    let value = attribute.mapped_index(PointIndex(point)).0 as usize;
    let width = attribute.data_type().byte_length();
    let stride = usize::try_from(attribute.byte_stride()).ok()?;
    let start = value.checked_mul(stride)?.checked_add(i * width)?;
    let b = attribute.buffer().data().get(start..start.checked_add(width)?)?;
    Some(match attribute.data_type() {
        DataType::Int8 => f64::from(b[0] as i8),
        DataType::Uint8 | DataType::Bool => f64::from(b[0]),
        DataType::Int16 => f64::from(i16::from_le_bytes([b[0], b[1]])),
        DataType::Uint16 => f64::from(u16::from_le_bytes([b[0], b[1]])),
        DataType::Int32 => f64::from(i32::from_le_bytes([b[0], b[1], b[2], b[3]])),
        DataType::Uint32 => f64::from(u32::from_le_bytes([b[0], b[1], b[2], b[3]])),
        DataType::Float32 => f64::from(f32::from_le_bytes([b[0], b[1], b[2], b[3]])),
        DataType::Float64 => f64::from_le_bytes(b.try_into().ok()?),
        DataType::Int64 => i64::from_le_bytes(b.try_into().ok()?) as f64,
        DataType::Uint64 => u64::from_le_bytes(b.try_into().ok()?) as f64,
        DataType::Invalid => return None,
    })
}

/// Appends a number of a component type. Numbers out of range saturate, as in casts.
fn put(bytes: &mut Vec<u8>, number: f64, component: Component) {
    match component {
        Component::I8 => bytes.extend((number as i8).to_le_bytes()),
        Component::U8 => bytes.push(number as u8),
        Component::I16 => bytes.extend((number as i16).to_le_bytes()),
        Component::U16 => bytes.extend((number as u16).to_le_bytes()),
        Component::U32 => bytes.extend((number as u32).to_le_bytes()),
        Component::F32 => bytes.extend((number as f32).to_le_bytes()),
    }
}
