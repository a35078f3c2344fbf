//! Meshes: primitives, and their triangles, points and segments.

use std::collections::HashMap;

use lumbre_geometry::Shape;
use lumbre_image::Rgb;
use lumbre_math::{DMat3, DMat4, DVec3, Vec2, Vec3, Vec4};
use lumbre_scene::{ColouredShape, GeometryDesc, MeshMoment};
use rayon::prelude::*;

use super::accessor::{Accessor, Component, Element, SHARE};
use super::file::{File, List};
use super::json::{Read, Value};
use crate::diagnostic::quoted;

/// The topology of a primitive.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub(super) enum Mode {
    Points,
    Lines,
    LineLoop,
    LineStrip,
    Triangles,
    TriangleStrip,
    TriangleFan,
}

impl Mode {
    fn read(value: Value<'_>) -> Read<Self> {
        let Some(mode) = value.get("mode")? else { return Ok(Self::Triangles) };
        Ok(match mode.whole(0)? {
            0 => Self::Points,
            1 => Self::Lines,
            2 => Self::LineLoop,
            3 => Self::LineStrip,
            4 => Self::Triangles,
            5 => Self::TriangleStrip,
            6 => Self::TriangleFan,
            _ => return Err(mode.unexpected("unknown mode of a primitive", "a whole number from 0 to 6")),
        })
    }

    fn name(self) -> &'static str {
        match self {
            Self::Points => "points",
            Self::Lines => "lines",
            Self::LineLoop => "a line loop",
            Self::LineStrip => "a line strip",
            Self::Triangles => "triangles",
            Self::TriangleStrip => "a triangle strip",
            Self::TriangleFan => "a triangle fan",
        }
    }

    /// Whether it makes a surface.
    pub(super) fn is_surface(self) -> bool {
        matches!(self, Self::Triangles | Self::TriangleStrip | Self::TriangleFan)
    }

    /// The number of `count` vertices that make complete shapes.
    fn whole(self, count: usize) -> usize {
        match self {
            Self::Points => count,
            Self::Lines => count - count % 2,
            Self::LineLoop | Self::LineStrip => {
                if count < 2 {
                    0
                } else {
                    count
                }
            }
            Self::Triangles => count - count % 3,
            Self::TriangleStrip | Self::TriangleFan => {
                if count < 3 {
                    0
                } else {
                    count
                }
            }
        }
    }
}

/// A known attribute, with its set.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Attribute {
    Position,
    Normal,
    Tangent,
    TexCoord(usize),
    Colour(usize),
    Joints(usize),
    Weights(usize),
    /// An application's own, with a leading underscore.
    Own,
}

impl Attribute {
    fn read(name: &str) -> Option<Self> {
        let set = |text: &str| {
            let plain = text == "0" || (!text.starts_with('0') && text.len() <= 3 && !text.is_empty());
            (plain && text.bytes().all(|b| b.is_ascii_digit())).then(|| text.parse::<usize>().ok()).flatten()
        };
        Some(match name {
            "POSITION" => Self::Position,
            "NORMAL" => Self::Normal,
            "TANGENT" => Self::Tangent,
            _ if name.starts_with('_') => Self::Own,
            _ => match name.rsplit_once('_')? {
                ("TEXCOORD", n) => Self::TexCoord(set(n)?),
                ("COLOR", n) => Self::Colour(set(n)?),
                ("JOINTS", n) => Self::Joints(set(n)?),
                ("WEIGHTS", n) => Self::Weights(set(n)?),
                _ => return None,
            },
        })
    }

