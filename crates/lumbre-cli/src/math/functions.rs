//! The functions of the language: how each is called, and the arguments of a call.

use lumbre::formats::diagnostic::Diagnostic;
use lumbre::math::glam::{DMat4, DQuat, DVec2};
use lumbre::math::{DVec3, Transform};

use crate::language::filled;

use super::lexer::Wrong;
use super::steps::Work;
use super::texts::Texts;
use super::value::{Matrix, Value};
use super::{cameras, matrices, numbers, quaternions, transforms, vectors};

/// A function of the language.
pub(super) struct Function {
    pub(super) name: &'static str,
    /// The arguments of each of its forms, separated by commas.
    pub(super) forms: &'static [&'static str],
    pub(super) run: fn(&mut Call) -> Result<Value, Wrong>,
}

impl Function {
    pub(super) const fn new(
        name: &'static str,
        forms: &'static [&'static str],
        run: fn(&mut Call) -> Result<Value, Wrong>,
    ) -> Self {
        Self { name, forms, run }
    }
}

/// All functions, by topic.
pub(super) fn all() -> impl Iterator<Item = &'static Function> {
    let topics = [
        vectors::FUNCTIONS,
        transforms::FUNCTIONS,
        matrices::FUNCTIONS,
        cameras::FUNCTIONS,
        quaternions::FUNCTIONS,
        numbers::FUNCTIONS,
    ];
    topics.into_iter().flatten()
}

/// Names of other programs for functions.
pub(super) const SYNONYMS: [(&str, &[&str]); 12] = [
    ("unit", &["normalize", "normalise", "normalized", "normalised"]),
    ("length", &["norm", "magnitude", "mag", "abs"]),
    ("inverse", &["inv", "invert"]),
    ("transpose", &["transposed"]),
    ("det", &["determinant"]),
    ("look_at", &["lookat"]),
    ("ortho", &["orthographic"]),
    ("project", &["projection", "proj"]),
    ("rotate", &["rotation", "rot", "axis_angle"]),
    ("translate", &["translation"]),
    ("quat", &["quaternion"]),
    ("camera_ray", &["ray"]),
];

/// The function of this name.
pub(super) fn named(name: &str) -> Option<&'static Function> {
    all().find(|function| function.name == name)
}

/// The function of this name or synonym.
pub(super) fn find(name: &str) -> Option<&'static Function> {
    let synonym = || SYNONYMS.iter().find(|(_, words)| words.contains(&name)).map(|(name, _)| *name);
    named(name).or_else(|| named(synonym()?))
}

/// How a function is called: `rotate(degrees) or rotate(axis, degrees)`.
pub(super) fn forms(name: &str) -> String {
    let Some(function) = find(name) else { return String::new() };
    let forms: Vec<String> = function.forms.iter().map(|form| format!("{name}({form})")).collect();
    forms.join(" | ")
}

/// What functions there are, or what one of them does.
pub(super) fn help(topic: Option<&Function>, texts: &Texts) -> Vec<String> {
    let line = |function: &Function| {
        let synonyms = SYNONYMS.iter().find(|(name, _)| *name == function.name);
        let synonyms = synonyms.map(|(_, words)| filled(texts.also, &[&words.join(", ")]));
        let about = texts.about(function.name);
        format!("{}\n    {about}{}", forms(function.name), synonyms.unwrap_or_default())
    };
    match topic {
        Some(function) => line(function).lines().map(str::to_owned).collect(),
        None => {
            let mut lines: Vec<String> = texts.language.lines().map(str::to_owned).collect();
            lines
                .extend(all().map(line).flat_map(|text| text.lines().map(str::to_owned).collect::<Vec<_>>()));
            lines
        }
    }
}

/// A value and the byte where its expression begins.
pub(super) struct Argument {
    pub(super) value: Value,
    pub(super) offset: usize,
}

/// A function with the arguments that it is called with.
pub(super) struct Call<'a> {
    function: &'static Function,
    offset: usize,
    arguments: &'a [Argument],
    pub(super) work: &'a mut Work,
}

impl<'a> Call<'a> {
    pub(super) fn new(
        function: &'static Function,
        offset: usize,
        arguments: &'a [Argument],
        work: &'a mut Work,
    ) -> Self {
        Self { function, offset, arguments, work }
    }

    /// Checks the number of arguments and evaluates.
    pub(super) fn run(mut self) -> Result<Value, Wrong> {
        let fits = |form: &&str| form.split(',').count() == self.arguments.len();
        let Some(form) = self.function.forms.iter().find(|form| fits(form)) else {
            let what = Diagnostic::error(filled(self.work.texts.wrong_count, &[self.function.name]));
            return Err(Wrong::new(
                self.offset,
                what.found(self.arguments.len()).expected(forms(self.function.name)),
            ));
        };
        self.work.begin(format!("{}({form})", self.function.name));
        (self.function.run)(&mut self)
    }

