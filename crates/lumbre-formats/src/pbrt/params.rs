//! Parameter lists: the given parameters, their lookup, and the unused ones.

use std::cell::{Cell, RefCell};
use std::rc::Rc;

use lumbre_image::ColourSpace;
use lumbre_math::DVec3;

use super::source::{Result, SourcePosition};
use crate::Diagnostic;
use crate::diagnostic::{number, quoted};

/// What is expected in place of a number that single precision does not hold.
pub(super) const AT_MOST_F32: &str = "at most 3.4e38";

/// The types of parameters.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Type {
    Bool,
    Float,
    Integer,
    Point2,
    Vector2,
    Point3,
    Vector3,
    Normal,
    String,
    Texture,
    Rgb,
    Blackbody,
    Spectrum,
}

impl Type {
    /// The types by name; obsolete ones of pbrt-v3 last.
    const NAMES: [(&'static str, Self); 17] = [
        ("bool", Self::Bool),
        ("float", Self::Float),
        ("integer", Self::Integer),
        ("point2", Self::Point2),
        ("vector2", Self::Vector2),
        ("point3", Self::Point3),
        ("vector3", Self::Vector3),
        ("normal", Self::Normal),
        ("string", Self::String),
        ("texture", Self::Texture),
        ("rgb", Self::Rgb),
        ("blackbody", Self::Blackbody),
        ("spectrum", Self::Spectrum),
        ("point", Self::Point3),
        ("vector", Self::Vector3),
        ("color", Self::Rgb),
        ("xyz", Self::Rgb),
    ];
    /// The number of names of pbrt-v4.
    const CURRENT: usize = 13;

    /// The type of this name, and whether the name is one of pbrt-v3 only.
    pub fn from_name(name: &str) -> Option<(Self, bool)> {
        let i = Self::NAMES.iter().position(|(n, _)| *n == name)?;
        Some((Self::NAMES[i].1, i >= Self::CURRENT))
    }

    pub fn names() -> impl Iterator<Item = &'static str> {
        Self::NAMES[..Self::CURRENT].iter().map(|(name, _)| *name)
    }

    pub fn name(self) -> &'static str {
        Self::NAMES[self as usize].0
    }

    /// The form of its values in a file.
    pub fn wants(self) -> Wants {
        match self {
            Self::Bool => Wants::Bools,
            Self::Integer => Wants::Integers,
            Self::String | Self::Texture => Wants::Strings,
            Self::Spectrum => Wants::NumbersOrStrings,
            _ => Wants::Numbers,
        }
    }
}

/// The form of values.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Wants {
    Bools,
    Numbers,
    Integers,
    Strings,
    NumbersOrStrings,
}

/// The values of one parameter.
#[derive(Clone, Debug, PartialEq)]
pub(super) enum Values {
    Bools(Vec<bool>),
    /// Not NaN; infinite only where the file has `inf`.
    Numbers(Vec<f64>),
    Integers(Vec<i32>),
    Strings(Vec<String>),
}

impl Values {
    pub fn len(&self) -> usize {
        match self {
            Self::Bools(v) => v.len(),
            Self::Numbers(v) => v.len(),
            Self::Integers(v) => v.len(),
            Self::Strings(v) => v.len(),
        }
    }

    /// A description for messages.
    pub fn shown(&self) -> String {
        match self {
            Self::Bools(v) if v.len() == 1 => format!("bool {}", v[0]),
            Self::Numbers(v) if v.len() == 1 => number(v[0]),
            Self::Integers(v) if v.len() == 1 => format!("integer {}", v[0]),
            Self::Strings(v) if v.len() == 1 => format!("string {}", quoted(&v[0])),
            Self::Bools(v) => format!("{} bools", v.len()),
            Self::Numbers(v) => format!("{} numbers", v.len()),
            Self::Integers(v) => format!("{} integers", v.len()),
            Self::Strings(v) => format!("{} strings", v.len()),
        }
    }
}

/// A parameter as given.
#[derive(Clone, Debug)]
pub(super) struct Param {
    pub ty: Type,
    pub name: Box<str>,
    pub spot: SourcePosition,
    pub values: Values,
    /// The colour space of its scope, for `rgb`.
    pub space: ColourSpace,
    pub used: Cell<bool>,
}

impl Param {
    fn wrong(&self, found: impl std::fmt::Display, expected: &str) -> super::source::Fault {
        let message = format!("wrong value for parameter {}", quoted(&self.name));
        self.spot.wrong(Diagnostic::error(message).found(found).expected(expected))
    }