    /// The elements and components that the specification allows; `None` for an application's own attribute.
    fn formats(self, is_target: bool, quantized: bool) -> Option<(&'static [Element], &'static [Component])> {
        use Component::{F32, I8, I16, U8, U16};
        use Element::{Vec2, Vec3, Vec4};
        let formats: (&[Element], &[Component]) = match (self, is_target, quantized) {
            (Self::Own, ..) => return None,
            (Self::Position, _, false) => (&[Vec3], &[F32]),
            (Self::Position, _, true) => (&[Vec3], &[F32, I8, U8, I16, U16]),
            (Self::Normal, _, false) => (&[Vec3], &[F32]),
            (Self::Normal, _, true) => (&[Vec3], &[F32, I8, I16]),
            (Self::Tangent, false, false) => (&[Vec4], &[F32]),
            (Self::Tangent, false, true) => (&[Vec4], &[F32, I8, I16]),
            (Self::Tangent, true, false) => (&[Vec3], &[F32]),
            (Self::Tangent, true, true) => (&[Vec3], &[F32, I8, I16]),
            (Self::TexCoord(_), false, false) => (&[Vec2], &[F32, U8, U16]),
            (Self::TexCoord(_), ..) => (&[Vec2], &[F32, I8, U8, I16, U16]),
            (Self::Colour(_), false, _) => (&[Vec3, Vec4], &[F32, U8, U16]),
            (Self::Colour(_), true, _) => (&[Vec3, Vec4], &[F32, I8, U8, I16, U16]),
            (Self::Joints(_), ..) => (&[Vec4], &[U8, U16]),
            (Self::Weights(_), ..) => (&[Vec4], &[F32, U8, U16]),
        };
        Some(formats)
    }
}

/// The attributes of vertices, or what a morph target adds to them.
#[derive(Clone, Default)]
pub(super) struct Attributes<'a> {
    pub position: Option<Accessor<'a>>,
    pub normal: Option<Accessor<'a>>,
    pub tangent: Option<Accessor<'a>>,
    pub uvs: Vec<Option<Accessor<'a>>>,
    pub colour: Option<Accessor<'a>>,
    pub joints: Vec<Option<Accessor<'a>>>,
    pub weights: Vec<Option<Accessor<'a>>>,
}

/// A primitive: a part of a mesh with one material.
#[derive(Clone)]
pub(super) struct Primitive<'a> {
    pub value: Value<'a>,
    pub mode: Mode,
    pub attributes: Attributes<'a>,
    pub targets: Vec<Attributes<'a>>,
    pub indices: Option<Accessor<'a>>,
    pub material: Option<usize>,
}

/// Attribute sets from this one on are ignored.
const MAX_SETS: usize = 16;

/// Checks the alignment and the strides of a vertex attribute. `views` are the buffer views of the ones before.
fn check_layout(
    file: &File<'_>,
    index: Value<'_>,
    accessor: &Accessor<'_>,
    views: &mut Vec<(usize, usize)>,
) -> Read<()> {
    if let Some((view, has_stride)) = accessor.view {
        // Two attributes may also share an accessor.
        if views.iter().any(|&(other, by)| other == view && by != accessor.index) && !has_stride {
            file.breach(index.wrong("attributes share a buffer view that says no stride"))?;
        }
        views.push((view, accessor.index));
        if !accessor.start.is_multiple_of(4) || (!accessor.stride.is_multiple_of(4) && accessor.count > 1) {
            let found = format!("byte {}, {} bytes apart", accessor.start, accessor.stride);
            file.breach(index.wrong("attribute out of step").found(found).expected("multiples of 4"))?;
        }
    }
    Ok(())
}

