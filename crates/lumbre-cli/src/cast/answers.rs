//! What rays hit, and what is at points, as the bytes of CSV, .npy or .npz.

use std::fmt;
use std::io::Write;

use lumbre::{CastHit, CastPoint};

/// The forms that answers can take.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Form {
    /// Comma-separated text with a header.
    Csv,
    /// One array of records.
    Npy,
    /// One array a column.
    Npz,
}

/// What there is a line of for each answer.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Table {
    /// A ray and what it hit, or nothing.
    Hits,
    /// A ray and a number of this name.
    Numbers(&'static str),
    /// A point and the nearest point of all surfaces, or nothing.
    Nearest,
    /// A point and whether it is this.
    Flags(&'static str),
    /// A point and a real number of this name.
    Reals(&'static str),
}

impl Table {
    /// The first line of CSV.
    pub(super) fn header(self) -> String {
        match self {
            Self::Hits => names(COLUMNS).join(","),
            Self::Nearest => names(NEAREST).join(","),
            Self::Numbers(name) => format!("ray,{name}"),
            Self::Flags(name) | Self::Reals(name) => format!("point,{name}"),
        }
    }

    /// The NumPy type of an answer.
    pub(super) fn descr(self) -> String {
        match self {
            Self::Hits => record(COLUMNS),
            Self::Nearest => record(NEAREST),
            Self::Numbers(_) => "'<u8'".to_owned(),
            Self::Flags(_) => "'|b1'".to_owned(),
            Self::Reals(_) => "'<f8'".to_owned(),
        }
    }

    /// The arrays of a .npz: names and NumPy types.
    pub(super) fn arrays(self) -> Vec<(&'static str, String)> {
        match self {
            Self::Hits => arrays(COLUMNS),
            Self::Nearest => arrays(NEAREST),
            Self::Numbers(name) | Self::Flags(name) | Self::Reals(name) => vec![(name, self.descr())],
        }
    }
}

/// The bytes of some answers in a row.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) struct Block {
    form: Form,
    /// How many answers there are.
    pub answers: u64,
    /// Lines, records, or the values of each array of a .npz.
    pub parts: Vec<Vec<u8>>,
}

impl Block {
    /// No answers.
    pub(super) fn new(form: Form, table: Table) -> Self {
        let parts = if form == Form::Npz { table.arrays().len() } else { 1 };
        Self { form, answers: 0, parts: vec![Vec::new(); parts] }
    }

    /// Adds what a ray hit, or nothing.
    pub(super) fn push_hit(&mut self, ray: u64, hit: Option<&CastHit>) {
        match self.form {
            Form::Csv => push_line(&mut self.parts[0], ray, hit),
            Form::Npy | Form::Npz => self.push_record(COLUMNS, ray, hit),
        }
        self.answers += 1;
    }

    /// Adds what is nearest to a point, or nothing.
    pub(super) fn push_nearest(&mut self, point: u64, nearest: Option<&CastPoint>) {
        match self.form {
            Form::Csv => push_nearest_line(&mut self.parts[0], point, nearest),
            Form::Npy | Form::Npz => self.push_record(NEAREST, point, nearest),
        }
        self.answers += 1;
    }

    /// The values of an answer: one after another, or each into its own array.
    fn push_record<T>(&mut self, columns: &[Column<T>], number: u64, answer: Option<&T>) {
        for (i, column) in columns.iter().enumerate() {
            let part = if self.form == Form::Npz { i } else { 0 };
            (column.bytes)(number, answer, &mut self.parts[part]);
        }
    }

    /// Adds whether something holds of a point.
    pub(super) fn push_flag(&mut self, point: u64, holds: bool) {
        self.answers += 1;
        let out = &mut self.parts[0];
        if self.form == Form::Csv {
            push_text(out, format_args!("{point},{}\n", u8::from(holds)));
        } else {
            out.push(u8::from(holds));
        }
    }

    /// Adds a real number of a point, in CSV so that it reads back to the same bits.
    pub(super) fn push_real(&mut self, point: u64, number: f64) {
        self.answers += 1;
        let out = &mut self.parts[0];
        if self.form == Form::Csv {
            push_text(out, format_args!("{point},{number:?}\n"));
        } else {
            out.extend(number.to_le_bytes());
        }
    }

    /// Adds a number of a ray.
    pub(super) fn push_number(&mut self, ray: u64, number: u64) {
        self.answers += 1;
        let out = &mut self.parts[0];
        if self.form == Form::Csv {
            push_text(out, format_args!("{ray},{number}\n"));
        } else {
            out.extend(number.to_le_bytes());
        }
    }
}

/// Writing to memory cannot fail.
fn push_text(out: &mut Vec<u8>, text: fmt::Arguments) {
    let _ = out.write_fmt(text);
}

fn push_line(out: &mut Vec<u8>, ray: u64, hit: Option<&CastHit>) {
    let Some(hit) = hit else {
        return push_text(out, format_args!("{ray},0,,,,,,,,,,,,,\n"));
    };
    push_text(out, format_args!("{ray},1"));
    let (p, n, uv) = (hit.point, hit.normal, hit.uv);
    // Debug prints the shortest decimal that reads back to the same bits.
    for number in [hit.t, p.x, p.y, p.z, n.x, n.y, n.z, uv.x, uv.y] {
        push_text(out, format_args!(",{number:?}"));
    }
    push_text(out, format_args!(",{},{},{},", u8::from(hit.front), hit.shape, hit.primitive));
    if let Some(instance) = hit.instance {
        push_text(out, format_args!("{instance}"));
    }
    out.push(b'\n');
}

fn push_nearest_line(out: &mut Vec<u8>, point: u64, nearest: Option<&CastPoint>) {
    let Some(nearest) = nearest else {
        return push_text(out, format_args!("{point},0,,,,,,,\n"));
    };
    push_text(out, format_args!("{point},1"));
    let p = nearest.point;
    for number in [nearest.distance, p.x, p.y, p.z] {
        push_text(out, format_args!(",{number:?}"));
    }
    push_text(out, format_args!(",{},{},", nearest.shape, nearest.primitive));
    if let Some(instance) = nearest.instance {
        push_text(out, format_args!("{instance}"));
    }
    out.push(b'\n');
}

/// A column of the answers: its name, its NumPy type, and its little-endian bytes for one answer.
struct Column<T> {
    name: &'static str,
    kind: &'static str,
    bytes: fn(u64, Option<&T>, &mut Vec<u8>),
}

fn names<T>(columns: &[Column<T>]) -> Vec<&'static str> {
    columns.iter().map(|column| column.name).collect()
}

