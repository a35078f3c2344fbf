//! Textures: layers of pigment, normal and finish; and the material that an object has by them.

use std::sync::Arc;

use lumbre_math::{DVec2, DVec3, Elementary, Transform};
use smallvec::SmallVec;

use super::media::Media;
use super::normal::Normal;
use super::pattern::Pattern;
use super::pigment::{Colour, Pigment, between};
use super::warp::{Warps, unfolded};
use super::{Eye, Finish};
use crate::Spectrum;

/// A texture.
#[derive(Clone, Debug)]
pub struct Texture {
    /// What it is.
    pub kind: TextureKind,
    /// How points come to it.
    pub warps: Warps,
    /// Whether it lies in the coordinates of the surface.
    pub uv: bool,
}

/// The kinds of texture.
#[derive(Clone, Debug)]
pub enum TextureKind {
    /// One pigment, normal and finish.
    Plain(Layer),
    /// Layers, the first at the bottom.
    Layers(Arc<[Arc<Texture>]>),
    /// A pattern by a map of textures.
    Map(Box<Pattern>, Arc<[(f64, Arc<Texture>)]>),
    /// A pattern of blocks of textures.
    Blocks(Box<Pattern>, Arc<[Arc<Texture>]>),
    /// A weighted mean.
    Average(Arc<[(f64, Arc<Texture>)]>),
}

/// A pigment, a normal and a finish.
#[derive(Clone, Debug)]
pub struct Layer {
    /// The pigment.
    pub pigment: Arc<Pigment>,
    /// The normal, if the surface is not smooth.
    pub normal: Option<Arc<Normal>>,
    /// The finish.
    pub finish: Arc<Finish>,
}

/// A layer as it is at a point.
#[derive(Clone, Copy, Debug)]
pub struct LayerAt<'t> {
    /// The colour.
    pub colour: Colour,
    /// The unit normal on the side of the viewer; where only colours are asked for, it may be the smooth one.
    pub normal: DVec3,
    /// The finish.
    pub finish: &'t Finish,
}

/// What is asked of layers.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Asked {
    /// Colours, as what lets light pass needs them.
    Colours,
    /// Colours and tilted normals.
    Normals,
}

/// Layers with the share of each stack: a texture that blends others is several stacks, whose light is blended.
pub type Stacks<'t> = SmallVec<[(f32, SmallVec<[LayerAt<'t>; 2]>); 1]>;

/// Shares below this are not looked up.
const FAINT: f32 = 1e-6;

impl Texture {
    /// A texture of one layer.
    pub fn plain(layer: Layer) -> Self {
        Self { kind: TextureKind::Plain(layer), warps: Warps::default(), uv: false }
    }

