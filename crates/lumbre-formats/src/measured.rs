//! Measured materials in files of the RGL material database (`.bsdf`): spectral ones, and those of three channels.
//!
//! A file is a list of named arrays. Dupuy and Jakob, "An Adaptive Parameterization for Efficient Material Acquisition
//! and Rendering", SIGGRAPH Asia 2018.

use std::mem::size_of;
use std::sync::Arc;

use lumbre_shading::measured::{MeasuredParts, MeasuredTables};
use lumbre_shading::spectrum::channel_weights;

use crate::budget::{Budget, Hold};
use crate::bytes::Bytes;
use crate::diagnostic::{Diagnostic, FormatError, quoted, quoted_bytes};

type Result<T> = std::result::Result<T, FormatError>;

/// The first bytes of a file, and its version.
const MAGIC: &[u8; 12] = b"tensor_file\0";
const VERSION: [u8; 2] = [1, 0];
/// Fields that a file may have at most; published files have a dozen.
const MAX_FIELDS: u32 = 1024;
/// Indices that an array may have at most.
const MAX_RANK: usize = 8;

/// Reads a measured material. What is kept is charged to the budget.
///
/// Spectra are taken at the colours that they have under D65, as those of other surfaces.
///
/// # Errors
/// [`FormatError::Input`] with the byte of what is wrong, and [`FormatError::Limit`].
pub fn read(bytes: &[u8], name: &Arc<str>, budget: &Budget) -> Result<MeasuredTables> {
    let mut hold = budget.hold_nothing();
    let file = Tensors::new(Bytes::new(bytes, name), &mut hold)?;
    let hold = &mut hold;
    let theta_i = file.ascending("theta_i", hold)?;
    let phi_i = file.ascending("phi_i", hold)?;
    let directions = [phi_i.values.len(), theta_i.values.len()];
    check_span(&phi_i)?;

    let ndf = file.numbers("ndf", &[Size::Nodes, Size::Nodes], Sign::NotNegative, hold)?;
    let sigma = file.numbers("sigma", &[Size::Nodes, Size::Nodes], Sign::NotNegative, hold)?;
    let [of_phi, of_theta] = directions.map(Size::Exactly);
    let each = [of_phi, of_theta, Size::Nodes, Size::Nodes];
    let vndf = file.numbers("vndf", &each, Sign::NotNegative, hold)?;
    let luminance = file.numbers("luminance", &each, Sign::NotNegative, hold)?;
    let of_colour = luminance.last_two();
    // The tables are copied, and the densities have an integral for each number.
    let numbers = 2 * (vndf.values.len() + luminance.values.len()) + ndf.values.len() + sigma.values.len();
    let colours = 3 * luminance.values.len();
    budget.bytes(((numbers + colours) * size_of::<f32>()) as u64, "measured material")?;
    let [rows, columns] = of_colour.map(Size::Exactly);
    let colours = if file.has("rgb") {
        let rgb =
            file.numbers("rgb", &[of_phi, of_theta, Size::Exactly(3), rows, columns], Sign::Any, hold)?;
        in_channels(&rgb, of_colour, 3, &[[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]])
    } else {
        let wavelengths = file.ascending("wavelengths", hold)?;
        let count = wavelengths.values.len();
        let shape = [of_phi, of_theta, Size::Exactly(count), rows, columns];
        let spectra = file.numbers("spectra", &shape, Sign::Any, hold)?;
        in_channels(&spectra, of_colour, count, &channel_weights(&wavelengths.values))
    };
    let parts = MeasuredParts {
        size: [ndf.last_two(), sigma.last_two(), vndf.last_two(), of_colour],
        theta_i: theta_i.values,
        phi_i: phi_i.values,
        ndf: ndf.values,
        sigma: sigma.values,
        vndf: vndf.values,
        luminance: luminance.values,
        colours,
    };
    Ok(MeasuredTables::new(parts).expect("its sizes were checked"))
}

/// Weighted sums over the third index of an array.
fn in_channels(
    array: &Array,
    [rows, columns]: [usize; 2],
    count: usize,
    weights: &[[f64; 3]],
) -> [Vec<f32>; 3] {
    let each = rows * columns;
    let mut channels = [const { Vec::new() }; 3];
    for slice in array.values.chunks_exact(count * each) {
        for place in 0..each {
            let mut sum = [0.0; 3];
            for (layer, weight) in weights.iter().enumerate() {
                let value = f64::from(slice[layer * each + place]);
                for (sum, weight) in sum.iter_mut().zip(weight) {
                    *sum += weight * value;
                }
            }
            for (channel, sum) in channels.iter_mut().zip(sum) {
                channel.push(sum as f32);
            }
        }
    }
    channels
}

