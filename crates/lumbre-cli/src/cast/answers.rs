//! Answers of `lumbre cast` as the bytes of CSV, .npy or .npz.

use std::fmt;
use std::io::Write;

use lumbre::{CastHit, CastPoint};

/// The format of answers.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Form {
    /// Comma-separated text with a header.
    Csv,
    /// One array of records.
    Npy,
    /// One array a column.
    Npz,
}

/// What an answer is; each is one line.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Table {
    /// A ray and its hit, if any.
    Hits,
    /// A ray and a count of this name.
    Numbers(&'static str),
    /// A point and the nearest point of all surfaces, if any.
    Nearest,
    /// A point and a boolean of this name.
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

/// The bytes of consecutive answers.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) struct Block {
    form: Form,
    /// Number of answers.
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

    /// Adds the hit of a ray, if any.
    pub(super) fn push_hit(&mut self, ray: u64, hit: Option<&CastHit>) {
        self.push_columns(COLUMNS, ray, hit);
    }

    /// Adds the nearest point, if any.
    pub(super) fn push_nearest(&mut self, point: u64, nearest: Option<&CastPoint>) {
        self.push_columns(NEAREST, point, nearest);
    }

    /// Adds an answer by its columns: a line, a record, or a value to each array.
    fn push_columns<T>(&mut self, columns: &[Column<T>], number: u64, answer: Option<&T>) {
        for (i, column) in columns.iter().enumerate() {
            let value = (column.value)(number, answer);
            match self.form {
                Form::Csv => {
                    value.push_text(&mut self.parts[0]);
                    self.parts[0].push(if i + 1 < columns.len() { b',' } else { b'\n' });
                }
                Form::Npy => value.push_bytes(&mut self.parts[0]),
                Form::Npz => value.push_bytes(&mut self.parts[i]),
            }
        }
        self.answers += 1;
    }

    /// Adds a boolean of a point.
    pub(super) fn push_flag(&mut self, point: u64, holds: bool) {
        self.answers += 1;
        let out = &mut self.parts[0];
        if self.form == Form::Csv {
            push_text(out, format_args!("{point},{}\n", u8::from(holds)));
        } else {
            out.push(u8::from(holds));
        }
    }

    /// Adds a real number of a point; in CSV it reads back to the same bits.
    pub(super) fn push_real(&mut self, point: u64, number: f64) {
        self.answers += 1;
        let out = &mut self.parts[0];
        if self.form == Form::Csv {
            push_text(out, format_args!("{point},{number:?}\n"));
        } else {
            out.extend(number.to_le_bytes());
        }
    }

    /// Adds a count of a ray.
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

/// A column of the answers: its name, and its value for one answer; `None` is a miss.
struct Column<T> {
    name: &'static str,
    value: fn(u64, Option<&T>) -> Value,
}

/// A value of an answer. `None`, in a miss, is empty in CSV.
enum Value {
    Count(u64),
    /// False in NumPy's formats if there is none.
    Flag(Option<bool>),
    /// A number, or what NumPy's formats have for none.
    Real(Result<f64, f64>),
    /// -1 in NumPy's formats if there is none.
    Index(Option<u32>),
}

impl Value {
    /// The NumPy type.
    fn kind(&self) -> &'static str {
        match self {
            Self::Count(_) => "<u8",
            Self::Flag(_) => "|b1",
            Self::Real(_) => "<f8",
            Self::Index(_) => "<i8",
        }
    }

    fn push_bytes(self, out: &mut Vec<u8>) {
        match self {
            Self::Count(number) => out.extend(number.to_le_bytes()),
            Self::Flag(flag) => out.push(u8::from(flag.unwrap_or(false))),
            Self::Real(Ok(number) | Err(number)) => out.extend(number.to_le_bytes()),
            Self::Index(index) => out.extend(index.map_or(-1, i64::from).to_le_bytes()),
        }
    }

    fn push_text(self, out: &mut Vec<u8>) {
        match self {
            Self::Count(number) => push_text(out, format_args!("{number}")),
            Self::Flag(Some(flag)) => push_text(out, format_args!("{}", u8::from(flag))),
            // Debug prints the shortest decimal that reads back to the same bits.
            Self::Real(Ok(number)) => push_text(out, format_args!("{number:?}")),
            Self::Index(Some(index)) => push_text(out, format_args!("{index}")),
            Self::Flag(None) | Self::Real(Err(_)) | Self::Index(None) => {}
        }
    }
}

impl<T> Column<T> {
    /// The NumPy type.
    fn kind(&self) -> &'static str {
        (self.value)(0, None).kind()
    }
}

fn names<T>(columns: &[Column<T>]) -> Vec<&'static str> {
    columns.iter().map(|column| column.name).collect()
}

/// The NumPy type of a record.
fn record<T>(columns: &[Column<T>]) -> String {
    let fields: Vec<String> = columns.iter().map(|c| format!("('{}', '{}')", c.name, c.kind())).collect();
    format!("[{}]", fields.join(", "))
}

fn arrays<T>(columns: &[Column<T>]) -> Vec<(&'static str, String)> {
    columns.iter().map(|c| (c.name, format!("'{}'", c.kind()))).collect()
}

macro_rules! real {
    ($name:literal, $value:expr) => {
        real!($name, $value, f64::NAN)
    };
    ($name:literal, $value:expr, $missing:expr) => {
        Column { name: $name, value: |_, answer| Value::Real(answer.map($value).ok_or($missing)) }
    };
}

macro_rules! index {
    ($name:literal, $value:expr) => {
        Column { name: $name, value: |_, answer| Value::Index(answer.and_then($value)) }
    };
}

/// The columns of hits.
const COLUMNS: &[Column<CastHit>] = &[
    Column { name: "ray", value: |ray, _| Value::Count(ray) },
    Column { name: "hit", value: |_, hit| Value::Flag(Some(hit.is_some())) },
    real!("t", |hit| hit.t, f64::INFINITY),
    real!("px", |hit| hit.point.x),
    real!("py", |hit| hit.point.y),
    real!("pz", |hit| hit.point.z),
    real!("nx", |hit| hit.normal.x),
    real!("ny", |hit| hit.normal.y),
    real!("nz", |hit| hit.normal.z),
    real!("u", |hit| hit.uv.x),
    real!("v", |hit| hit.uv.y),
    Column { name: "front", value: |_, hit| Value::Flag(hit.map(|hit| hit.front)) },
    index!("shape", |hit| Some(hit.shape)),
    index!("prim", |hit| Some(hit.primitive)),
    index!("instance", |hit| hit.instance),
];

/// The columns of nearest points.
const NEAREST: &[Column<CastPoint>] = &[
    Column { name: "point", value: |point, _| Value::Count(point) },
    Column { name: "found", value: |_, nearest| Value::Flag(Some(nearest.is_some())) },
    real!("distance", |nearest| nearest.distance, f64::INFINITY),
    real!("px", |nearest| nearest.point.x),
    real!("py", |nearest| nearest.point.y),
    real!("pz", |nearest| nearest.point.z),
    index!("shape", |nearest| Some(nearest.shape)),
    index!("prim", |nearest| Some(nearest.primitive)),
    index!("instance", |nearest| nearest.instance),
];
