//! What identifiers of a scene stand for.

use std::cell::RefCell;
use std::collections::HashMap;
use std::rc::Rc;
use std::sync::Arc;

use lumbre_math::{DVec3, Transform};
use lumbre_shading::pov::{Colour, Function, Media, Normal, Pigment, Spline, Texture};

use super::camera::CameraStatement;
use super::lights::LightStatement;
use super::maps::Map;
use super::objects::Object;
use super::settings::{Fog, SkySphere};
use super::source::Macro;
use super::textures::{FinishStatement, InteriorStatement, MaterialStatement};

/// A number, a vector of two to five components, or a colour.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Num {
    /// The components, 0 beyond the last.
    pub v: [f64; 5],
    /// How many there are, 1 to 5.
    pub n: usize,
    /// Whether it is a colour: red, green, blue, filter, transmit in single precision.
    pub is_colour: bool,
}

impl Num {
    pub(super) fn float(x: f64) -> Self {
        Self { v: [x, 0.0, 0.0, 0.0, 0.0], n: 1, is_colour: false }
    }

    pub(super) fn vector(p: DVec3) -> Self {
        Self { v: [p.x, p.y, p.z, 0.0, 0.0], n: 3, is_colour: false }
    }

    pub(super) fn colour(v: [f64; 5]) -> Self {
        Self { v: v.map(|c| f64::from(c as f32)), n: 5, is_colour: true }
    }

    /// The value as a vector of `N` components: a number fills all of them.
    pub(super) fn promoted(&self, n: usize) -> [f64; 5] {
        if self.n > 1 {
            return self.v;
        }
        std::array::from_fn(|i| if i < n { self.v[0] } else { 0.0 })
    }

    pub(super) fn dvec3(&self) -> DVec3 {
        let [x, y, z, ..] = self.promoted(3);
        DVec3::new(x, y, z)
    }

    /// As a colour: a vector by position, a number in red, green and blue.
    pub(super) fn as_colour(&self) -> Colour {
        let v = if self.n == 1 { [self.v[0], self.v[0], self.v[0], 0.0, 0.0] } else { self.v };
        Colour::from_array(v.map(|c| c as f32))
    }

    /// Component by component; a number counts for each.
    pub(super) fn with(&self, other: &Self, of: impl Fn(f64, f64) -> f64) -> Self {
        let n = self.n.max(other.n);
        let (a, b) = (self.promoted(n), other.promoted(n));
        let is_colour = self.is_colour || other.is_colour;
        let v = std::array::from_fn(|i| if i < n { of(a[i], b[i]) } else { 0.0 });
        if is_colour { Self::colour(v) } else { Self { v, n, is_colour } }
    }
}

/// What an identifier stands for.
#[derive(Clone, Debug)]
pub(super) enum Value {
    /// Nothing yet: a parameter that a macro is to declare.
    Nothing,
    Num(Num),
    Text(Rc<str>),
    Array(Rc<Array>),
    Macro(Rc<Macro>),
    Function(Arc<Function>),
    Spline(Arc<Spline>),
    Transform(Arc<Transform>),
    Object(Rc<Object>),
    Texture(Arc<Texture>),
    Pigment(Arc<Pigment>),
    Normal(Arc<Normal>),
    Finish(Rc<FinishStatement>),
    Interior(Arc<InteriorStatement>),
    Media(Rc<Media>),
    Density(Arc<Pigment>),
    Material(Rc<MaterialStatement>),
    Map(Rc<Map>),
    Camera(Rc<CameraStatement>),
    Light(Rc<LightStatement>),
    Fog(Rc<Fog>),
    SkySphere(Rc<SkySphere>),
    /// A file that the scene has opened.
    File(Rc<RefCell<File>>),
    /// Something that is read over: a rainbow.
    Ignored(&'static str),
    Dictionary(Rc<HashMap<Rc<str>, Value>>),
}

impl Value {
    /// What it is, for messages.
    pub(super) fn name(&self) -> &'static str {
        match self {
            Self::Nothing => "nothing yet",
            Self::Num(num) if num.is_colour => "a colour",
            Self::Num(num) if num.n == 1 => "a number",
            Self::Num(_) => "a vector",
            Self::Text(_) => "a text",
            Self::Array(_) => "an array",
            Self::Macro(_) => "a macro",
            Self::Function(_) => "a function",
            Self::Spline(_) => "a spline",
            Self::Transform(_) => "a transform",
            Self::Object(_) => "an object",
            Self::Texture(_) => "a texture",
            Self::Pigment(_) => "a pigment",
            Self::Normal(_) => "a normal",
            Self::Finish(_) => "a finish",
            Self::Interior(_) => "an interior",
            Self::Media(_) => "a medium",
            Self::Density(_) => "a density",
            Self::Material(_) => "a material",
            Self::Map(_) => "a map",
            Self::Camera(_) => "a camera",
            Self::Light(_) => "a light",
            Self::Fog(_) => "a fog",
            Self::SkySphere(_) => "a sky sphere",
            Self::File(_) => "a file",
            Self::Ignored(what) => what,
            Self::Dictionary(_) => "a dictionary",
        }
    }
}

/// An identifier's place: shared where a macro's parameter stands for the caller's identifier.
pub(super) type Cell = Rc<RefCell<Value>>;

/// Identifiers by their names.
pub(super) type Names = HashMap<Rc<str>, Cell>;

/// An array of up to five dimensions.
#[derive(Clone, Debug)]
pub(super) struct Array {
    pub sizes: Vec<usize>,
    /// In the order of the last dimension first.
    pub elements: Vec<Value>,
}

/// A file that the scene has opened: it is in memory, and never on the disk.
#[derive(Debug)]
pub(super) struct File {
    pub name: String,
    pub is_open: bool,
    /// What is still to be read, where it is read.
    pub reading: Option<Vec<super::lexer::Token>>,
    pub at: usize,
}
