//! Spheres packed by eight: a first test in single precision, and the exact test for the rest.

use bytemuck::{Pod, Zeroable};
use lumbre_geometry::{Ray, Root, Roots, Sphere, Surface, sphere_crossings};
use lumbre_math::DVec3;

use crate::tree::BLOCK;
use crate::tree::geometry::SphereCloud;

/// Up to eight spheres of one cloud. Unused lanes are NaN, which no ray hits.
#[derive(Clone, Copy, Debug, Pod, Zeroable)]
#[repr(C, align(64))]
pub(crate) struct SphereBlock {
    /// `centers[axis][lane]`, relative to the cloud's origin.
    pub(crate) centers: [[f32; BLOCK]; 3],
    pub(crate) radii: [f32; BLOCK],
}

const _: () = assert!(size_of::<SphereBlock>() == 128);

impl SphereBlock {
    /// A block without spheres.
    pub(crate) const EMPTY: Self = Self { centers: [[f32::NAN; BLOCK]; 3], radii: [f32::NAN; BLOCK] };

    /// Puts a sphere into a lane.
    #[inline(always)]
    pub(crate) fn put(&mut self, lane: usize, [x, y, z, radius]: [f32; 4]) {
        for (axis, coordinate) in [x, y, z].into_iter().enumerate() {
            self.centers[axis][lane] = coordinate;
        }
        self.radii[lane] = radius;
    }

    /// The sphere in a lane, of a cloud with this origin.
    #[inline(always)]
    pub(crate) fn sphere(&self, lane: usize, origin: &DVec3) -> ExactSphere {
        let lane = lane % BLOCK;
        ExactSphere::new(self.centers.map(|axis| axis[lane]), self.radii[lane], origin)
    }
}

/// Whether a sphere can be hit at all.
#[inline(always)]
pub(crate) fn has_radius(sphere: &[f32; 4]) -> bool {
    sphere[3] > 0.0
}

/// A sphere in double precision, with the answers of a [`Sphere`] of the same numbers.
#[derive(Clone, Copy)]
pub(crate) struct ExactSphere {
    pub(crate) center: DVec3,
    pub(crate) radius: f64,
}

impl ExactSphere {
    #[inline(always)]
    fn new(center: [f32; 3], radius: f32, origin: &DVec3) -> Self {
        Self { center: *origin + DVec3::from_array(center.map(f64::from)), radius: radius.into() }
    }

    /// A sphere of a cloud.
    #[inline(always)]
    pub(crate) fn of(cloud: &SphereCloud, primitive: u32) -> Self {
        let [x, y, z, radius] = cloud.spheres[primitive as usize];
        Self::new([x, y, z], radius, &cloud.origin)
    }

    /// The first crossing in the ray's range, and whether the ray only touches the sphere there. As
    /// [`Sphere::closest`].
    #[inline(always)]
    pub(crate) fn closest(&self, ray: &Ray) -> Option<Root> {
        let (first, second) = sphere_crossings(self.center, self.radius, ray)?;
        let hits = |t: f64| t.is_finite() && ray.contains(t);
        let t = if hits(first) {
            first
        } else if hits(second) {
            second
        } else {
            return None;
        };
        Some(Root { multiplicity: 1 + u8::from(first == second), ..Root::at(t) })
    }

    /// Every crossing, as [`Sphere::roots`].
    pub(crate) fn roots(&self, ray: &Ray, out: &mut Roots) {
        let Some((first, second)) = sphere_crossings(self.center, self.radius, ray) else {
            return;
        };
        let hits = |t: &f64| t.is_finite() && ray.contains(*t);
        if first == second {
            out.extend(Some(first).filter(hits).map(|t| Root { multiplicity: 2, ..Root::at(t) }));
        } else {
            out.extend([first, second].into_iter().filter(hits).map(Root::at));
        }
    }

    /// The sphere as a shape.
    ///
    /// # Panics
    /// If it has no radius; such a sphere is in no tree.
    pub(crate) fn to_shape(self) -> Sphere {
        Sphere::new(self.center, self.radius).expect("it has a radius")
    }

    /// The surface at a crossing.
    pub(crate) fn surface(&self, ray: &Ray, root: &Root) -> Surface {
        self.to_shape().surface(ray, root)
    }

    /// Whether the ball contains `p`.
    pub(crate) fn contains(&self, p: DVec3) -> bool {
        self.radius > 0.0 && self.to_shape().contains(p)
    }
}