impl<'a> Attributes<'a> {
    fn read(file: &'a File<'_>, value: Value<'a>, is_target: bool) -> Read<Self> {
        let quantized = file.uses("KHR_mesh_quantization");
        let mut attributes = Self::default();
        let mut count: Option<(usize, String)> = None;
        // Views shared by several attributes must specify a stride.
        let mut views: Vec<(usize, usize)> = vec![];
        for (name, index) in value.members()? {
            let Some(attribute) = Attribute::read(&name) else {
                let wrong = index.wrong("unknown attribute").found(quoted(&name));
                let known =
                    ["POSITION", "NORMAL", "TANGENT", "TEXCOORD_0", "COLOR_0", "JOINTS_0", "WEIGHTS_0"];
                file.breach(
                    wrong
                        .expected("one of glTF's, or a name that starts with an underscore")
                        .suggest(&name, known),
                )?;
                continue;
            };
            let accessor = Accessor::named(file, index)?;
            let Some((elements, components)) = attribute.formats(is_target, quantized) else {
                if accessor.component == Component::U32 {
                    file.breach(index.wrong("attribute of unsigned integers"))?;
                }
                continue;
            };
            accessor.expect(index, elements, components)?;
            check_layout(file, index, &accessor, &mut views)?;
            match &count {
                Some((count, first)) if *count != accessor.count => {
                    let wrong = index
                        .wrong("attributes of different lengths")
                        .found(format!("{} elements", accessor.count));
                    return Err(wrong.expected(format!("{count}, as {first} has")).into());
                }
                Some(_) => {}
                None => count = Some((accessor.count, name.clone().into_owned())),
            }
            let put = |list: &mut Vec<Option<Accessor<'a>>>, set: usize| {
                if set >= MAX_SETS {
                    file.warn(index, "attribute is left out: beyond the sixteenth set");
                    return;
                }
                if list.len() <= set {
                    list.resize(set + 1, None);
                }
                list[set] = Some(accessor);
            };
            match attribute {
                Attribute::Position => {
                    if !accessor.has_bounds {
                        file.breach(
                            accessor.value.wrong("accessor of positions without \"min\" and \"max\""),
                        )?;
                    }
                    attributes.position = Some(accessor);
                }
                Attribute::Normal => attributes.normal = Some(accessor),
                Attribute::Tangent => attributes.tangent = Some(accessor),
                Attribute::TexCoord(set) => put(&mut attributes.uvs, set),
                Attribute::Colour(0) => attributes.colour = Some(accessor),
                Attribute::Colour(_) => file.warn(index, "colours beyond the first set are left out"),
                Attribute::Joints(_) | Attribute::Weights(_) if is_target => {
                    file.breach(
                        index.wrong("attribute that a morph target cannot have").found(quoted(&name)),
                    )?;
                }
                Attribute::Joints(set) => put(&mut attributes.joints, set),
                Attribute::Weights(set) => put(&mut attributes.weights, set),
                Attribute::Own => {}
            }
        }
        attributes.check_sets(file, value, is_target)?;
        Ok(attributes)
    }

    /// Checks that sets are numbered without gaps, and that joints and weights match.
    fn check_sets(&self, file: &File<'_>, value: Value<'_>, is_target: bool) -> Read<()> {
        let sets: [(&str, &[Option<Accessor<'_>>]); 3] =
            [("TEXCOORD", &self.uvs), ("JOINTS", &self.joints), ("WEIGHTS", &self.weights)];
        for (name, sets) in sets {
            if let Some(missing) = sets.iter().position(Option::is_none)
                && !is_target
            {
                file.breach(
                    value.wrong(format!("{name}_{missing} is missing")).expected("sets that count from 0"),
                )?;
            }
        }
        if self.joints.len() != self.weights.len() {
            let wrong = value.wrong("as many sets of joints as of weights are needed");
            file.breach(wrong.found(format!("{} and {}", self.joints.len(), self.weights.len())))?;
        }
        Ok(())
    }

    /// The number of vertices.
    fn count(&self) -> Option<usize> {
        self.position.as_ref().map(|p| p.count)
    }
}

impl<'a> Primitive<'a> {
    /// A primitive that is complete and consistent.
    pub(super) fn read(file: &'a File<'_>, value: Value<'a>, variant: Option<usize>) -> Read<Self> {
        let mode = Mode::read(value)?;
        let attributes_value = value.need("attributes")?;
        let attributes = Attributes::read(file, attributes_value, false)?;
        if attributes_value.members()?.next().is_none() {
            file.breach(attributes_value.wrong("primitive without attributes"))?;
        }
        let indices = match value.get("indices")? {
            None => None,
            Some(index) => {
                let accessor = Accessor::named(file, index)?;
                accessor.expect(
                    index,
                    &[Element::Scalar],
                    &[Component::U8, Component::U16, Component::U32],
                )?;
                if accessor.normalized {
                    file.breach(index.wrong("normalized indices"))?;
                }
                if accessor.view.is_some_and(|(_, has_stride)| has_stride) {
                    file.breach(index.wrong("indices in a buffer view with a stride"))?;
                }
                Some(accessor)
            }
        };
        let count = indices.as_ref().map(|i| i.count).or(attributes.count());
        if let Some(count) = count.filter(|&count| mode.whole(count) != count) {
            let warning =
                value.wrong("left-over vertices are left out").found(format!("{count} of {}", mode.name()));
            file.push(crate::Diagnostic { severity: crate::Severity::Warning, ..warning });
        }
        let mut targets = vec![];
        if let Some(list) = value.get("targets")? {
            for target in list.array()? {
                let read = Attributes::read(file, target, true)?;
                let pairs = [
                    (&read.position, &attributes.position, "POSITION"),
                    (&read.normal, &attributes.normal, "NORMAL"),
                    (&read.tangent, &attributes.tangent, "TANGENT"),
                    (&read.colour, &attributes.colour, "COLOR_0"),
                ];
                let sets = read
                    .uvs
                    .iter()
                    .enumerate()
                    .map(|(set, uv)| (uv, attributes.uvs.get(set).unwrap_or(&None), "TEXCOORD"));
                for (added, base, name) in pairs.into_iter().chain(sets) {
                    let Some(added) = added else { continue };
                    let Some(base) = base else {
                        return Err(target
                            .wrong("morph target of an attribute that does not exist")
                            .found(name)
                            .into());
                    };
                    if added.count != base.count {
                        let wrong = target.wrong("morph target of another length than its base");
                        let found = format!("{} elements of {name}", added.count);
                        return Err(wrong.found(found).expected(base.count).into());
                    }
                }
                targets.push(read);
            }
            if targets.is_empty() {
                file.breach(list.wrong("empty list").expected("one morph target or more, or no list"))?;
            }
        }
        let material = Self::material(file, value, variant)?;
        Ok(Self { value, mode, attributes, targets, indices, material })
    }

    /// Every accessor, and whether it is used for indices.
    pub(super) fn accessors(&self) -> impl Iterator<Item = (&Accessor<'a>, bool)> {
        let vertices = std::iter::once(&self.attributes).chain(&self.targets).flat_map(|a| {
            let sets = [&a.uvs, &a.joints, &a.weights].into_iter().flatten();
            [&a.position, &a.normal, &a.tangent, &a.colour].into_iter().chain(sets).flatten()
        });
        vertices.map(|accessor| (accessor, false)).chain(self.indices.iter().map(|accessor| (accessor, true)))
    }

    fn material(file: &File<'_>, value: Value<'_>, variant: Option<usize>) -> Read<Option<usize>> {
        let own = file.named(List::Materials, value, "material")?.map(|(index, _)| index);
        let Some(variants) = value.extension("KHR_materials_variants")? else { return Ok(own) };
        let mut chosen = own;
        for mapping in variants.need("mappings")?.array()? {
            let (material, _) = file.at(List::Materials, mapping.need("material")?)?;
            for name in mapping.need("variants")?.array()? {
                let (index, _) = file.at(List::Variants, name)?;
                if variant == Some(index) {
                    chosen = Some(material);
                }
            }
        }
        Ok(chosen)
    }
}

/// A mesh at one time.
#[derive(Clone, Copy, Default)]
pub(super) struct Pose<'p> {
    /// The weights of morph targets; missing ones are 0.
    pub weights: &'p [f64],
    /// The matrices of joints; `None` without a skin.
    pub joints: Option<&'p [DMat4]>,
}

/// The vertices of a primitive.
#[derive(Clone, Debug, Default)]
pub(super) struct Vertices {
    pub positions: Vec<Vec3>,
    pub normals: Option<Vec<Vec3>>,
    /// With the sign of the bitangent, as [`lumbre_scene::MeshDesc::tangents`].
    pub tangents: Option<Vec<Vec4>>,
    pub uvs: Vec<Option<Vec<Vec2>>>,
    /// Linear colours and alphas.
    pub colours: Option<Vec<(Rgb, f32)>>,
    /// Their positions at other times, if they move.
    pub moments: Vec<MeshMoment>,
}

/// Reads the vertices of a primitive in a pose. Only the uv sets for which `wants` is true are read.
pub(super) fn vertices(
    file: &File<'_>,
    primitive: &Primitive<'_>,
    pose: Pose<'_>,
    wants: impl Fn(usize) -> bool,
) -> Read<Vertices> {
    let attributes = &primitive.attributes;
    let Some(position) = &attributes.position else { return Ok(Vertices::default()) };
    let vec3 = |accessor: &Accessor<'_>| accessor.vectors(file, Vec3::from_array);
    let mut vertices = Vertices {
        positions: vec3(position)?,
        normals: attributes.normal.as_ref().map(vec3).transpose()?,
        tangents: attributes.tangent.as_ref().map(|t| t.vectors(file, Vec4::from_array)).transpose()?,
        uvs: vec![],
        colours: attributes.colour.as_ref().map(|colour| colours(file, colour)).transpose()?,
        moments: vec![],
    };
    for (set, accessor) in attributes.uvs.iter().enumerate() {
        let accessor = accessor.as_ref().filter(|_| wants(set));
        vertices.uvs.push(accessor.map(|a| a.vectors(file, Vec2::from_array)).transpose()?);
    }
    morph(file, primitive, pose.weights, &mut vertices)?;
    if let Some(joints) = pose.joints {
        bend(file, primitive, joints, &mut vertices)?;
    }
    Ok(vertices)
}

fn colours(file: &File<'_>, accessor: &Accessor<'_>) -> Read<Vec<(Rgb, f32)>> {
    match accessor.element {
        Element::Vec4 => accessor.vectors(file, |[r, g, b, a]| (Rgb::new(r, g, b), a)),
        _ => {
            let colours = accessor.floats(file)?;
            file.budget.array::<[f32; 1]>(colours.len() as u64, "alphas of colours")?;
            Ok(colours.into_iter().map(|[r, g, b]| (Rgb::new(r, g, b), 1.0)).collect())
        }
    }
}

/// Returns the charge for numbers that are no longer needed.
fn release<T>(file: &File<'_>, numbers: Vec<T>) {
    file.budget.release((numbers.len() * size_of::<T>()) as u64);
}

fn morph(file: &File<'_>, primitive: &Primitive<'_>, weights: &[f64], vertices: &mut Vertices) -> Read<()> {
    for (target, &weight) in primitive.targets.iter().zip(weights).filter(|(_, weight)| **weight != 0.0) {
        let weight = weight as f32;
        let vec3 = |accessor: &Accessor<'_>, to: &mut [Vec3]| -> Read<()> {
            let added = accessor.vectors(file, Vec3::from_array)?;
            to.iter_mut().zip(&added).for_each(|(to, added)| *to += weight * *added);
            release(file, added);
            Ok(())
        };
        if let Some(accessor) = &target.position {
            vec3(accessor, &mut vertices.positions)?;
        }
        if let (Some(accessor), Some(normals)) = (&target.normal, &mut vertices.normals) {
            vec3(accessor, normals)?;
        }
        if let (Some(accessor), Some(tangents)) = (&target.tangent, &mut vertices.tangents) {
            let added = accessor.vectors(file, Vec3::from_array)?;
            tangents.iter_mut().zip(&added).for_each(|(to, added)| *to += (weight * *added).extend(0.0));
            release(file, added);
        }
        for (accessor, uvs) in target.uvs.iter().zip(&mut vertices.uvs) {
            if let (Some(accessor), Some(uvs)) = (accessor, uvs) {
                let added = accessor.vectors(file, Vec2::from_array)?;
                uvs.iter_mut().zip(&added).for_each(|(to, added)| *to += weight * *added);
                release(file, added);
            }
        }
        if let (Some(accessor), Some(colours)) = (&target.colour, &mut vertices.colours) {
            let added = self::colours(file, accessor)?;
            let has_coverage = accessor.element == Element::Vec4;
            for (to, (colour, coverage)) in colours.iter_mut().zip(&added) {
                to.0 = (to.0 + *colour * weight).clamp(0.0, 1.0);
                if has_coverage {
                    to.1 = (to.1 + coverage * weight).clamp(0.0, 1.0);
                }
            }
            release(file, added);
        }
    }
    for n in vertices.normals.iter_mut().flatten() {
        *n = n.normalize_or_zero();
    }
    for t in vertices.tangents.iter_mut().flatten() {
        *t = t.truncate().normalize_or_zero().extend(t.w);
    }
    Ok(())
}

