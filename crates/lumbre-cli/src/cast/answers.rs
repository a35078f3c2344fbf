//! Query results as CSV, .npy or .npz.

use std::io::{self, Cursor, Write};

use lumbre::CastHit;
use zip::write::SimpleFileOptions;

use super::npy;

/// A row of the results: a ray and its hit.
#[derive(Clone, Debug)]
pub struct Answer {
    /// The 0-based index of the ray.
    pub ray: u64,
    /// The hit, if any.
    pub hit: Option<CastHit>,
}

/// The output formats.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Form {
    /// Comma-separated values with a header.
    Csv,
    /// One array of records.
    Npy,
    /// One array per column.
    Npz,
}

/// A column of the results: its name, its NumPy type, and its little-endian bytes for one row.
struct Column {
    name: &'static str,
    kind: &'static str,
    bytes: fn(&Answer, &mut Vec<u8>),
}

macro_rules! number {
    ($name:literal, $value:expr) => {
        Column {
            name: $name,
            kind: "<f8",
            bytes: |answer, out| {
                let value: fn(&CastHit) -> f64 = $value;
                out.extend(answer.hit.as_ref().map_or(f64::NAN, value).to_le_bytes());
            },
        }
    };
}

macro_rules! index {
    ($name:literal, $value:expr) => {
        Column {
            name: $name,
            kind: "<i8",
            bytes: |answer, out| {
                let value: fn(&CastHit) -> Option<u32> = $value;
                out.extend(answer.hit.as_ref().and_then(value).map_or(-1, i64::from).to_le_bytes());
            },
        }
    };
}

/// The columns of .npy and .npz: a miss has `hit` false, t = inf, NaN coordinates and -1 for indices.
const COLUMNS: &[Column] = &[
    Column { name: "ray", kind: "<u8", bytes: |answer, out| out.extend(answer.ray.to_le_bytes()) },
    Column { name: "hit", kind: "|b1", bytes: |answer, out| out.push(u8::from(answer.hit.is_some())) },
    Column {
        name: "t",
        kind: "<f8",
        bytes: |answer, out| out.extend(answer.hit.as_ref().map_or(f64::INFINITY, |hit| hit.t).to_le_bytes()),
    },
    number!("px", |hit| hit.point.x),
    number!("py", |hit| hit.point.y),
    number!("pz", |hit| hit.point.z),
    number!("nx", |hit| hit.normal.x),
    number!("ny", |hit| hit.normal.y),
    number!("nz", |hit| hit.normal.z),
    number!("u", |hit| hit.uv.x),
    number!("v", |hit| hit.uv.y),
    Column {
        name: "front",
        kind: "|b1",
        bytes: |answer, out| out.push(u8::from(answer.hit.as_ref().is_some_and(|hit| hit.front))),
    },
    index!("shape", |hit| Some(hit.shape)),
    index!("prim", |hit| Some(hit.primitive)),
    index!("instance", |hit| hit.instance),
];

/// Writes results.
///
/// Those of the writer.
pub fn write(out: &mut dyn Write, form: Form, answers: &[Answer]) -> io::Result<()> {
    match form {
        Form::Csv => csv(out, answers),
        Form::Npy => {
            let fields: Vec<String> =
                COLUMNS.iter().map(|c| format!("('{}', '{}')", c.name, c.kind)).collect();
            let mut bytes = Vec::new();
            for answer in answers {
                COLUMNS.iter().for_each(|column| (column.bytes)(answer, &mut bytes));
            }
            npy::write(out, &format!("[{}]", fields.join(", ")), &[answers.len()], &bytes)
        }
        Form::Npz => {
            let mut archive = zip::ZipWriter::new(Cursor::new(Vec::new()));
            let options = SimpleFileOptions::default()
                .compression_method(zip::CompressionMethod::Stored)
                .last_modified_time(zip::DateTime::default());
            for column in COLUMNS {
                let mut bytes = Vec::new();
                answers.iter().for_each(|answer| (column.bytes)(answer, &mut bytes));
                archive.start_file(format!("{}.npy", column.name), options)?;
                npy::write(&mut archive, &format!("'{}'", column.kind), &[answers.len()], &bytes)?;
            }
            out.write_all(archive.finish()?.get_ref())
        }
    }
}

fn csv(out: &mut dyn Write, answers: &[Answer]) -> io::Result<()> {
    writeln!(out, "ray,hit,t,px,py,pz,nx,ny,nz,u,v,front,shape,prim,instance")?;
    for Answer { ray, hit } in answers {
        let Some(hit) = hit else {
            writeln!(out, "{ray},0{}", ",".repeat(13))?;
            continue;
        };
        // Debug prints the shortest decimal that reads back to the same bits.
        let numbers = [
            hit.t,
            hit.point.x,
            hit.point.y,
            hit.point.z,
            hit.normal.x,
            hit.normal.y,
            hit.normal.z,
            hit.uv.x,
            hit.uv.y,
        ];
        write!(out, "{ray},1")?;
        for number in numbers {
            write!(out, ",{number:?}")?;
        }
        let instance = hit.instance.map_or(String::new(), |i| i.to_string());
        writeln!(out, ",{},{},{},{instance}", u8::from(hit.front), hit.shape, hit.primitive)?;
    }
    Ok(())
}

/// Writes the number of hits, or whether there is any, for each ray.
///
/// Those of the writer.
pub fn write_counts(out: &mut dyn Write, form: Form, name: &str, counts: &[u64]) -> io::Result<()> {
    let bytes: Vec<u8> = counts.iter().flat_map(|count| count.to_le_bytes()).collect();
    match form {
        Form::Csv => {
            writeln!(out, "ray,{name}")?;
            counts.iter().enumerate().try_for_each(|(ray, count)| writeln!(out, "{ray},{count}"))
        }
        Form::Npy => npy::write(out, "'<u8'", &[counts.len()], &bytes),
        Form::Npz => {
            let mut archive = zip::ZipWriter::new(Cursor::new(Vec::new()));
            let options = SimpleFileOptions::default()
                .compression_method(zip::CompressionMethod::Stored)
                .last_modified_time(zip::DateTime::default());
            archive.start_file(format!("{name}.npy"), options)?;
            npy::write(&mut archive, "'<u8'", &[counts.len()], &bytes)?;
            out.write_all(archive.finish()?.get_ref())
        }
    }
}
