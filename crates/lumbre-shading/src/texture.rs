//! Textures: values that vary over a surface.

use std::f64::consts::{PI, TAU};
use std::ops::{Add, Mul};
use std::sync::Arc;

use lumbre_math::{DVec2, DVec3, Elementary, Transform, Vec2, Vec3};

use crate::spectrum::SpectralLookup;
use crate::{MipMap, Spectrum, SpectrumValue};

mod dots;
mod pattern;

pub use pattern::{Pattern, PatternKind};

/// Where a texture is evaluated.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct TextureContext {
    /// The point in world space.
    pub point: DVec3,
    /// The shading normal.
    pub normal: Vec3,
    /// Surface parameters.
    pub uv: Vec2,
    /// ∂p/∂x over one pixel; zero where unknown.
    pub dpdx: Vec3,
    /// ∂p/∂y over one pixel.
    pub dpdy: Vec3,
    /// (∂u/∂x, ∂v/∂x).
    pub duv_dx: Vec2,
    /// (∂u/∂y, ∂v/∂y).
    pub duv_dy: Vec2,
    /// Further vertex data of a mesh.
    pub vertex: VertexData,
    /// The wavelengths that colours are looked up at; `None` for their linear Rec. 709.
    pub spectral: Option<SpectralLookup>,
}

impl TextureContext {
    /// The same place, where colours are linear Rec. 709.
    #[must_use]
    pub fn in_rgb(&self) -> Self {
        Self { spectral: None, ..*self }
    }

    /// A colour that is a coefficient, not a reflectance, at the wavelengths, if there are any.
    pub(crate) fn coefficient(&self, colour: Spectrum) -> Spectrum {
        self.spectral.map_or(colour, |spectral| spectral.wavelengths.varied_coefficient(colour))
    }
}

/// Vertex data of a mesh other than position, normal and first uv.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct VertexData {
    /// The vertex colour; default white.
    pub colour: Spectrum,
    /// The vertex alpha; default 1.
    pub coverage: f32,
    /// The second, third and fourth uv set; default zero.
    pub further: [FurtherUv; FURTHER_SETS],
}

/// The number of uv sets besides the first.
pub const FURTHER_SETS: usize = 3;

/// A position in another uv set than the first.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct FurtherUv {
    /// The uv coordinates.
    pub uv: Vec2,
    /// Their derivatives over one pixel to the right.
    pub duv_dx: Vec2,
    /// Their derivatives over one pixel down.
    pub duv_dy: Vec2,
}

impl FurtherUv {
    /// The default.
    pub const ZERO: Self = Self { uv: Vec2::ZERO, duv_dx: Vec2::ZERO, duv_dy: Vec2::ZERO };
}

impl VertexData {
    /// The default vertex data.
    pub const NONE: Self =
        Self { colour: Spectrum::WHITE, coverage: 1.0, further: [FurtherUv::ZERO; FURTHER_SETS] };
}

/// A uv set of a mesh.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum UvSet {
    /// The first, which every surface has.
    #[default]
    First,
    /// The second, first of [`VertexData::further`].
    Second,
    /// The third.
    Third,
    /// The fourth.
    Fourth,
}

impl UvSet {
    /// The sets of [`VertexData::further`], in their order.
    pub const FURTHER: [Self; FURTHER_SETS] = [Self::Second, Self::Third, Self::Fourth];

    fn further(self, vertex: &VertexData) -> Option<&FurtherUv> {
        match self {
            Self::First => None,
            Self::Second => Some(&vertex.further[0]),
            Self::Third => Some(&vertex.further[1]),
            Self::Fourth => Some(&vertex.further[2]),
        }
    }
}