/// Skins vertices.
fn bend(file: &File<'_>, primitive: &Primitive<'_>, joints: &[DMat4], vertices: &mut Vertices) -> Read<()> {
    let count = vertices.positions.len();
    let mut sets = vec![];
    for (indices, weights) in primitive.attributes.joints.iter().zip(&primitive.attributes.weights) {
        if let (Some(indices), Some(weights)) = (indices, weights) {
            let read = indices.wholes::<4>(file)?;
            let wrong = read.iter().position(|four| four.iter().any(|&j| j as usize >= joints.len()));
            let weights = weights.floats::<4>(file)?;
            // A joint of weight zero may be any.
            let used =
                |i: usize| (0..4).find(|&k| weights[i][k] != 0.0 && read[i][k] as usize >= joints.len());
            if let Some((i, k)) = wrong.and_then(|from| (from..count).find_map(|i| Some((i, used(i)?)))) {
                let wrong = indices.value.wrong("joint that the skin does not have");
                let found = format!("{} at vertex {i}", read[i][k]);
                return Err(wrong
                    .found(found)
                    .expected(format!("0 to {}", joints.len().saturating_sub(1)))
                    .into());
            }
            sets.push((read, weights));
        }
    }
    for i in 0..count {
        let mut matrix = DMat4::ZERO;
        let mut sum = 0.0;
        for (indices, weights) in &sets {
            for (&joint, &weight) in indices[i].iter().zip(&weights[i]) {
                if weight != 0.0 && weight.is_finite() {
                    let weight = f64::from(weight);
                    matrix += joints[joint as usize] * weight;
                    sum += weight;
                }
            }
        }
        if sum <= 0.0 {
            continue;
        }
        let matrix = matrix * (1.0 / sum);
        let linear = DMat3::from_mat4(matrix);
        vertices.positions[i] = matrix.transform_point3(vertices.positions[i].as_dvec3()).as_vec3();
        if let Some(normals) = &mut vertices.normals {
            normals[i] = (cofactors(&linear) * normals[i].as_dvec3()).normalize_or_zero().as_vec3();
        }
        if let Some(tangents) = &mut vertices.tangents {
            let turned = (linear * tangents[i].truncate().as_dvec3()).normalize_or_zero().as_vec3();
            let side = if linear.determinant() < 0.0 { -1.0 } else { 1.0 };
            tangents[i] = turned.extend(side * tangents[i].w);
        }
    }
    for (indices, weights) in sets {
        release(file, indices);
        release(file, weights);
    }
    Ok(())
}