    /// An error at this parameter, with its values.
    pub fn refuse(&self, expected: &str) -> super::source::Fault {
        self.wrong(self.values.shown(), expected)
    }

    /// The same, with a few numbers themselves in place of how many there are.
    pub fn refuse_numbers(&self, expected: &str) -> super::source::Fault {
        match &self.values {
            Values::Numbers(v) if v.len() <= 4 => {
                let numbers: Vec<String> = v.iter().map(|v| number(*v)).collect();
                self.wrong(numbers.join(" "), expected)
            }
            _ => self.refuse(expected),
        }
    }

    fn of_type(&self, types: &[Type]) -> Result<&Self> {
        if types.contains(&self.ty) {
            return Ok(self);
        }
        let expected: Vec<&str> = types.iter().map(|t| t.name()).collect();
        let message = format!("wrong type of parameter {}", quoted(&self.name));
        let found = match self.values.len() {
            1 if self.ty.wants() == Wants::Strings => format!("{} {}", self.ty.name(), self.text_shown()),
            _ => self.ty.name().to_owned(),
        };
        Err(self.spot.wrong(Diagnostic::error(message).found(found).expected(expected.join(" or "))))
    }

    fn text_shown(&self) -> String {
        match &self.values {
            Values::Strings(v) => v.first().map_or_else(String::new, |s| quoted(s)),
            _ => String::new(),
        }
    }

    /// The bytes of its name and its values.
    pub fn bytes(&self) -> usize {
        let values = match &self.values {
            Values::Bools(v) => v.capacity(),
            Values::Numbers(v) => v.capacity() * size_of::<f64>(),
            Values::Integers(v) => v.capacity() * size_of::<i32>(),
            Values::Strings(v) => {
                v.capacity() * size_of::<String>() + v.iter().map(String::capacity).sum::<usize>()
            }
        };
        self.name.len() + values
    }

    /// The numbers, which must be finite.
    pub fn numbers(&self) -> Result<&[f64]> {
        let numbers = self.numbers_or_infinite()?;
        match numbers.iter().position(|v| !v.is_finite()) {
            None => Ok(numbers),
            Some(i) => Err(self.wrong(format!("{} at position {i}", numbers[i]), "finite numbers")),
        }
    }

    fn numbers_or_infinite(&self) -> Result<&[f64]> {
        match &self.values {
            Values::Numbers(v) => Ok(v),
            other => Err(self.wrong(other.shown(), "numbers")),
        }
    }

    pub fn strings(&self) -> Result<&[String]> {
        match &self.values {
            Values::Strings(v) => Ok(v),
            other => Err(self.wrong(other.shown(), "a string")),
        }
    }

    /// Its only string.
    pub fn one_string(&self) -> Result<&str> {
        match self.strings()? {
            [one] => Ok(one),
            other => Err(self.wrong(format!("{} strings", other.len()), "one string")),
        }
    }

    /// Its only number, infinite or not.
    fn one_number(&self) -> Result<f64> {
        match &self.values {
            Values::Numbers(v) if v.len() == 1 => Ok(v[0]),
            Values::Integers(v) if v.len() == 1 => Ok(f64::from(v[0])),
            other => Err(self.wrong(other.shown(), "one number")),
        }
    }

    /// Its `N` finite numbers.
    pub fn exactly<const N: usize>(&self) -> Result<[f64; N]> {
        let numbers = self.numbers()?;
        numbers.try_into().map_err(|_| self.wrong(self.values.shown(), &format!("{N} numbers")))
    }
}

/// Defaults that `Attribute` set for one kind of entity, one of each name, in the order of their names.
pub(super) type Defaults = Rc<Vec<Rc<Param>>>;

/// The parameters of one entity. Each lookup marks the parameter as used and records the name, so that unused
/// ones are reported with the nearest known name.
#[derive(Debug)]
pub(super) struct Params {
    /// The entity, such as `shape "sphere"`.
    pub owner: String,
    /// Its place.
    pub spot: SourcePosition,
    pub own: Vec<Param>,
    pub defaults: Defaults,
    asked: RefCell<Vec<&'static str>>,
}

impl Params {
    pub fn new(owner: String, spot: SourcePosition, own: Vec<Param>, defaults: Defaults) -> Self {
        Self { owner, spot, own, defaults, asked: RefCell::default() }
    }