/// A mapping from a surface to the plane of an image.
#[derive(Clone, Debug, PartialEq)]
pub enum Mapping2d {
    /// (u, v) scaled, then translated.
    Uv {
        /// Factors.
        scale: Vec2,
        /// Offsets.
        delta: Vec2,
    },
    /// (u, v) of any set under an affine map.
    Affine {
        /// The uv set.
        set: UvSet,
        /// The images of (1, 0) and (0, 1).
        axes: [Vec2; 2],
        /// The image of (0, 0).
        origin: Vec2,
    },
    /// Angles about the origin of texture space.
    Spherical {
        /// Texture space from world.
        texture_from_world: Arc<Transform>,
    },
    /// Angle and height about the z axis of texture space.
    Cylindrical {
        /// Texture space from world.
        texture_from_world: Arc<Transform>,
    },
    /// Two products with the point.
    Planar {
        /// Texture space from world.
        texture_from_world: Arc<Transform>,
        /// s = p · this.
        vs: DVec3,
        /// t = p · this.
        vt: DVec3,
        /// Offsets.
        delta: Vec2,
    },
}

impl Mapping2d {
    /// (u, v) unchanged.
    pub const IDENTITY: Self = Self::Uv { scale: Vec2::ONE, delta: Vec2::ZERO };

    /// The position on the plane, with its derivatives over one pixel.
    ///
    /// Spherical: s = θ / π from the north pole (+z), t = φ / 2π in [0, 1) from x towards y. Cylindrical: s =
    /// (π + φ) / 2π with φ in (-π, π], t = z. On the axis of either the derivatives are infinite and count as
    /// zero.
    pub fn map(&self, at: &TextureContext) -> TexturePoint {
        match self {
            Self::Uv { scale, delta } => TexturePoint {
                st: *scale * at.uv + *delta,
                dst_dx: *scale * at.duv_dx,
                dst_dy: *scale * at.duv_dy,
            },
            Self::Affine { set, axes, origin } => {
                let (uv, duv_dx, duv_dy) = match set.further(&at.vertex) {
                    None => (at.uv, at.duv_dx, at.duv_dy),
                    Some(place) => (place.uv, place.duv_dx, place.duv_dy),
                };
                let turned = |v: Vec2| axes[0] * v.x + axes[1] * v.y;
                TexturePoint { st: turned(uv) + *origin, dst_dx: turned(duv_dx), dst_dy: turned(duv_dy) }
            }
            Self::Spherical { texture_from_world } => {
                let p = texture_from_world.point(at.point);
                let across = p.truncate().length();
                let phi = p.y.angle_from(p.x);
                let phi = if phi < 0.0 { phi + TAU } else { phi };
                let st = DVec2::new(across.angle_from(p.z) / PI, phi / TAU);
                let ds =
                    DVec3::new(p.x * p.z / across, p.y * p.z / across, -across) / (PI * p.length_squared());
                let dt = DVec3::new(-p.y, p.x, 0.0) / (TAU * across * across);
                TexturePoint::by_gradients(st, ds, dt, texture_from_world, at)
            }
            Self::Cylindrical { texture_from_world } => {
                let p = texture_from_world.point(at.point);
                let st = DVec2::new((PI + p.y.angle_from(p.x)) / TAU, p.z);
                let ds = DVec3::new(-p.y, p.x, 0.0) / (TAU * p.truncate().length_squared());
                TexturePoint::by_gradients(st, ds, DVec3::Z, texture_from_world, at)
            }
            Self::Planar { texture_from_world, vs, vt, delta } => {
                let p = texture_from_world.point(at.point);
                let st = DVec2::new(p.dot(*vs), p.dot(*vt)) + delta.as_dvec2();
                TexturePoint::by_gradients(st, *vs, *vt, texture_from_world, at)
            }
        }
    }
}

/// A position on the plane of a texture.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct TexturePoint {
    /// (s, t).
    pub st: Vec2,
    /// (∂s/∂x, ∂t/∂x).
    pub dst_dx: Vec2,
    /// (∂s/∂y, ∂t/∂y).
    pub dst_dy: Vec2,
}

impl TexturePoint {
    /// From the gradients of s and t in texture space.
    fn by_gradients(
        st: DVec2,
        ds: DVec3,
        dt: DVec3,
        texture_from_world: &Transform,
        at: &TextureContext,
    ) -> Self {
        let along = |dp: Vec3| {
            let dp = texture_from_world.vector(dp.as_dvec3());
            let dst = DVec2::new(ds.dot(dp), dt.dot(dp)).as_vec2();
            if dst.is_finite() { dst } else { Vec2::ZERO }
        };
        Self { st: st.as_vec2(), dst_dx: along(at.dpdx), dst_dy: along(at.dpdy) }
    }
}