/// The matrix of normals, for singular `m` too; mirrors if `m` does.
pub(super) fn cofactors(m: &DMat3) -> DMat3 {
    let [x, y, z] = [m.x_axis, m.y_axis, m.z_axis];
    let sign = if m.determinant() < 0.0 { -1.0 } else { 1.0 };
    DMat3::from_cols(sign * y.cross(z), sign * z.cross(x), sign * x.cross(y))
}

/// The shapes of a primitive, by vertex indices.
#[derive(Clone, Debug)]
pub(super) enum Assembly {
    Points(Vec<u32>),
    /// Segments, and whether the next one continues from this one's end.
    Segments(Vec<([u32; 2], bool)>),
    Triangles(Vec<[u32; 3]>),
}

/// Assembles shapes from a primitive's vertices. Missing indices and vertices that are not finite are an error;
/// when lenient, such shapes are dropped with a warning.
pub(super) fn assemble(file: &File<'_>, primitive: &Primitive<'_>, positions: &[Vec3]) -> Read<Assembly> {
    if let Some(triangles) = listed_triangles(file, primitive, positions)? {
        return Ok(Assembly::Triangles(triangles));
    }
    let listed = match &primitive.indices {
        Some(accessor) => Some((accessor, accessor.wholes::<1>(file)?)),
        None => None,
    };
    let count = listed.as_ref().map_or(positions.len(), |(_, indices)| indices.len());
    let count = primitive.mode.whole(count);
    let vertex = |i: usize| listed.as_ref().map_or(i as u32, |(_, indices)| indices[i][0]);
    // Usually every vertex is valid, which is quickly checked for all at once.
    let is_there = |&[i]: &[u32; 1]| (i as usize) < positions.len();
    let all_are_there =
        listed.as_ref().is_none_or(|(_, indices)| indices.par_iter().with_min_len(SHARE).all(is_there));
    let all_are_fine = all_are_there && positions.par_iter().with_min_len(SHARE).all(|p| p.is_finite());
    let check = |i: usize| -> Read<bool> {
        if all_are_fine {
            return Ok(true);
        }
        let v = vertex(i);
        let (message, culprit, found, expected) = match positions.get(v as usize) {
            Some(p) if p.is_finite() => return Ok(true),
            Some(p) => {
                let culprit = primitive.attributes.position.as_ref().map_or(primitive.value, |a| a.value);
                (
                    "vertex that is not finite",
                    culprit,
                    format!("{p} as vertex {v}"),
                    "finite numbers".to_owned(),
                )
            }
            None => {
                let culprit = listed.as_ref().map_or(primitive.value, |(accessor, _)| accessor.value);
                let expected = match positions.len() {
                    0 => "vertices".to_owned(),
                    n => format!("0 to {}", n - 1),
                };
                ("index of a vertex that does not exist", culprit, format!("{v} as index {i}"), expected)
            }
        };
        let wrong = culprit.wrong(message).found(found).expected(expected);
        file.breach(wrong).map(|()| false)
    };
    let all = |corners: &[usize]| -> Read<bool> {
        for &corner in corners {
            if !check(corner)? {
                return Ok(false);
            }
        }
        Ok(true)
    };
    let assembly = match primitive.mode {
        Mode::Points => {
            let mut points = file.budget.vec(count as u64, "points")?;
            for i in 0..count {
                if check(i)? {
                    points.push(vertex(i));
                }
            }
            Assembly::Points(points)
        }
        Mode::Lines | Mode::LineStrip | Mode::LineLoop => {
            let segments = match primitive.mode {
                Mode::Lines => count / 2,
                Mode::LineStrip => count.saturating_sub(1),
                _ => count,
            };
            let mut list = file.budget.vec(segments as u64, "lines")?;
            for k in 0..segments {
                let (a, b, goes_on) = match primitive.mode {
                    Mode::Lines => (2 * k, 2 * k + 1, false),
                    Mode::LineStrip => (k, k + 1, k + 1 < segments),
                    _ => (k, (k + 1) % count, true),
                };
                if all(&[a, b])? {
                    list.push(([vertex(a), vertex(b)], goes_on));
                }
            }
            Assembly::Segments(list)
        }
        Mode::Triangles | Mode::TriangleStrip | Mode::TriangleFan => {
            let triangles = match primitive.mode {
                Mode::Triangles => count / 3,
                _ => count.saturating_sub(2),
            };
            let mut list = file.budget.vec(triangles as u64, "triangles")?;
            let corners = |k: usize| match primitive.mode {
                Mode::Triangles => [3 * k, 3 * k + 1, 3 * k + 2],
                Mode::TriangleStrip => [k, k + 1 + k % 2, k + 2 - k % 2],
                _ => [k + 1, k + 2, 0],
            };
            if all_are_fine {
                list.par_extend(
                    (0..triangles).into_par_iter().with_min_len(SHARE).map(|k| corners(k).map(vertex)),
                );
            } else {
                for k in 0..triangles {
                    if all(&corners(k))? {
                        list.push(corners(k).map(vertex));
                    }
                }
            }
            Assembly::Triangles(list)
        }
    };
    if let Some((_, indices)) = listed {
        release(file, indices);
    }
    Ok(assembly)
}