    /// The bytes of what it holds itself.
    pub fn bytes(&self) -> usize {
        let each = self.own.iter().map(|param| size_of::<Param>() + param.bytes());
        size_of::<Self>() + self.owner.len() + each.sum::<usize>()
    }

    /// The effective parameter of this name: the last one given, else the default of the scope.
    pub fn find(&self, name: &'static str) -> Option<&Param> {
        self.asked.borrow_mut().push(name);
        #[cfg(test)]
        asked::note(&self.owner, name, &[], &[], false);
        let mut found = None;
        for param in self.own.iter().filter(|p| *p.name == *name) {
            param.used.set(true);
            found = Some(param);
        }
        found.or_else(|| self.default(name))
    }

    fn default(&self, name: &str) -> Option<&Param> {
        let at = self.defaults.binary_search_by(|p| (*p.name).cmp(name)).ok()?;
        Some(&self.defaults[at])
    }

    /// All parameters that are in effect.
    pub fn all(&self) -> impl Iterator<Item = &Param> {
        self.own.iter().chain(self.defaults.iter().map(|param| &**param))
    }

    /// The parameter of this name, which must be of one of these types.
    pub fn typed(&self, name: &'static str, types: &[Type]) -> Result<Option<&Param>> {
        #[cfg(test)]
        asked::note(&self.owner, name, types, &[], false);
        self.find(name).map(|p| p.of_type(types)).transpose()
    }

    /// Whether there is one of this name; does not mark it as used.
    pub fn has(&self, name: &str) -> bool {
        self.own.iter().any(|p| *p.name == *name) || self.default(name).is_some()
    }

    /// The place of this parameter, else of the entity.
    pub fn spot_of(&self, name: &str) -> SourcePosition {
        self.own.iter().rev().find(|p| *p.name == *name).map_or(self.spot, |p| p.spot)
    }