/// A value that textures can have: a float or a spectrum.
pub trait TextureValue:
    Copy
    + Send
    + Sync
    + std::fmt::Debug
    + Add<Output = Self>
    + Mul<f32, Output = Self>
    + Mul<Output = Self>
    + 'static
{
    /// The filtered value of an image at a position.
    fn from_image(image: &MipMap, at: &TexturePoint) -> Self;

    /// The colour or alpha of vertex data.
    fn from_vertices(vertex: &VertexData) -> Self;

    /// One minus the value.
    fn complement(self) -> Self;

    /// The value, with negative numbers and NaN replaced by zero.
    fn clamp_negative(self) -> Self;

    /// A number, as a grey colour.
    fn from_number(number: f32) -> Self;

    /// A colour, as a number by its luminance.
    fn from_colour(colour: Spectrum) -> Self;

    /// A value that is the same everywhere, at the wavelengths of a place, if there are any.
    fn constant_at(self, at: &TextureContext) -> Self;

    /// A value that varies from place to place, at the wavelengths of a place, if there are any.
    fn varied_at(self, at: &TextureContext) -> Self;

    /// The values of a spectrum at the wavelengths of a place; itself where there are none.
    fn spectrum_at(self, spectrum: &SpectrumValue, at: &TextureContext) -> Self;
}

impl TextureValue for f32 {
    fn from_image(image: &MipMap, at: &TexturePoint) -> Self {
        image.lookup_float(at.st, at.dst_dx, at.dst_dy)
    }

    fn from_vertices(vertex: &VertexData) -> Self {
        vertex.coverage
    }

    fn complement(self) -> Self {
        1.0 - self
    }

    fn clamp_negative(self) -> Self {
        self.max(0.0)
    }

    fn from_number(number: f32) -> Self {
        number
    }

    fn from_colour(colour: Spectrum) -> Self {
        colour.luminance()
    }

    #[inline]
    fn constant_at(self, _: &TextureContext) -> Self {
        self
    }

    #[inline]
    fn varied_at(self, _: &TextureContext) -> Self {
        self
    }

    fn spectrum_at(self, _: &SpectrumValue, _: &TextureContext) -> Self {
        self
    }
}

impl TextureValue for Spectrum {
    fn from_image(image: &MipMap, at: &TexturePoint) -> Self {
        image.lookup(at.st, at.dst_dx, at.dst_dy)
    }

    fn from_vertices(vertex: &VertexData) -> Self {
        vertex.colour
    }

    fn complement(self) -> Self {
        Self::WHITE - self
    }

    fn clamp_negative(self) -> Self {
        self.map(|c| c.max(0.0))
    }

    fn from_number(number: f32) -> Self {
        Self::splat(number)
    }

    fn from_colour(colour: Spectrum) -> Self {
        colour
    }

    #[inline]
    fn constant_at(self, at: &TextureContext) -> Self {
        match &at.spectral {
            None => self,
            Some(spectral) => spectral.constant(self),
        }
    }

    #[inline]
    fn varied_at(self, at: &TextureContext) -> Self {
        match &at.spectral {
            None => self,
            Some(spectral) => spectral.varied(self),
        }
    }

    fn spectrum_at(self, spectrum: &SpectrumValue, at: &TextureContext) -> Self {
        let Some(spectral) = &at.spectral else { return self };
        match spectral.wavelengths.values(spectrum) {
            None => spectral.constant(self),
            Some(values) if spectral.is_unbounded => values,
            Some(values) => values.map(crate::unit),
        }
    }
}

/// An image on a surface. Its value is `scale * texel`, or `1 - scale * texel` when inverted.
#[derive(Clone, Debug)]
pub struct ImageTexture {
    /// From the surface to the image.
    pub mapping: Mapping2d,
    /// The image.
    pub image: Arc<MipMap>,
    /// A factor.
    pub scale: f32,
    /// Whether to invert the value.
    pub invert: bool,
}