/// The triangles of a primitive whose indices list them one after another, if all of them are valid.
fn listed_triangles(
    file: &File<'_>,
    primitive: &Primitive<'_>,
    positions: &[Vec3],
) -> Read<Option<Vec<[u32; 3]>>> {
    let listed = primitive.indices.filter(|_| primitive.mode == Mode::Triangles);
    let Some(listed) = listed.and_then(|indices| indices.by_threes()) else { return Ok(None) };
    let triangles = listed.wholes::<3>(file)?;
    let is_there = |triangle: &[u32; 3]| triangle.iter().all(|&i| (i as usize) < positions.len());
    if triangles.par_iter().with_min_len(SHARE).all(is_there)
        && positions.par_iter().with_min_len(SHARE).all(|p| p.is_finite())
    {
        return Ok(Some(triangles));
    }
    release(file, triangles);
    Ok(None)
}

/// Removes unused vertices if there are many: exporters let parts of a mesh share one long list.
pub(super) fn compact(vertices: &mut Vertices, triangles: &mut [[u32; 3]]) {
    let count = vertices.positions.len();
    if triangles.len() * 3 >= count / 2 {
        return;
    }
    let mut new_of: HashMap<u32, u32> = HashMap::new();
    let mut old: Vec<u32> = vec![];
    for corner in triangles.iter_mut().flatten() {
        *corner = *new_of.entry(*corner).or_insert_with(|| {
            old.push(*corner);
            old.len() as u32 - 1
        });
    }
    vertices.pick(&old);
}