/// Azimuths have to go all the way round, unless there are only one or two, for an isotropic material.
fn check_span(phi_i: &Array) -> Result<()> {
    let (first, last) = (phi_i.values[0], phi_i.values[phi_i.values.len() - 1]);
    let spans = (last - first - std::f32::consts::TAU).abs() < 0.01;
    if phi_i.values.len() <= 2 || spans {
        return Ok(());
    }
    let wrong = phi_i.fault("the azimuths of this measured material do not go all the way round");
    Err(wrong.found(format!("{first} to {last}")).expected("a range of 2π, or one azimuth").into())
}

/// What an index of an array has to run over.
#[derive(Clone, Copy)]
enum Size {
    Exactly(usize),
    /// At least two.
    Nodes,
    /// At least one.
    Some,
}

/// The numbers that an array may hold, all finite.
#[derive(Clone, Copy, PartialEq)]
enum Sign {
    Any,
    NotNegative,
}

/// A named array of a file.
struct Field<'a> {
    name: String,
    /// Where it is described.
    at: u64,
    kind: u8,
    shape: Vec<u64>,
    offset: u64,
    bytes: Bytes<'a>,
}

impl Field<'_> {
    fn fault(&self, message: &str) -> Diagnostic {
        self.bytes.fault(self.at, format!("field {}: {message}", quoted(&self.name)))
    }
}

/// The numbers of a field.
struct Array {
    shape: Vec<usize>,
    values: Vec<f32>,
    fault: Diagnostic,
}

impl Array {
    fn last_two(&self) -> [usize; 2] {
        let n = self.shape.len();
        [self.shape[n - 2], self.shape[n - 1]]
    }

    fn fault(&self, message: &str) -> Diagnostic {
        let mut fault = self.fault.clone();
        fault.message = format!("{}: {message}", fault.message);
        fault
    }
}

/// The arrays of a file.
struct Tensors<'a> {
    bytes: Bytes<'a>,
    fields: Vec<Field<'a>>,
}