impl ImageTexture {
    /// The value at a position, never negative.
    pub fn evaluate<T: TextureValue>(&self, at: &TextureContext) -> T {
        let value = T::from_image(&self.image, &self.mapping.map(at)) * self.scale;
        if self.invert { value.complement() } else { value }.clamp_negative()
    }
}

/// The closed set of textures. Constructors of trees bound their depth by [`Texture::MAX_DEPTH`].
#[derive(Clone, Debug)]
pub enum Texture<T: TextureValue> {
    /// A uniform value.
    Constant(T),
    /// A spectrum.
    Spectrum {
        /// Its colour.
        value: T,
        /// What it is by wavelength.
        spectrum: Arc<SpectrumValue>,
    },
    /// A product.
    Scale {
        /// The value.
        texture: Arc<Texture<T>>,
        /// Its factor.
        scale: Arc<Texture<f32>>,
    },
    /// A product of two textures, channel by channel.
    Product([Arc<Texture<T>>; 2]),
    /// A step function.
    Step {
        /// The input.
        input: Arc<Texture<f32>>,
        /// The threshold.
        edge: f32,
        /// The values below the threshold, and from it on.
        values: [T; 2],
    },
    /// The colour or alpha of vertex data.
    Vertices,
    /// Linear interpolation.
    Mix {
        /// The textures at amount 0 and 1.
        textures: [Arc<Texture<T>>; 2],
        /// The share of the second.
        amount: Arc<Texture<f32>>,
    },
    /// Interpolation by |n · direction|, the first where that is 1.
    DirectionMix {
        /// The two values.
        textures: [Arc<Texture<T>>; 2],
        /// A direction in world space.
        direction: Vec3,
    },
    /// Bilinear between the corners of the unit square, in the order v00, v01, v10, v11 (second digit: t).
    Bilerp {
        /// From the surface to the square.
        mapping: Mapping2d,
        /// Values at the corners.
        corners: [T; 4],
    },
    /// A checkerboard of two textures in two dimensions.
    Checkerboard2d {
        /// From the surface to the plane.
        mapping: Mapping2d,
        /// The textures; the first at (0, 0).
        textures: [Arc<Texture<T>>; 2],
    },
    /// A checkerboard of two textures in three dimensions.
    Checkerboard3d {
        /// Texture space from world.
        texture_from_world: Arc<Transform>,
        /// The textures; the first at the origin.
        textures: [Arc<Texture<T>>; 2],
    },
    /// Dots of one texture on another.
    Dots {
        /// From the surface to the plane, where each square of one unit about whole coordinates has one dot or none.
        mapping: Mapping2d,
        /// The textures inside and outside of the dots.
        textures: [Arc<Texture<T>>; 2],
    },
    /// A pattern of noise.
    Pattern(Pattern),
    /// An image.
    Image(ImageTexture),
}

/// A texture of numbers.
pub type FloatTexture = Texture<f32>;
/// A texture of colours.
pub type SpectrumTexture = Texture<Spectrum>;

impl<T: TextureValue> Texture<T> {
    /// The maximal depth of a tree of textures.
    pub const MAX_DEPTH: usize = 64;

    /// Whether it is uniform by its kind alone.
    pub fn is_constant(&self) -> bool {
        matches!(self, Self::Constant(_) | Self::Spectrum { .. })
    }