/// The NumPy type of a record.
fn record<T>(columns: &[Column<T>]) -> String {
    let fields: Vec<String> = columns.iter().map(|c| format!("('{}', '{}')", c.name, c.kind)).collect();
    format!("[{}]", fields.join(", "))
}

fn arrays<T>(columns: &[Column<T>]) -> Vec<(&'static str, String)> {
    columns.iter().map(|c| (c.name, format!("'{}'", c.kind))).collect()
}

macro_rules! number {
    ($name:literal, $value:expr) => {
        Column {
            name: $name,
            kind: "<f8",
            bytes: |_, hit, out| {
                out.extend(hit.map_or(f64::NAN, $value).to_le_bytes());
            },
        }
    };
}

macro_rules! index {
    ($name:literal, $value:expr) => {
        Column {
            name: $name,
            kind: "<i8",
            bytes: |_, hit, out| {
                out.extend(hit.and_then($value).map_or(-1, i64::from).to_le_bytes());
            },
        }
    };
}

/// What .npy and .npz hold: a miss has `hit` false, t = inf, NaN coordinates and -1 for names.
const COLUMNS: &[Column<CastHit>] = &[
    Column { name: "ray", kind: "<u8", bytes: |ray, _, out| out.extend(ray.to_le_bytes()) },
    Column { name: "hit", kind: "|b1", bytes: |_, hit, out| out.push(u8::from(hit.is_some())) },
    Column {
        name: "t",
        kind: "<f8",
        bytes: |_, hit, out| out.extend(hit.map_or(f64::INFINITY, |hit| hit.t).to_le_bytes()),
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
        bytes: |_, hit, out| out.push(u8::from(hit.is_some_and(|hit| hit.front))),
    },
    index!("shape", |hit| Some(hit.shape)),
    index!("prim", |hit| Some(hit.primitive)),
    index!("instance", |hit| hit.instance),
];

/// The same of points: where there is nothing near, `found` is false and the distance inf.
const NEAREST: &[Column<CastPoint>] = &[
    Column { name: "point", kind: "<u8", bytes: |point, _, out| out.extend(point.to_le_bytes()) },
    Column { name: "found", kind: "|b1", bytes: |_, nearest, out| out.push(u8::from(nearest.is_some())) },
    Column {
        name: "distance",
        kind: "<f8",
        bytes: |_, nearest, out| {
            out.extend(nearest.map_or(f64::INFINITY, |nearest| nearest.distance).to_le_bytes());
        },
    },
    number!("px", |nearest| nearest.point.x),
    number!("py", |nearest| nearest.point.y),
    number!("pz", |nearest| nearest.point.z),
    index!("shape", |nearest| Some(nearest.shape)),
    index!("prim", |nearest| Some(nearest.primitive)),
    index!("instance", |nearest| nearest.instance),
];