    /// The stacks of layers at a point, the bottom layer of each first.
    pub fn stacks<'t>(&'t self, p: DVec3, eye: &Eye, share: f32, asked: Asked, out: &mut Stacks<'t>) {
        if share < FAINT {
            return;
        }
        match &self.kind {
            TextureKind::Plain(layer) => {
                let mut layers = SmallVec::new();
                layers.push(self.layer(layer, p, eye, asked));
                out.push((share, layers));
            }
            TextureKind::Layers(textures) => {
                let q = self.inner(p, eye);
                let plain = |texture: &'t Arc<Self>| match &texture.kind {
                    TextureKind::Plain(layer) => Some(texture.layer(layer, q, eye, asked)),
                    _ => None,
                };
                if let Some(layers) = textures.iter().map(plain).collect() {
                    out.push((share, layers));
                    return;
                }
                // Layers that blend textures are blends of stacks: the product of all.
                let mut stacks: Stacks<'t> = SmallVec::new();
                stacks.push((share, SmallVec::new()));
                for texture in textures.iter() {
                    let mut layer: Stacks<'t> = SmallVec::new();
                    texture.stacks(q, eye, 1.0, asked, &mut layer);
                    let mut product: Stacks<'t> = SmallVec::new();
                    for (a, below) in &stacks {
                        for (b, above) in &layer {
                            let mut both = below.clone();
                            both.extend(above.iter().copied());
                            product.push((a * b, both));
                        }
                    }
                    stacks = product;
                }
                out.extend(stacks);
            }
            TextureKind::Map(pattern, map) => {
                let q = pattern.point(self.inner(p, eye));
                let ([(_, first), (_, second)], x) = between(map, pattern.value(q, eye));
                first.stacks(q, eye, share * (1.0 - x as f32), asked, out);
                second.stacks(q, eye, share * x as f32, asked, out);
            }
            TextureKind::Blocks(pattern, textures) => {
                let q = pattern.point(self.inner(p, eye));
                let index = pattern.value(q, eye) as usize;
                if let Some(texture) = textures.get(index).or(textures.last()) {
                    texture.stacks(q, eye, share, asked, out);
                }
            }
            TextureKind::Average(textures) => {
                let q = self.inner(p, eye);
                let total: f64 = textures.iter().map(|(weight, _)| weight).sum();
                for (weight, texture) in textures.iter() {
                    texture.stacks(q, eye, share * (weight / total) as f32, asked, out);
                }
            }
        }
    }

    fn inner(&self, p: DVec3, eye: &Eye) -> DVec3 {
        let p = if self.uv { eye.uv.extend(0.0) } else { p };
        self.warps.apply(p)
    }

    /// A layer of it at a point.
    fn layer<'t>(&self, layer: &'t Layer, p: DVec3, eye: &Eye, asked: Asked) -> LayerAt<'t> {
        let q = self.inner(p, eye);
        let bumps =
            layer.normal.as_ref().filter(|_| asked == Asked::Normals || layer.pigment.looks_at_normals());
        let tilted = bumps.map_or(eye.normal, |bumps| {
            // As if the texture's place were that of its normal.
            let n = self.warps.normal_to_pattern(eye.normal);
            let n = if bumps.no_bump_scale { n } else { n.normalize_or(eye.normal) };
            let n = bumps.tilted(q, n, eye);
            self.warps.normal_from_pattern(n).normalize_or(eye.normal)
        });
        let eye = Eye { normal: tilted, ..*eye };
        LayerAt { colour: layer.pigment.colour(q, &eye), normal: tilted, finish: &layer.finish }
    }

    /// Moves the texture with its object. What is in the coordinates of a surface stays on it.
    #[must_use]
    pub fn carried(self: &Arc<Self>, map: &Arc<Transform>) -> Arc<Self> {
        match &self.kind {
            _ if self.uv => Arc::clone(self),
            TextureKind::Layers(textures) => {
                let kind = TextureKind::Layers(textures.iter().map(|texture| texture.carried(map)).collect());
                Arc::new(Self { kind, ..(**self).clone() })
            }
            _ => self.moved(map),
        }
    }

    /// Moves the texture.
    #[must_use]
    pub fn moved(self: &Arc<Self>, map: &Arc<Transform>) -> Arc<Self> {
        let mut moved = (**self).clone();
        match &mut moved.kind {
            // Each layer is transformed separately, so that its normal is in the same space.
            TextureKind::Layers(textures) if !moved.uv => {
                *textures = textures.iter().map(|texture| texture.moved(map)).collect();
            }
            _ => moved.warps.transform(map),
        }
        Arc::new(moved)
    }
}

/// What an object is filled with.
#[derive(Clone, Debug)]
pub struct Interior {
    /// The index of refraction.
    pub ior: f32,
    /// How much light that passes is brightened where it passes head on.
    pub caustics: f32,
    /// The distance at which it fades to half; 0 for none.
    pub fade_distance: f32,
    /// The exponent of fading; 1000 and more is exponential.
    pub fade_power: f32,
    /// The colour to which it fades.
    pub fade_colour: Spectrum,
    /// The index of refraction of violet over that of red; what lights surfaces takes the mean for all.
    pub dispersion: f32,
    /// What is in it, which is seen where the object is hollow.
    pub media: Vec<Media>,
}

impl Interior {
    /// What an object is filled with unless the scene says otherwise.
    pub const DEFAULT: Self = Self {
        ior: 1.0,
        caustics: 0.0,
        fade_distance: 0.0,
        fade_power: 0.0,
        fade_colour: Spectrum::BLACK,
        dispersion: 1.0,
        media: Vec::new(),
    };