    /// The value at a position. A texture of zero weight is not evaluated.
    #[inline]
    pub fn evaluate(&self, at: &TextureContext) -> T {
        match self {
            Self::Constant(value) => value.constant_at(at),
            Self::Spectrum { value, spectrum } => value.spectrum_at(spectrum, at),
            Self::Scale { texture, scale } => texture.evaluate(at) * scale.evaluate(at),
            Self::Product([first, second]) => match at.spectral {
                None => first.evaluate(at) * second.evaluate(at),
                // The second colours the first: what is looked up is the colour that this gives.
                Some(_) => {
                    let rgb = at.in_rgb();
                    (first.evaluate(&rgb) * second.evaluate(&rgb)).varied_at(at)
                }
            },
            Self::Step { input, edge, values } => {
                values[usize::from(input.evaluate(at) >= *edge)].constant_at(at)
            }
            Self::Vertices => T::from_vertices(&at.vertex).varied_at(at),
            Self::Mix { textures, amount } => blend(textures, amount.evaluate(at), at),
            Self::DirectionMix { textures, direction } => {
                blend(textures, 1.0 - at.normal.dot(*direction).abs(), at)
            }
            Self::Bilerp { mapping, corners: [v00, v01, v10, v11] } => {
                let Vec2 { x: s, y: t } = mapping.map(at).st;
                let value = (*v00 * (1.0 - t) + *v01 * t) * (1.0 - s) + (*v10 * (1.0 - t) + *v11 * t) * s;
                value.varied_at(at)
            }
            Self::Checkerboard2d { mapping, textures } => {
                let place = mapping.map(at);
                let radius = 1.5 * place.dst_dx.abs().max(place.dst_dy.abs());
                let s = filtered_square_wave(place.st.x.into(), radius.x.into());
                let t = filtered_square_wave(place.st.y.into(), radius.y.into());
                blend(textures, (0.5 - 0.5 * s * t) as f32, at)
            }
            Self::Checkerboard3d { texture_from_world, textures } => {
                let cell = texture_from_world.point(at.point).floor();
                let odd = (cell.x + cell.y + cell.z).rem_euclid(2.0) == 1.0;
                textures[usize::from(odd)].evaluate(at)
            }
            Self::Dots { mapping, textures } => {
                textures[usize::from(!dots::is_inside(mapping.map(at).st))].evaluate(at)
            }
            Self::Pattern(pattern) => pattern.evaluate::<T>(at).varied_at(at),
            Self::Image(image) => image.evaluate::<T>(at).varied_at(at),
        }
    }

    /// [`Self::evaluate`] for coefficients, which may be more than 1 at the wavelengths of a place.
    pub fn evaluate_unbounded(&self, at: &TextureContext) -> T {
        match at.spectral {
            None => self.evaluate(at),
            Some(spectral) => {
                let spectral = Some(SpectralLookup { is_unbounded: true, ..spectral });
                self.evaluate(&TextureContext { spectral, ..*at })
            }
        }
    }
}

/// (1 - amount) · first + amount · second.
fn blend<T: TextureValue>(textures: &[Arc<Texture<T>>; 2], amount: f32, at: &TextureContext) -> T {
    if amount == 0.0 {
        textures[0].evaluate(at)
    } else if amount == 1.0 {
        textures[1].evaluate(at)
    } else {
        textures[0].evaluate(at) * (1.0 - amount) + textures[1].evaluate(at) * amount
    }
}

