//! Patterns of gradient noise in space: clouds, creases, waves and marble.
//!
//! D. Ebert and others, "Texturing and Modeling: A Procedural Approach", 3rd edition, 2003; with the constants of
//! pbrt-v4.

use std::sync::Arc;

use lumbre_math::noise::Octaves;
use lumbre_math::{Elementary, Transform, Vec3};

use super::{TextureContext, TextureValue};
use crate::Spectrum;

/// A pattern of noise in space.
#[derive(Clone, Debug, PartialEq)]
pub struct Pattern {
    /// Texture space from world.
    pub texture_from_world: Arc<Transform>,
    /// What it looks like.
    pub kind: PatternKind,
}

/// What a [`Pattern`] looks like.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum PatternKind {
    /// A sum of octaves of noise: numbers about 0, of both signs.
    Fbm(Octaves),
    /// A sum of the absolute values of octaves of noise, with creases where they are 0: numbers from 0.
    Wrinkled(Octaves),
    /// The waves of water on which wind blows now more, now less: numbers about 0, of both signs.
    Windy,
    /// Veins of marble, across y.
    Marble {
        /// The octaves of noise that bend the veins.
        octaves: Octaves,
        /// How many of them there are: a factor of the place.
        scale: f64,
        /// How much they are bent.
        variation: f64,
    },
}

/// What stirs the wind, and the waves under it.
const GUSTS: Octaves = Octaves { count: 3, roughness: 0.5 };
const WAVES: Octaves = Octaves { count: 6, roughness: 0.5 };

/// The colours of marble; each four are the points of a cubic Bézier curve.
const MARBLE: [Spectrum; 9] = {
    let pale = Spectrum::new(0.58, 0.58, 0.6);
    let grey = Spectrum::new(0.5, 0.5, 0.5);
    let warm = Spectrum::new(0.6, 0.59, 0.58);
    let vein = Spectrum::new(0.2, 0.2, 0.33);
    [pale, pale, pale, grey, warm, pale, pale, vein, pale]
};

impl Pattern {
    pub(super) fn evaluate<T: TextureValue>(&self, at: &TextureContext) -> T {
        let p = self.texture_from_world.point(at.point);
        let side = |side: Vec3| self.texture_from_world.vector(side.as_dvec3());
        let footprint = [side(at.dpdx), side(at.dpdy)];
        let scaled = |scale: f64| (scale * p, footprint.map(|side| scale * side));
        match self.kind {
            PatternKind::Fbm(octaves) => T::from_number(octaves.fbm(p, footprint) as f32),
            PatternKind::Wrinkled(octaves) => T::from_number(octaves.turbulence(p, footprint) as f32),
            PatternKind::Windy => {
                let (slow, wide) = scaled(0.1);
                T::from_number((GUSTS.fbm(slow, wide).abs() * WAVES.fbm(p, footprint)) as f32)
            }
            PatternKind::Marble { octaves, scale, variation } => {
                let (p, footprint) = scaled(scale);
                T::from_colour(marble(p.y + variation * octaves.fbm(p, footprint)))
            }
        }
    }
}

/// The colour where the veins have this phase.
fn marble(phase: f64) -> Spectrum {
    let along = (0.5 + 0.5 * phase.sine()) * 6.0;
    let first = along.floor().clamp(0.0, 5.0);
    let t = (along - first) as f32;
    let points = &MARBLE[first as usize..first as usize + 4];
    let s = 1.0 - t;
    let weights = [s * s * s, 3.0 * s * s * t, 3.0 * s * t * t, t * t * t];
    let sum = points.iter().zip(weights).fold(Spectrum::BLACK, |sum, (&point, weight)| sum + point * weight);
    sum * 1.5
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{Texture, VertexData};
    use lumbre_math::{DVec3, Vec2};

    fn at(point: DVec3, size: f32) -> TextureContext {
        TextureContext {
            point,
            normal: Vec3::Z,
            uv: Vec2::ZERO,
            dpdx: Vec3::X * size,
            dpdy: Vec3::Y * size,
            duv_dx: Vec2::ZERO,
            duv_dy: Vec2::ZERO,
            vertex: VertexData::NONE,
            spectral: None,
        }
    }

    fn pattern(kind: PatternKind) -> Pattern {
        // Texture space is moved, and half as large.
        let world_from_texture =
            Transform::translate(DVec3::new(3.0, -2.0, 5.0)) * Transform::scale(DVec3::splat(2.0)).unwrap();
        Pattern { texture_from_world: Arc::new(world_from_texture.inverse()), kind }
    }

    #[test]
    fn patterns_are_filtered_in_texture_space() {
        let octaves = Octaves { count: 4, roughness: 0.7 };
        let (world, local) = (DVec3::new(3.5, 1.0, -2.0), DVec3::new(0.25, 1.5, -3.5));
        let sides = [DVec3::X * 0.05, DVec3::Y * 0.05];
        let here = at(world, 0.1);
        let fbm: f32 = pattern(PatternKind::Fbm(octaves)).evaluate(&here);
        assert!((f64::from(fbm) - octaves.fbm(local, sides)).abs() < 1e-6);
        let wrinkled: f32 = pattern(PatternKind::Wrinkled(octaves)).evaluate(&here);
        assert!((f64::from(wrinkled) - octaves.turbulence(local, sides)).abs() < 1e-6);
        let windy: Spectrum = pattern(PatternKind::Windy).evaluate(&here);
        let gusts = GUSTS.fbm(0.1 * local, sides.map(|side| 0.1 * side)).abs();
        assert!((f64::from(windy.g) - gusts * WAVES.fbm(local, sides)).abs() < 1e-6);
        assert_eq!(windy.r, windy.b);
    }

    #[test]
    fn marble_goes_through_its_colours() {
        let octaves = Octaves { count: 0, roughness: 0.5 };
        let kind = PatternKind::Marble { octaves, scale: 1.0, variation: 0.2 };
        let colour = |phase: f64| -> Spectrum {
            Texture::<Spectrum>::Pattern(pattern(kind))
                .evaluate(&at(DVec3::new(1.0, 2.0 * phase - 2.0, 3.0), 0.0))
        };
        let end = |i: usize| MARBLE[i] * 1.5;
        let near = |a: Spectrum, b: Spectrum| (a - b).map(f32::abs).max_component() < 1e-5;
        assert!(near(colour(-std::f64::consts::FRAC_PI_2), end(0)));
        assert!(near(colour(std::f64::consts::FRAC_PI_2), end(8)));
        // In the middle a span begins, at its first point.
        assert!(near(colour(0.0), end(3)), "{:?}", colour(0.0));
        let number: f32 = pattern(kind).evaluate(&at(DVec3::new(1.0, -2.0, 3.0), 0.0));
        assert!((number - end(3).luminance()).abs() < 1e-5);
    }
}