impl Vertices {
    /// A shape between two vertices, with their colours if they have any.
    pub(super) fn coloured(&self, shape: Shape, ends: [u32; 2]) -> GeometryDesc {
        let Some(colours) = &self.colours else { return GeometryDesc::Exact(shape) };
        let ends = ends.map(|i| i as usize);
        GeometryDesc::Coloured(Box::new(ColouredShape {
            shape,
            ends: ends.map(|i| self.positions[i].as_dvec3()),
            colours: ends.map(|i| colours[i].0),
            coverages: ends.map(|i| colours[i].1),
        }))
    }

    /// Selects vertices by their old indices.
    pub(super) fn pick(&mut self, old: &[u32]) {
        fn pick<T: Copy>(old: &[u32], list: &mut Vec<T>) {
            *list = old.iter().map(|&i| list[i as usize]).collect();
        }
        pick(old, &mut self.positions);
        if let Some(list) = &mut self.normals {
            pick(old, list);
        }
        if let Some(list) = &mut self.tangents {
            pick(old, list);
        }
        for list in self.uvs.iter_mut().flatten() {
            pick(old, list);
        }
        if let Some(list) = &mut self.colours {
            pick(old, list);
        }
        for moment in &mut self.moments {
            pick(old, &mut moment.positions);
            if let Some(list) = &mut moment.normals {
                pick(old, list);
            }
        }
    }
}

/// The diagonal of the bounding box of points.
pub(super) fn diagonal(points: impl Iterator<Item = Vec3>) -> f64 {
    let (mut low, mut high) = (DVec3::INFINITY, DVec3::NEG_INFINITY);
    for p in points.filter(|p| p.is_finite()) {
        low = low.min(p.as_dvec3());
        high = high.max(p.as_dvec3());
    }
    let size = high - low;
    if size.is_finite() { size.length() } else { 0.0 }
}