    /// Marks known names without effect as used.
    pub fn ignore(&self, names: &[&'static str]) {
        for name in names {
            self.asked.borrow_mut().push(name);
            self.own.iter().filter(|p| *p.name == **name).for_each(|param| param.used.set(true));
            #[cfg(test)]
            asked::note(&self.owner, name, &[], &[], true);
        }
    }

    /// Marks all as used, for an entity that is ignored as a whole.
    pub fn ignore_all(&self) {
        self.own.iter().for_each(|p| p.used.set(true));
    }

    /// A finite number.
    pub fn float(&self, name: &'static str, default: f64) -> Result<f64> {
        Ok(self.float_opt(name)?.unwrap_or(default))
    }

    pub fn float_opt(&self, name: &'static str) -> Result<Option<f64>> {
        let Some(param) = self.typed(name, &[Type::Float, Type::Integer])? else { return Ok(None) };
        let value = param.one_number()?;
        if value.is_finite() { Ok(Some(value)) } else { Err(param.wrong(value, "a finite number")) }
    }

    /// A number that may be `inf`.
    pub fn float_or_infinite(&self, name: &'static str, default: f64) -> Result<f64> {
        let param = self.typed(name, &[Type::Float, Type::Integer])?;
        param.map_or(Ok(default), Param::one_number)
    }

    /// A number in the range of f32, greater than `above`.
    pub fn float_above(&self, name: &'static str, default: f64, above: f64) -> Result<f64> {
        let value = self.float(name, default)?;
        if above < value && value <= f64::from(f32::MAX) {
            return Ok(value);
        }
        let expected = if value > above { AT_MOST_F32 } else { &format!("more than {above}") };
        self.out_of_range(name, value, expected)
    }

    /// A number that is not negative.
    pub fn float_at_least_zero(&self, name: &'static str, default: f64) -> Result<f64> {
        let value = self.float(name, default)?;
        if 0.0 <= value && value <= f64::from(f32::MAX) {
            return Ok(value);
        }
        self.out_of_range(name, value, if value > 0.0 { AT_MOST_F32 } else { "0 or more" })
    }

    /// An error about the value of a parameter.
    pub fn out_of_range<T>(&self, name: &str, found: f64, expected: &str) -> Result<T> {
        let message = format!("parameter {} of {} is out of range", quoted(name), self.owner);
        Err(self.spot_of(name).wrong(Diagnostic::error(message).found(number(found)).expected(expected)))
    }

    pub fn integer(&self, name: &'static str, default: i32) -> Result<i32> {
        let Some(param) = self.typed(name, &[Type::Integer])? else { return Ok(default) };
        match &param.values {
            Values::Integers(v) if v.len() == 1 => Ok(v[0]),
            other => Err(param.wrong(other.shown(), "one integer")),
        }
    }

    /// An integer of at least `least`.
    pub fn count(&self, name: &'static str, default: u32, least: u32) -> Result<u32> {
        let value = self.integer(name, default as i32)?;
        match u32::try_from(value) {
            Ok(count) if least <= count => Ok(count),
            _ => self.out_of_range(name, f64::from(value), &format!("{least} or more")),
        }
    }

    pub fn boolean(&self, name: &'static str, default: bool) -> Result<bool> {
        let Some(param) = self.typed(name, &[Type::Bool])? else { return Ok(default) };
        match &param.values {
            Values::Bools(v) if v.len() == 1 => Ok(v[0]),
            other => Err(param.wrong(other.shown(), "true or false")),
        }
    }

    pub fn string(&self, name: &'static str) -> Result<Option<&str>> {
        self.typed(name, &[Type::String])?.map(Param::one_string).transpose()
    }

    /// One of several keywords.
    pub fn choice<T: Copy>(
        &self,
        name: &'static str,
        choices: &[(&'static str, T)],
        default: T,
    ) -> Result<T> {
        #[cfg(test)]
        asked::note(
            &self.owner,
            name,
            &[],
            &choices.iter().map(|(name, _)| *name).collect::<Vec<_>>(),
            false,
        );
        let Some(param) = self.typed(name, &[Type::String])? else { return Ok(default) };
        let word = param.one_string()?;
        match choices.iter().find(|(choice, _)| *choice == word) {
            Some((_, value)) => Ok(*value),
            None => {
                let names: Vec<&str> = choices.iter().map(|(name, _)| *name).collect();
                let message = format!("wrong value for parameter {}", quoted(name));
                let wrong = Diagnostic::error(message).found(format!("string {}", quoted(word)));
                let wrong = wrong.suggest(word, names.iter().copied());
                Err(param.spot.wrong(wrong.expected(format!("one of {}", names.join(", ")))))
            }
        }
    }

    /// One point, vector or normal.
    pub fn triple(&self, name: &'static str, ty: Type, default: DVec3) -> Result<DVec3> {
        Ok(self.triple_opt(name, ty)?.unwrap_or(default))
    }

    pub fn triple_opt(&self, name: &'static str, ty: Type) -> Result<Option<DVec3>> {
        let Some(param) = self.typed(name, &[ty])? else { return Ok(None) };
        Ok(Some(DVec3::from_array(param.exactly::<3>()?)))
    }

    pub fn integers(&self, name: &'static str) -> Result<Option<&[i32]>> {
        let Some(param) = self.typed(name, &[Type::Integer])? else { return Ok(None) };
        match &param.values {
            Values::Integers(v) => Ok(Some(v)),
            other => Err(param.wrong(other.shown(), "integers")),
        }
    }

    /// Unused parameters, and the names that were asked for.
    pub fn unused(&self) -> (impl Iterator<Item = &Param>, Vec<&'static str>) {
        (self.own.iter().filter(|p| !p.used.get()), self.asked.borrow().clone())
    }
}

/// What parameter lists were asked for, for the table of what is rendered.
#[cfg(test)]
pub(super) mod asked {
    use std::cell::RefCell;

    use super::Type;

    /// A parameter that was asked for.
    #[derive(Clone, Debug)]
    pub(in crate::pbrt) struct Asked {
        pub owner: String,
        pub name: &'static str,
        /// The types that it may have, where that was said.
        pub types: Vec<Type>,
        /// The words that it may be.
        pub choices: Vec<&'static str>,
        /// Whether it was asked for only to be left out.
        pub is_ignored: bool,
    }

    thread_local! {
        static ALL: RefCell<Vec<Asked>> = const { RefCell::new(Vec::new()) };
    }

    pub(super) fn note(
        owner: &str,
        name: &'static str,
        types: &[Type],
        choices: &[&'static str],
        is_ignored: bool,
    ) {
        let (owner, types, choices) = (owner.to_owned(), types.to_vec(), choices.to_vec());
        ALL.with_borrow_mut(|all| all.push(Asked { owner, name, types, choices, is_ignored }));
    }

    /// What was asked for since the last call.
    pub(in crate::pbrt) fn take() -> Vec<Asked> {
        ALL.take()
    }
}