/// The square wave that is 1 on [0, 1), -1 on [1, 2) and so on, filtered by a tent of half-width `radius`: the
/// second difference of its second integral, over the square of the radius.
///
/// Quilez, "Filtering the Checkerboard Pattern", 2017.
fn filtered_square_wave(x: f64, radius: f64) -> f64 {
    let x = x.rem_euclid(2.0);
    if !x.is_finite() {
        return 0.0;
    }
    let crosses_an_edge = (x - radius).floor() != (x + radius).floor();
    // Below this the second difference is mostly rounding error, and the filter is invisible.
    if !crosses_an_edge || radius < 1e-6 {
        return if x < 1.0 { 1.0 } else { -1.0 };
    }
    let second_integral = |x: f64| {
        let half = 0.5 * x;
        let y = half - half.floor() - 0.5;
        half + y * (1.0 - 2.0 * y.abs())
    };
    (second_integral(x + radius) - 2.0 * second_integral(x) + second_integral(x - radius)) / (radius * radius)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{ImageFilter, MipMapOptions, Wrap};
    use lumbre_image::{Bitmap, Channels, Encoding, PixelData};

    fn at(point: DVec3, uv: Vec2) -> TextureContext {
        TextureContext {
            point,
            normal: Vec3::Z,
            uv,
            dpdx: Vec3::ZERO,
            dpdy: Vec3::ZERO,
            duv_dx: Vec2::ZERO,
            duv_dy: Vec2::ZERO,
            vertex: VertexData::NONE,
            spectral: None,
        }
    }

    fn constant(v: f32) -> Arc<FloatTexture> {
        Arc::new(Texture::Constant(v))
    }

    fn moved() -> Transform {
        let turn = Transform::rotate(DVec3::new(1.0, 2.0, -0.5), 40.0).unwrap();
        (Transform::translate(DVec3::new(3.0, -2.0, 5.0)) * turn).inverse()
    }

    #[test]
    fn values_scale_and_mix() {
        let here = at(DVec3::new(2.0, 3.0, 4.0), Vec2::new(0.3, 0.6));
        let scaled = Texture::Scale { texture: constant(3.0), scale: constant(0.25) };
        assert_eq!(scaled.evaluate(&here), 0.75);
        let mixed = Texture::Mix { textures: [constant(2.0), constant(4.0)], amount: constant(0.25) };
        assert_eq!(mixed.evaluate(&here), 2.5);
        let by_direction = Texture::DirectionMix {
            textures: [constant(2.0), constant(4.0)],
            direction: Vec3::new(0.8, 0.0, -0.6),
        };
        assert!((by_direction.evaluate(&here) - (0.6 * 2.0 + 0.4 * 4.0)).abs() < 1e-6);
        let corners = [1.0, 2.0, 3.0, 5.0];
        let bilerp = Texture::Bilerp { mapping: Mapping2d::IDENTITY, corners };
        for (st, value) in
            [((0.0, 0.0), 1.0), ((0.0, 1.0), 2.0), ((1.0, 0.0), 3.0), ((1.0, 1.0), 5.0), ((0.5, 0.5), 2.75)]
        {
            assert!((bilerp.evaluate(&at(DVec3::ONE, Vec2::new(st.0, st.1))) - value).abs() < 1e-6);
        }
    }

    #[test]
    fn vertices_tint_and_further_parameters_turn() {
        let second = FurtherUv {
            uv: Vec2::new(0.2, 0.7),
            duv_dx: Vec2::new(0.01, 0.02),
            duv_dy: Vec2::new(-0.03, 0.04),
        };
        let third = FurtherUv { uv: Vec2::new(0.4, -0.1), ..second };
        let fourth = FurtherUv { uv: Vec2::new(0.9, 0.6), ..second };
        let vertex = VertexData {
            colour: Spectrum::new(0.5, 0.25, 2.0),
            coverage: 0.75,
            further: [second, third, fourth],
        };
        let here = TextureContext { vertex, ..at(DVec3::new(2.0, 3.0, 4.0), Vec2::new(0.3, 0.6)) };
        let tint: Texture<Spectrum> = Texture::Product([
            Arc::new(Texture::Vertices),
            Arc::new(Texture::Constant(Spectrum::new(0.5, 2.0, 3.0))),
        ]);
        assert_eq!(tint.evaluate(&here), Spectrum::new(0.25, 0.5, 6.0));
        let coverage: Arc<Texture<f32>> = Arc::new(Texture::Vertices);
        for (edge, value) in [(0.75, 1.0), (0.76, 0.0)] {
            let step = Texture::Step { input: coverage.clone(), edge, values: [0.0, 1.0] };
            assert_eq!(step.evaluate(&here), value);
        }
        let mapping = |set| Mapping2d::Affine {
            set,
            axes: [Vec2::new(0.0, 2.0), Vec2::new(-3.0, 0.0)],
            origin: Vec2::new(0.5, 0.25),
        };
        let turned = mapping(UvSet::Second).map(&here);
        assert!((turned.st - Vec2::new(-1.6, 0.65)).length() < 1e-6);
        assert!((turned.dst_dx - Vec2::new(-0.06, 0.02)).length() < 1e-6);
        assert!((turned.dst_dy - Vec2::new(-0.12, -0.06)).length() < 1e-6);
        assert!((mapping(UvSet::First).map(&here).st - Vec2::new(-1.3, 0.85)).length() < 1e-6);
        for (set, uv) in UvSet::FURTHER.into_iter().zip([second.uv, third.uv, fourth.uv]) {
            let expected = Vec2::new(0.5 - 3.0 * uv.y, 0.25 + 2.0 * uv.x);
            assert!((mapping(set).map(&here).st - expected).length() < 1e-6, "{set:?}");
        }
    }

    #[test]
    fn mappings_give_the_angles_and_products_they_promise() {
        let transform = moved();
        let world = |p: DVec3| at(transform.inverse_point(p), Vec2::new(0.3, 0.6));
        let uv = Mapping2d::Uv { scale: Vec2::new(4.0, -2.0), delta: Vec2::new(0.5, 3.0) };
        assert!((uv.map(&world(DVec3::ONE)).st - Vec2::new(1.7, 1.8)).length() < 1e-6);

        let spherical = Mapping2d::Spherical { texture_from_world: transform.into() };
        for (p, st) in [
            (DVec3::new(2.0, 0.0, 0.0), (0.5, 0.0)),
            (DVec3::new(0.0, 3.0, 0.0), (0.5, 0.25)),
            (DVec3::new(0.0, -2.0, 2.0), (0.25, 0.75)),
            (DVec3::new(-1.0, 0.0, -1.0), (0.75, 0.5)),
        ] {
            let ours = spherical.map(&world(p)).st;
            // (t wraps about the x axis.)
            let apart = (ours - Vec2::new(st.0, st.1)).abs();
            assert!(apart.x < 1e-6 && apart.y.min(1.0 - apart.y) < 1e-6, "{p}: {ours}");
        }
        let cylindrical = Mapping2d::Cylindrical { texture_from_world: transform.into() };
        for (p, st) in [(DVec3::new(2.0, 0.0, -7.0), (0.5, -7.0)), (DVec3::new(0.0, 3.0, 1.5), (0.75, 1.5))] {
            assert!((cylindrical.map(&world(p)).st - Vec2::new(st.0, st.1)).length() < 1e-5);
        }
        let planar = Mapping2d::Planar {
            texture_from_world: transform.into(),
            vs: DVec3::new(2.0, 0.0, 1.0),
            vt: DVec3::new(0.0, -1.0, 0.0),
            delta: Vec2::new(0.25, 0.5),
        };
        let ours = planar.map(&world(DVec3::new(1.0, 2.0, 3.0))).st;
        assert!((ours - Vec2::new(5.25, -1.5)).length() < 1e-5);
    }

    #[test]
    fn derivatives_of_mappings_are_those_of_differences() {
        let transform = moved();
        let mappings = [
            Mapping2d::Spherical { texture_from_world: transform.into() },
            Mapping2d::Cylindrical { texture_from_world: transform.into() },
            Mapping2d::Planar {
                texture_from_world: transform.into(),
                vs: DVec3::new(2.0, 0.0, 1.0),
                vt: DVec3::new(0.0, -1.0, 0.5),
                delta: Vec2::ZERO,
            },
        ];
        let step = 1e-3;
        let (dx, dy) = (DVec3::new(0.6, -0.2, 0.7) * step, DVec3::new(-0.1, 0.9, 0.3) * step);
        for mapping in &mappings {
            for p in [DVec3::new(1.0, 2.0, 0.5), DVec3::new(-2.0, 0.7, -1.0), DVec3::new(0.4, -0.9, 3.0)] {
                let p = transform.inverse_point(p);
                let here = TextureContext { dpdx: dx.as_vec3(), dpdy: dy.as_vec3(), ..at(p, Vec2::ONE) };
                let ours = mapping.map(&here);
                for (d, derivative) in [(dx, ours.dst_dx), (dy, ours.dst_dy)] {
                    let st = |p| mapping.map(&at(p, Vec2::ONE)).st;
                    let difference = st(p + 0.5 * d) - st(p - 0.5 * d);
                    assert!(
                        (difference - derivative).length() < 2e-6,
                        "{mapping:?} {difference} {derivative}"
                    );
                }
            }
        }
        // On the axis they are infinite and count as none.
        let pole = TextureContext {
            dpdx: dx.as_vec3(),
            ..at(transform.inverse_point(DVec3::new(0.0, 0.0, 2.0)), Vec2::ONE)
        };
        assert!(mappings[0].map(&pole).dst_dx.is_finite());
    }

    #[test]
    fn a_checkerboard_is_its_mean_from_afar() {
        let board = Texture::Checkerboard2d {
            mapping: Mapping2d::Uv { scale: Vec2::splat(4.0), delta: Vec2::ZERO },
            textures: [constant(1.0), constant(0.0)],
        };
        let value = |uv: (f32, f32), size: f32| {
            let here = at(DVec3::ONE, Vec2::new(uv.0, uv.1));
            board.evaluate(&TextureContext { duv_dx: Vec2::X * size, duv_dy: Vec2::Y * size, ..here })
        };
        for (uv, expected) in
            [((0.1, 0.1), 1.0), ((0.3, 0.1), 0.0), ((0.3, 0.3), 1.0), ((-0.1, 0.1), 0.0), ((-0.1, -0.3), 0.0)]
        {
            assert_eq!(value(uv, 0.0), expected, "{uv:?}");
            assert_eq!(value(uv, 0.01), expected, "{uv:?}");
            assert!((value(uv, 30.0) - 0.5).abs() < 1e-3, "{uv:?}");
        }
        // On an edge, half of each.
        assert!((value((0.25, 0.1), 0.01) - 0.5).abs() < 1e-5);
        assert!((0.0..=1.0).contains(&value((f32::NAN, 0.1), 0.01)));
    }

    #[test]
    fn the_filtered_wave_is_the_wave_under_a_tent() {
        let mut count = 0;
        for x in [0.1, 0.95, 1.5, 1.999, -0.3, 17.2] {
            for radius in [0.01, 0.3, 0.9, 2.7] {
                let steps = 200_000;
                let mut sum = 0.0;
                for i in 0..steps {
                    let t = 2.0 * (f64::from(i) + 0.5) / f64::from(steps) - 1.0;
                    let wave = if (x + radius * t).rem_euclid(2.0) < 1.0 { 1.0 } else { -1.0 };
                    sum += wave * (1.0 - t.abs()) * 2.0 / f64::from(steps);
                }
                let ours = filtered_square_wave(x, radius);
                assert!((ours - sum).abs() < 1e-4, "{x} {radius}: {ours} {sum}");
                count += 1;
            }
        }
        assert_eq!(count, 24);
    }

    #[test]
    fn cubes_alternate_along_every_axis() {
        let transform = moved();
        let board = Texture::Checkerboard3d {
            texture_from_world: transform.into(),
            textures: [constant(1.0), constant(0.0)],
        };
        for (p, expected) in [
            ((0.5, 0.5, 0.5), 1.0),
            ((1.5, 0.5, 0.5), 0.0),
            ((0.5, -0.5, 0.5), 0.0),
            ((0.5, -0.5, -0.5), 1.0),
            ((-7.5, 2.5, 0.5), 1.0),
        ] {
            let here = at(transform.inverse_point(DVec3::new(p.0, p.1, p.2)), Vec2::ONE);
            assert_eq!(board.evaluate(&here), expected, "{p:?}");
        }
    }

    #[test]
    fn an_image_is_scaled_then_inverted_and_never_negative() {
        let data = PixelData::F32(vec![0.2, 0.4, 1.5, 0.2, 0.4, 1.5]);
        let bitmap = Bitmap::new(2, 1, Channels::Rgb, data, Encoding::Linear).unwrap();
        let options = MipMapOptions { wrap: Wrap::Repeat, filter: ImageFilter::Bilinear };
        let image = Arc::new(MipMap::new(Arc::new(bitmap), options));
        let texture = |scale, invert| ImageTexture {
            mapping: Mapping2d::IDENTITY,
            image: Arc::clone(&image),
            scale,
            invert,
        };
        let here = at(DVec3::ONE, Vec2::new(0.3, 0.6));
        let colour: Spectrum = Texture::Image(texture(2.0, true)).evaluate(&here);
        assert!((colour - Spectrum::new(0.6, 0.2, 0.0)).map(f32::abs).max_component() < 1e-6, "{colour:?}");
        let number: f32 = Texture::Image(texture(0.5, false)).evaluate(&here);
        assert!((number - 0.35).abs() < 1e-6);
    }
}