    /// The byte where the call begins.
    pub(super) fn offset(&self) -> usize {
        self.offset
    }

    /// How many arguments there are.
    pub(super) fn count(&self) -> usize {
        self.arguments.len()
    }

    pub(super) fn value(&self, i: usize) -> &Value {
        &self.arguments[i].value
    }

    /// That argument `i` is of the wrong kind or value.
    pub(super) fn wrong(&self, i: usize, expected: &str) -> Wrong {
        let Argument { value, offset } = &self.arguments[i];
        let texts = self.work.texts;
        let message = filled(texts.wrong_argument, &[&(i + 1).to_string(), self.function.name]);
        let found = match value {
            Value::Number(_) | Value::Vector(_) | Value::Quaternion(_) => value.line(),
            _ => value.described(texts),
        };
        Wrong::new(*offset, Diagnostic::error(message).found(found).expected(expected))
    }

    pub(super) fn number(&self, i: usize) -> Result<f64, Wrong> {
        match self.value(i) {
            Value::Number(x) => Ok(*x),
            _ => Err(self.wrong(i, self.work.texts.number)),
        }
    }

    /// One number per argument, from argument `from` on.
    pub(super) fn numbers<const N: usize>(&self, from: usize) -> Result<[f64; N], Wrong> {
        let mut numbers = [0.0; N];
        for (i, number) in numbers.iter_mut().enumerate() {
            *number = self.number(from + i)?;
        }
        Ok(numbers)
    }

    /// A vector of any size.
    pub(super) fn vector(&self, i: usize) -> Result<&[f64], Wrong> {
        match self.value(i) {
            Value::Vector(v) => Ok(v),
            _ => Err(self.wrong(i, self.work.texts.vector)),
        }
    }

    pub(super) fn vec2(&self, i: usize) -> Result<DVec2, Wrong> {
        match self.value(i) {
            Value::Vector(v) if v.len() == 2 => Ok(DVec2::from_slice(v)),
            _ => Err(self.wrong(i, &filled(self.work.texts.vector_of, &["2"]))),
        }
    }

    pub(super) fn vec3(&self, i: usize) -> Result<DVec3, Wrong> {
        match self.value(i) {
            Value::Vector(v) if v.len() == 3 => Ok(DVec3::from_slice(v)),
            _ => Err(self.wrong(i, &filled(self.work.texts.vector_of, &["3"]))),
        }
    }

    /// [`Call::vec3`] that is not zero.
    pub(super) fn direction(&self, i: usize) -> Result<DVec3, Wrong> {
        let v = self.vec3(i)?;
        if v == DVec3::ZERO { Err(self.wrong(i, self.work.texts.not_zero)) } else { Ok(v) }
    }

    /// A vector of the plane, with z = 0, or of space, and how many components it has.
    pub(super) fn flat_or_space(&self, i: usize) -> Result<(DVec3, usize), Wrong> {
        match self.value(i) {
            Value::Vector(v) if v.len() == 2 => Ok((DVec2::from_slice(v).extend(0.0), 2)),
            Value::Vector(v) if v.len() == 3 => Ok((DVec3::from_slice(v), 3)),
            _ => Err(self.wrong(i, self.work.texts.vector_2_or_3)),
        }
    }

    pub(super) fn quaternion(&self, i: usize) -> Result<DQuat, Wrong> {
        match self.value(i) {
            Value::Quaternion(q) => Ok(*q),
            _ => Err(self.wrong(i, self.work.texts.quaternion)),
        }
    }

    /// [`Call::quaternion`] that is a rotation: not zero.
    pub(super) fn rotation(&self, i: usize) -> Result<DQuat, Wrong> {
        let q = self.quaternion(i)?;
        let has_direction = lumbre::math::quaternion::unit(q).is_some();
        if has_direction { Ok(q) } else { Err(self.wrong(i, self.work.texts.not_zero)) }
    }

    /// A matrix, also that of a transform.
    pub(super) fn matrix(&self, i: usize) -> Result<Matrix, Wrong> {
        self.value(i).as_matrix().ok_or_else(|| self.wrong(i, self.work.texts.matrix))
    }

    /// A transform, also by its 4×4 or 3×3 matrix.
    pub(super) fn transform(&self, i: usize) -> Result<Transform, Wrong> {
        let made = match self.value(i) {
            Value::Transform(map) => return Ok(**map),
            Value::Matrix(m) if m.is_square(4) => Transform::from_matrix(m.mat4()),
            Value::Matrix(m) if m.is_square(3) => Transform::from_matrix(DMat4::from_mat3(m.mat3())),
            _ => return Err(self.wrong(i, self.work.texts.transform)),
        };
        made.map_err(|_| self.wrong(i, self.work.texts.affine_invertible))
    }
}