/// A ray in single precision, for a sharp but conservative first test of eight spheres.
///
/// # Error bound
///
/// Lengths are in units of space, so that a position on the ray is `t |d|`. Let R be the largest coordinate of a
/// centre, plus the largest radius, plus the largest coordinate of the ray's origin, all relative to the cloud, and u =
/// 2⁻²⁴. The vector w from the ray's origin to a centre has a length of at most √3 R. As computed here, it has an error
/// of 2u|R| on each axis, since the origin is rounded and so is the difference: 3.5uR in total. The direction e, of
/// length 1, has an error of u. So b = w·e has an error of 3.5uR + 1.8uR from these, and 3u√3R = 5.2uR from its own
/// rounding: 10.5uR. The vector p = w - b e from the foot of the centre on the ray has an error of 3.5uR + 10.5uR +
/// 1.8uR from these, and 3.5uR from its own rounding: below δ = 20uR.
///
/// The test in double precision hits only if the true |p| is at most the radius r, give or take 2⁻⁴⁸R. So the computed
/// p², with a relative error of 3u, is at most (r + δ)² (1 + 3u), which is less than the computed s² for s = r +
/// `margin` with `margin` = 32uR ≥ δ + 5uR + 2⁻⁴⁸R: that leaves 5u of s, which is at most R + δ, and twice as much of
/// its square. For the same reasons, half the chord, √(r² - p²), is at most the computed √(s² - p²), up to a relative
/// error of u.
///
/// In double precision, t |d| is off from b ± √(r² - p²) as it is there by no more than 2uR: where the line all but
/// touches, r² - p² is 0 or at least 2⁻⁵⁴r², so that the divisor of the stable quadratic is at least 2⁻²⁷r |d|, and
/// what it divides is off by 2⁻⁵¹r² at most; elsewhere it is off by far less. So both crossings lie at b ∓ √(s² - p²)
/// as computed here or between, give or take (10.5 + 1 + 2 + 3)uR; `range_margin` = 64uR also has room for the
/// roundings of the range's ends.
///
/// Where |p| ≤ r - `margin` as computed here, the line does cross the sphere, for 32uR is more than δ and all
/// roundings. The first crossing is then in range where b - √(s² - p²) is by `range_margin` after its start, and b by
/// as much before its end.
///
/// In double precision, adding the cloud's origin rounds centres once more: by 2⁻⁵³ of the origin's largest coordinate.
/// Both margins include 2⁻⁴⁸ of it.
///
/// If the computed |p| ≤ r - `margin`, the ray certainly crosses the sphere. The first crossing is at or after b -
/// √(s² - p²), as shown above, and at or before b - √((r - `margin`)² - p²), which for the same reasons is no less,
/// both as computed here and give or take (10.5 + 1 + 2 + 3)uR. Of two such spheres, one is certainly nearer if its
/// latter value is by `range_margin` before the former value of the other: that is twice the error, and leaves 31uR for
/// rounding.
///
/// There is no relevant overflow or underflow if 2⁻⁴⁰ ≤ R ≤ 2⁶⁰ and the direction is neither absurdly long nor short;
/// otherwise all eight spheres are tested exactly.
#[derive(Clone, Copy, Debug)]
pub(crate) struct SphereRay {
    pub(crate) origin: [f32; 3],
    /// Of length 1.
    pub(crate) direction: [f32; 3],
    pub(crate) margin: f32,
    pub(crate) range_margin: f32,
    /// The range of relevant crossings.
    pub(crate) near: f32,
    pub(crate) far: f32,
    /// A position in this range is certainly in the ray's range.
    pub(crate) surely_in: [f32; 2],
}

impl SphereRay {
    /// A ray that hits nothing.
    pub(crate) const NONE: Self = Self {
        origin: [0.0; 3],
        direction: [0.0; 3],
        margin: 0.0,
        range_margin: 0.0,
        near: f32::INFINITY,
        far: f32::NEG_INFINITY,
        surely_in: [f32::INFINITY, f32::NEG_INFINITY],
    };

    /// `reach` is the largest coordinate of a centre plus the largest radius; `None` if the test is too coarse. Also
    /// returns the units of space per `t`. The caller has to set the range.
    #[inline(always)]
    pub(crate) fn new(ray: &Ray, cloud_origin: &DVec3, reach: f64) -> Option<(Self, f64)> {
        let (spheres, length) = Self::sharp(ray, cloud_origin, reach);
        let is_sharp = Self::is_sharp(reach + largest(&(ray.origin - *cloud_origin)));
        (is_sharp && (1e-50..=1e50).contains(&length)).then_some((spheres, length))
    }

    /// Whether the test is sharp enough if no coordinate is larger than this.
    pub(crate) fn is_sharp(reach: f64) -> bool {
        1.0 / (1u64 << 40) as f64 <= reach && reach <= (1u64 << 60) as f64
    }

    /// As [`Self::new`], if the test is known to be sharp enough.
    #[inline(always)]
    pub(crate) fn sharp(ray: &Ray, cloud_origin: &DVec3, reach: f64) -> (Self, f64) {
        let u = 1.0 / (1u64 << 24) as f64;
        let origin = ray.origin - *cloud_origin;
        let length = ray.direction.length();
        let direction = ray.direction / length;
        let reach = reach + largest(&origin);
        let moved = largest(cloud_origin) * (1.0 / (1u64 << 48) as f64);
        let spheres = Self {
            origin: [origin.x as f32, origin.y as f32, origin.z as f32],
            direction: [direction.x as f32, direction.y as f32, direction.z as f32],
            margin: (32.0 * u * reach + moved) as f32,
            range_margin: (64.0 * u * reach + moved) as f32,
            ..Self::NONE
        };
        (spheres, length)
    }

    /// Limits the test to a range of `t`, given the units of space per `t`.
    #[inline(always)]
    pub(crate) fn set_range(&mut self, length: f64, t_min: f64, t_max: f64) {
        let margin = f64::from(self.range_margin);
        self.near = (t_min * length - margin) as f32;
        self.far = (t_max * length + margin) as f32;
        self.surely_in = [(t_min * length + margin) as f32, (t_max * length - margin) as f32];
    }
}

#[inline(always)]
fn largest(v: &DVec3) -> f64 {
    let greater = |a: f64, b: f64| if a > b { a } else { b };
    greater(greater(v.x.abs(), v.y.abs()), v.z.abs())
}
