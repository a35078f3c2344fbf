//! The graphics state, and the scopes that save it.

use std::sync::Arc;

use lumbre_image::ColourSpace;
use lumbre_math::Transform;
use lumbre_scene::{AreaLightDesc, Boundary, MaterialId, MediumId};

use super::params::Defaults;
use super::source::SourcePosition;

/// The kinds of entity that `Attribute` can set defaults for.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum EntityKind {
    Shape,
    Light,
    Material,
    Medium,
    Texture,
}

impl EntityKind {
    pub const NAMES: [(&'static str, Self); 5] = [
        ("shape", Self::Shape),
        ("light", Self::Light),
        ("material", Self::Material),
        ("medium", Self::Medium),
        ("texture", Self::Texture),
    ];
}

/// The area light of the following shapes.
#[derive(Clone, Debug)]
pub(super) struct AreaLight {
    pub desc: AreaLightDesc,
    pub spot: SourcePosition,
}

/// The graphics state.
#[derive(Clone, Debug)]
pub(super) struct State {
    /// The current transforms at the start and at the end of the motion.
    pub ctm: [Transform; 2],
    /// Which of the two transforms are active.
    pub active: [bool; 2],
    pub reverse_orientation: bool,
    pub space: ColourSpace,
    /// `None` for an interface.
    pub material: Option<MaterialId>,
    pub area_light: Option<Arc<AreaLight>>,
    /// The media inside and outside of shapes; `None` is a vacuum.
    pub media: [Option<MediumId>; 2],
    /// Defaults from `Attribute`, by [`EntityKind`].
    pub defaults: [Defaults; 5],
}

impl State {
    pub fn new(material: MaterialId) -> Self {
        Self {
            ctm: [Transform::IDENTITY; 2],
            active: [true; 2],
            reverse_orientation: false,
            space: ColourSpace::REC709,
            material: Some(material),
            area_light: None,
            media: [None; 2],
            defaults: Default::default(),
        }
    }

    /// The media on the sides of a shape, where these differ.
    pub fn boundary(&self) -> Option<Boundary> {
        let [inside, outside] = self.media;
        (inside != outside).then_some(Boundary { inside, outside })
    }

    /// Defaults for a kind of entity.
    pub fn defaults_for(&self, kind: EntityKind) -> Defaults {
        self.defaults[kind as usize].clone()
    }
}

/// The directive that opened a scope.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum ScopeKind {
    Attribute,
    Transform,
    Object,
}

impl ScopeKind {
    pub fn begin(self) -> &'static str {
        match self {
            Self::Attribute => "AttributeBegin",
            Self::Transform => "TransformBegin",
            Self::Object => "ObjectBegin",
        }
    }

    pub fn end(self) -> &'static str {
        match self {
            Self::Attribute => "AttributeEnd",
            Self::Transform => "TransformEnd",
            Self::Object => "ObjectEnd",
        }
    }
}

/// An open scope, with the state to restore.
#[derive(Debug)]
pub(super) struct Scope {
    pub kind: ScopeKind,
    pub spot: SourcePosition,
    pub saved: State,
}