    /// What is left of light after a distance inside.
    pub fn transmittance(&self, distance: f32) -> Spectrum {
        if self.fade_distance <= 0.0 || !distance.is_finite() {
            return Spectrum::WHITE;
        }
        let depth = distance / self.fade_distance;
        if self.fade_power >= 1000.0 {
            return self.fade_colour.map(|k| (-(1.0 - k) * depth).exponential());
        }
        let share = 1.0 / (1.0 + depth.power(self.fade_power));
        self.fade_colour.map(|k| k + (1.0 - k) * share)
    }
}

/// How the coordinates of a surface are found, in the space of its object.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum UvForm {
    /// As the shape gives them: those of meshes, patches and what is turned about an axis.
    Surface,
    /// x and y of the world: of shapes that have none of their own.
    Plane,
    /// Longitude and latitude about a center.
    Sphere(DVec3, f64),
    /// A cross of six faces, between two corners.
    Cuboid(DVec3, DVec3),
    /// Around a torus of this major radius.
    Torus(f64),
}

impl UvForm {
    /// The coordinates of a point of the object.
    pub fn uv(&self, p: DVec3, surface: DVec2) -> DVec2 {
        use std::f64::consts::{PI, TAU};
        let around = |x: f64, z: f64| {
            let turn = z.angle_from(x) / TAU;
            if turn < 0.0 { turn + 1.0 } else { turn }
        };
        match self {
            Self::Surface => surface,
            Self::Plane => p.truncate(),
            Self::Sphere(center, radius) => {
                let q = (p - *center) / *radius;
                DVec2::new(around(q.x, q.z), 0.5 + q.y.clamp(-1.0, 1.0).arc_sine() / PI)
            }
            Self::Torus(radius) => {
                let across = p.x.hypotenuse(p.z) - radius;
                DVec2::new(1.0 - (p.z.angle_from(p.x) + PI) / TAU, (p.y.angle_from(across) + PI) / TAU)
            }
            Self::Cuboid(low, high) => unfolded((p - *low) / (*high - *low)),
        }
    }
}

/// From what an object is hidden.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Visibility {
    /// It casts no shadow.
    pub no_shadow: bool,
    /// Cameras do not see it.
    pub no_image: bool,
    /// Mirrors do not show it.
    pub no_reflection: bool,
}

/// What an object of a POV-Ray scene is like.
#[derive(Clone, Debug)]
pub struct PovMaterial {
    /// The texture.
    pub texture: Arc<Texture>,
    /// The texture as seen from inside, where it is another.
    pub interior_texture: Option<Arc<Texture>>,
    /// What it is filled with, one for all surfaces of a solid.
    pub interior: Arc<Interior>,
    /// From what it is hidden.
    pub visibility: Visibility,
    /// Whether lights behind the surface light it, too.
    pub double_illuminate: bool,
    /// Whether it is empty inside: fog reaches in.
    pub hollow: bool,
    /// The light groups whose lights light it besides those of all.
    pub light_groups: Arc<[u32]>,
    /// Whether the lights of no group light it, too.
    pub global_lights: bool,
    /// How coordinates of the surface are found, and from the world to the space that they are in.
    pub uv: (UvForm, Option<Arc<Transform>>),
    /// The exponent from the working space to linear light.
    pub gamma: f32,
    /// Whether pigments are opaque by the rule before version 3.7.
    pub old_opacity: bool,
}

impl PovMaterial {
    /// Whether it is of the same solid: the surfaces of one share what it is filled with.
    pub fn is_of_solid(&self, other: &Self) -> bool {
        Arc::ptr_eq(&self.interior, &other.interior)
    }

    /// The coordinates of a point of the surface.
    pub fn surface_uv(&self, p: DVec3, uv: DVec2) -> DVec2 {
        let (form, map) = &self.uv;
        form.uv(map.as_ref().map_or(p, |map| map.inverse_point(p)), uv)
    }

    /// The texture on a side.
    pub fn side(&self, front: bool) -> &Texture {
        match &self.interior_texture {
            Some(texture) if !front => texture,
            _ => &self.texture,
        }
    }

    /// How much of the light of a pigment's own a layer shows.
    pub fn opacity(&self, colour: Colour) -> f32 {
        colour.opacity(self.old_opacity)
    }
}
