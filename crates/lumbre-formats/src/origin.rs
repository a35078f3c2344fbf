//! Positions in double precision, which a mesh keeps in single precision relative to an origin near them.

use lumbre_math::{DVec3, Transform, Vec3};
use lumbre_scene::MeshDesc;

/// Where positions are, and whether single precision holds them.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Spread {
    low: DVec3,
    high: DVec3,
    is_exact: [bool; 3],
}

impl Spread {
    pub(crate) const NOTHING: Self =
        Self { low: DVec3::INFINITY, high: DVec3::NEG_INFINITY, is_exact: [true; 3] };

    /// With another position; one that is not finite does not count.
    pub(crate) fn with(mut self, p: DVec3) -> Self {
        if p.is_finite() {
            (self.low, self.high) = (self.low.min(p), self.high.max(p));
            for axis in 0..3 {
                self.is_exact[axis] &= f64::from(p[axis] as f32) == p[axis];
            }
        }
        self
    }

    /// The origin for these positions: zero, but for the axes along which they are far from there as their extent
    /// goes, and single precision would move them.
    pub(crate) fn origin(self) -> DVec3 {
        const FAR: f64 = 16.0;
        if self.low.x > self.high.x {
            return DVec3::ZERO;
        }
        let (center, half) = (0.5 * (self.low + self.high), 0.5 * (self.high - self.low).max_element());
        let mut origin = DVec3::ZERO;
        for axis in 0..3 {
            if !self.is_exact[axis] && center[axis].abs() > FAR * half {
                // In few digits, so that what is written in few digits stays so.
                origin[axis] = f64::from(center[axis] as f32);
            }
        }
        origin
    }
}

/// The origin for a list of positions.
pub(crate) fn origin_of(positions: &[DVec3]) -> DVec3 {
    positions.iter().fold(Spread::NOTHING, |spread, &p| spread.with(p)).origin()
}

/// A position relative to an origin; zero where it is not finite.
pub(crate) fn relative(position: DVec3, origin: DVec3) -> Vec3 {
    let near = (position - origin).as_vec3();
    if near.is_finite() { near } else { Vec3::ZERO }
}

/// The transform from positions relative to an origin to where they are.
pub(crate) fn placed(origin: DVec3) -> Transform {
    Transform::translate(origin)
}

/// The diagonal of the bounding box; 0 where there is none.
pub(crate) fn diagonal(positions: &[Vec3]) -> f64 {
    let low = positions.iter().copied().fold(Vec3::INFINITY, Vec3::min).as_dvec3();
    let high = positions.iter().copied().fold(Vec3::NEG_INFINITY, Vec3::max).as_dvec3();
    if low.x <= high.x { (high - low).length() } else { 0.0 }
}

/// Whether every face of a mesh that has faces is without area.
pub(crate) fn is_without_area(mesh: &MeshDesc) -> bool {
    let at = |i: u32| mesh.positions[i as usize].as_dvec3();
    let is_flat = |a, b, c| (at(b) - at(a)).cross(at(c) - at(a)) == DVec3::ZERO;
    mesh.triangles.iter().all(|&[a, b, c]| is_flat(a, b, c))
        && mesh.quads.iter().all(|&[a, b, c, d]| is_flat(a, b, c) && is_flat(a, c, d))
        && !(mesh.triangles.is_empty() && mesh.quads.is_empty())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_far_from_zero_keeps_its_digits() {
        let far = DVec3::new(500_000.0, 4_649_781.25, -3.5);
        let list: Vec<DVec3> = (0..7).map(|i| far + f64::from(i) * DVec3::new(0.01, 0.02, 0.03)).collect();
        let origin = origin_of(&list);
        for p in &list {
            assert!((relative(*p, origin).as_dvec3() + origin - *p).abs().max_element() < 1e-8);
        }
        // Near, or exact in single precision: as it is.
        let near = [DVec3::new(0.1, 0.2, 0.3), DVec3::new(0.3, -0.7, 0.9)];
        assert_eq!(origin_of(&near), DVec3::ZERO);
        assert_eq!(origin_of(&[DVec3::splat(4096.0), DVec3::splat(4097.0)]), DVec3::ZERO);
        assert_eq!(origin_of(&[DVec3::NAN]), DVec3::ZERO);
    }
}