impl<'a> Tensors<'a> {
    fn new(bytes: Bytes<'a>, hold: &mut Hold<'_>) -> Result<Self> {
        if bytes.all().starts_with(b"SCATFUN") {
            let wrong = bytes.fault(0, "this is a Fourier BSDF of pbrt-v3, not a measured one");
            return Err(wrong.expected("a .bsdf file of the RGL material database").into());
        }
        let magic = bytes.array::<12>(0, "measured material")?;
        if magic != *MAGIC {
            let wrong = bytes.fault(0, "not a measured material").found(quoted_bytes(&magic));
            return Err(wrong.expected("a .bsdf file of the RGL material database").into());
        }
        let version = bytes.array::<2>(12, "version")?;
        if version != VERSION {
            let wrong = bytes.fault(12, "a measured material of another version");
            return Err(wrong.found(format!("{}.{}", version[0], version[1])).expected("version 1.0").into());
        }
        let count = bytes.u32(14, "number of fields")?;
        if count > MAX_FIELDS {
            let wrong = bytes.fault(14, "too many fields").found(count);
            return Err(wrong.expected(format!("at most {MAX_FIELDS}")).into());
        }
        let mut fields: Vec<Field<'a>> = vec![];
        let mut at = 18;
        for _ in 0..count {
            let start = at;
            let length = u64::from(bytes.u16(at, "name of a field")?);
            let name = bytes.part(at + 2..at + 2 + length, "name of a field")?;
            let name = String::from_utf8_lossy(name).into_owned();
            at += 2 + length;
            let rank = usize::from(bytes.u16(at, "field")?);
            let [kind] = bytes.array::<1>(at + 2, "field")?;
            let offset = bytes.u64(at + 3, "field")?;
            at += 11;
            if rank > MAX_RANK {
                let wrong = bytes.fault(start, format!("field {} has too many indices", quoted(&name)));
                return Err(wrong.found(rank).expected(format!("at most {MAX_RANK}")).into());
            }
            if fields.iter().any(|field| field.name == name) {
                return Err(bytes.fault(start, format!("field {} is there twice", quoted(&name))).into());
            }
            let mut shape = Vec::with_capacity(rank);
            for _ in 0..rank {
                shape.push(bytes.u64(at, "size of a field")?);
                at += 8;
            }
            hold.grow((size_of::<Field<'_>>() + name.len() + 8 * rank) as u64, "fields")?;
            fields.push(Field { name, at: start, kind, shape, offset, bytes });
        }
        Ok(Self { bytes, fields })
    }

    fn has(&self, name: &str) -> bool {
        self.fields.iter().any(|field| field.name == name)
    }

    /// The numbers of a field of this name and shape.
    fn numbers(&self, name: &str, shape: &[Size], sign: Sign, hold: &mut Hold<'_>) -> Result<Array> {
        let Some(field) = self.fields.iter().find(|field| field.name == name) else {
            let wrong = self.bytes.fault(14, format!("the file has no field {}", quoted(name)));
            let known: Vec<String> = self.fields.iter().map(|field| quoted(&field.name)).collect();
            return Err(wrong.found(known.join(", ")).into());
        };
        let (width, kind) = match field.kind {
            10 => (4, Kind::Single),
            11 => (8, Kind::Double),
            other => {
                let wrong = field.fault("not of floating-point numbers").found(format!("type {other}"));
                return Err(wrong.expected("type 10 (single precision) or 11 (double)").into());
            }
        };
        let fits = |(size, wanted): (&u64, &Size)| match *wanted {
            Size::Exactly(wanted) => *size == wanted as u64,
            Size::Nodes => *size >= 2,
            Size::Some => *size >= 1,
        };
        if field.shape.len() != shape.len() || !field.shape.iter().zip(shape).all(fits) {
            let found: Vec<String> = field.shape.iter().map(u64::to_string).collect();
            let size = |size: &Size| match size {
                Size::Exactly(n) => n.to_string(),
                Size::Nodes => "2 or more".to_owned(),
                Size::Some => "1 or more".to_owned(),
            };
            let expected: Vec<String> = shape.iter().map(size).collect();
            let wrong = field.fault("wrong sizes").found(found.join(" × "));
            return Err(wrong.expected(expected.join(" × ")).into());
        }
        let count = field.shape.iter().try_fold(1_u64, |product, &size| product.checked_mul(size));
        let size = count.and_then(|count| count.checked_mul(width));
        let end = size.and_then(|size| field.offset.checked_add(size));
        let data = match end {
            Some(end) if end <= self.bytes.len() => self.bytes.part(field.offset..end, "field")?,
            _ => {
                let wrong = field.fault("reaches beyond the end of the file");
                let found = format!("{} numbers from byte {}", shown(count), field.offset);
                return Err(wrong
                    .found(found)
                    .expected(format!("at most {} bytes", self.bytes.len()))
                    .into());
            }
        };
        let count = data.len() / width as usize;
        hold.grow((count * size_of::<f32>()) as u64, "field of a measured material")?;
        let mut values = Vec::with_capacity(count);
        for (i, number) in data.chunks_exact(width as usize).enumerate() {
            let value = kind.number(number);
            if !value.is_finite() || (sign == Sign::NotNegative && value < 0.0) {
                let at = field.offset + i as u64 * width;
                let wrong = self.bytes.fault(at, format!("field {}: wrong number", quoted(name)));
                let what =
                    if sign == Sign::Any { "a finite number" } else { "a number that is not negative" };
                return Err(wrong.found(value).expected(what).into());
            }
            values.push(value);
        }
        let shape = field.shape.iter().map(|&size| size as usize).collect();
        Ok(Array { shape, values, fault: field.bytes.fault(field.at, format!("field {}", quoted(name))) })
    }

    /// The numbers of a field of one index, each more than the one before.
    fn ascending(&self, name: &str, hold: &mut Hold<'_>) -> Result<Array> {
        let array = self.numbers(name, &[Size::Some], Sign::Any, hold)?;
        match array.values.windows(2).find(|pair| pair[0] >= pair[1]) {
            None => Ok(array),
            Some(pair) => {
                let wrong = array.fault("numbers do not ascend").found(format!("{}, {}", pair[0], pair[1]));
                Err(wrong.expected("numbers that each are more than the one before").into())
            }
        }
    }
}

fn shown(count: Option<u64>) -> String {
    count.map_or_else(|| "very many".to_owned(), |count| count.to_string())
}

/// How numbers are stored.
#[derive(Clone, Copy)]
enum Kind {
    Single,
    Double,
}

impl Kind {
    fn number(self, bytes: &[u8]) -> f32 {
        match self {
            Self::Single => f32::from_le_bytes(bytes.try_into().expect("four bytes")),
            Self::Double => f64::from_le_bytes(bytes.try_into().expect("eight bytes")) as f32,
        }
    }
}

#[cfg(test)]
#[path = "measured/tests.rs"]
mod tests;
