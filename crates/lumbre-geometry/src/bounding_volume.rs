//! Bounding volumes for quick rejection of rays.

use lumbre_math::{DMat3, DVec3, Transform};

use crate::Aabb;

/// A bounding volume of a shape: a line that misses it misses the shape.
///
/// Its points are `center + axes * q`, for `q` in the cube [-1, 1]³ with x² + y² + c z² + d z + e ≤ 0 for
/// `profile` = [c, d, e]. This makes a ball, a cylinder, a cone, a paraboloid, or the whole cube. The points of
/// a ring torus also satisfy the equation of its tube.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct BoundingVolume {
    /// The point where `q` is 0.
    pub center: DVec3,
    /// The vectors from the centre to where x, y and z are 1. All are non-zero, even of a flat volume.
    pub axes: DMat3,
    /// Whether the volume has no extent along y: then it is the points with y = 0.
    pub is_flat: bool,
    /// c, d and e, each at most 2 in magnitude; but `e` is -8 where the volume is the whole cube.
    pub profile: [f64; 3],
    /// Of a ring torus, the radius r of its tube over its largest radius, less than 1/2; else 0. With ρ = √(x²
    /// + y²), its points satisfy (ρ - (1 - r))² + r² z² = r², and the points inside are less.
    pub tube: f64,
    /// Whether the shape is the whole boundary of the volume, which is not flat: then every line through its
    /// interior crosses the shape where it enters and where it leaves. True for a ring torus.
    pub is_solid: bool,
}

impl BoundingVolume {
    const BOX: [f64; 3] = [0.0, 0.0, -8.0];
    pub(crate) const BALL: [f64; 3] = [1.0, 0.0, -1.0];
    pub(crate) const CYLINDER: [f64; 3] = [0.0, 0.0, -1.0];

    /// A volume that is neither flat nor a ring.
    pub(crate) fn new(center: DVec3, axes: DMat3, profile: [f64; 3], is_solid: bool) -> Self {
        Self { center, axes, is_flat: false, profile, tube: 0.0, is_solid }
    }

    /// A flat volume in the plane through `center` along `x` and `z`, which are neither 0 nor parallel. `None`
    /// where their product over- or underflows.
    pub(crate) fn flat(center: DVec3, x: DVec3, z: DVec3, profile: [f64; 3]) -> Option<Self> {
        let normal = z.cross(x).try_normalize()?;
        let axes = DMat3::from_cols(x, normal * x.length().max(z.length()), z);
        Some(Self { center, axes, is_flat: true, profile, tube: 0.0, is_solid: false })
    }

    /// A box; `None` where it is less than a rectangle.
    pub(crate) fn of_box(bounds: &Aabb) -> Option<Self> {
        let (center, half) = (bounds.center(), 0.5 * bounds.size());
        let flat = (0..3).filter(|&axis| half[axis] == 0.0).collect::<Vec<_>>();
        let side = |axis: usize| half[axis] * DVec3::AXES[axis];
        match *flat {
            [] => Some(Self::new(center, DMat3::from_diagonal(half), Self::BOX, false)),
            [axis] => Self::flat(center, side((axis + 1) % 3), side((axis + 2) % 3), Self::BOX),
            _ => None,
        }
    }

    /// The volume under a map.
    #[must_use]
    pub fn under(&self, map: &Transform) -> Self {
        Self { center: map.point(self.center), axes: map.linear() * self.axes, ..*self }
    }

    /// Whether the volume contains the point at `q`, within `margin`.
    pub fn holds(&self, q: DVec3, margin: f64) -> bool {
        let [c, d, e] = self.profile;
        let height = if self.is_flat { 0.0 } else { 1.0 };
        let beside = q.x * q.x + q.y * q.y;
        let is_in_cube = q.abs().cmple(DVec3::new(1.0, height, 1.0) + margin).all();
        let from_circle = beside.sqrt() - (1.0 - self.tube);
        let square = from_circle * from_circle + (self.tube * q.z) * (self.tube * q.z);
        let is_in_tube = self.tube == 0.0 || square <= self.tube * self.tube + 4.0 * margin;
        is_in_cube && beside + (c * q.z + d) * q.z + e <= 12.0 * margin && is_in_tube
    }
}

#[cfg(test)]
mod tests {
    use lumbre_math::DVec2;
    use lumbre_math::random::RandomStream;

    use super::*;
    use crate::{
        BilinearPatch, Capsule, Cone, Csg, Cuboid, Cylinder, Disk, Hyperboloid, Paraboloid, PlacedShape,
        Plane, Quadric, Ray, Shape, Sphere, Torus, Triangle,
    };

    fn point(random: &mut RandomStream) -> DVec3 {
        DVec3::new(random.next_f64(), random.next_f64(), random.next_f64()) * 2.0 - 1.0
    }

    /// One of every kind that is bounded, of sizes at random.
    fn shapes(random: &mut RandomStream) -> Vec<Shape> {
        let mut number = |low: f64, high: f64| low + (high - low) * random.next_f64();
        let (r, s, h) = (number(0.2, 2.0), number(0.2, 2.0), number(0.3, 3.0));
        let (low, turn) = (number(-1.0, 0.2), number(20.0, 360.0));
        let (c, a, b, p) = (point(random), point(random), point(random), point(random));
        let ball = Sphere::new(c, r).unwrap();
        let pipe = Cylinder::new(a, b, r, true).unwrap();
        vec![
            ball.into(),
            ball.partial(low * r, 0.7 * r, turn).unwrap().into(),
            Cuboid::new(a, b).unwrap().into(),
            Cuboid::new(a, DVec3::new(b.x, a.y, b.z)).unwrap().into(),
            pipe.into(),
            pipe.partial(turn).unwrap().into(),
            Cone::new(a, b, r, s, true).unwrap().into(),
            Cone::new(a, b, 0.0, s, false).unwrap().into(),
            Cone::nappe(a, b, 0.2 * turn, h, true).unwrap().into(),
            Capsule::new(a, b, r).unwrap().into(),
            Disk::new(a, b, r + s, r).unwrap().into(),
            Disk::new(a, b, r, 0.0).unwrap().partial(turn).unwrap().into(),
            Triangle::new(a, b, c).unwrap().into(),
            BilinearPatch::new(a, b, c, p).unwrap().into(),
            Torus::new(c, a, r + s, s).unwrap().into(),
            Torus::new(c, a, s, s).unwrap().into(),
            Torus::new(c, a, s, r + s).unwrap().into(),
            Paraboloid::new(r, low, h, turn).unwrap().into(),
            Paraboloid::new(r, 0.2 * h, h, turn).unwrap().into(),
            Hyperboloid::new(a, b, turn).unwrap().into(),
            Quadric::new([1.0, 2.0, 3.0, 0.1, 0.2, 0.3, 0.4, 0.5, 0.6, -r], None).unwrap().into(),
            Csg::leaf(PlacedShape::new(ball.into(), Transform::IDENTITY)).unwrap().into(),
        ]
    }

    #[test]
    fn a_hull_holds_every_point_of_its_shape_under_every_map() {
        let mut random = RandomStream::new(31);
        let (mut points, mut crossings) = (0, 0);
        for _ in 0..60 {
            for shape in shapes(&mut random) {
                let map = Transform::translate(point(&mut random))
                    * Transform::rotate(point(&mut random), 360.0 * random.next_f64()).unwrap()
                    * Transform::scale(point(&mut random) + 1.2).unwrap();
                let bounding_volume = shape
                    .bounding_volume()
                    .unwrap_or_else(|| panic!("no bounding volume of {shape:?}"))
                    .under(&map);
                let back = bounding_volume.axes.inverse();
                assert!(back.is_finite(), "{shape:?}");
                let check = |p: DVec3| {
                    let q = back * (map.point(p) - bounding_volume.center);
                    assert!(bounding_volume.holds(q, 1e-9), "{shape:?} at {p}, which is {q}");
                };
                for _ in 0..20 {
                    let u = DVec2::new(random.next_f64(), random.next_f64());
                    if let Some(sample) = shape.sample_area(u) {
                        check(sample.surface.point);
                        points += 1;
                    }
                }
                for _ in 0..20 {
                    let from = 4.0 * point(&mut random);
                    let ray = Ray::new(from, point(&mut random) - from);
                    if let Some(root) = shape.closest(&ray) {
                        check(ray.at(root.t));
                        crossings += 1;
                    }
                }
            }
        }
        assert!(points > 10_000 && crossings > 3_000, "{points} points, {crossings} crossings");
    }

    #[test]
    fn the_inside_of_a_solid_hull_is_the_inside_of_its_shape() {
        let mut random = RandomStream::new(32);
        let (mut inside, mut solid) = (0, 0);
        for _ in 0..60 {
            for shape in shapes(&mut random) {
                let bounding_volume = shape.bounding_volume().unwrap();
                assert!(shape.is_solid() || !bounding_volume.is_solid, "{shape:?}");
                for _ in 0..40 {
                    let q = 1.1 * point(&mut random);
                    let is_near_the_border =
                        bounding_volume.holds(q, 1e-9) != bounding_volume.holds(q, -1e-9);
                    if bounding_volume.is_solid && !is_near_the_border {
                        let is_inside = bounding_volume.holds(q, 0.0);
                        assert_eq!(
                            shape.contains(bounding_volume.center + bounding_volume.axes * q),
                            is_inside,
                            "{shape:?} at {q}"
                        );
                        inside += usize::from(is_inside);
                        solid += 1;
                    }
                }
            }
        }
        assert!(inside > 2_000 && solid - inside > 2_000, "{inside} of {solid}");
    }

    #[test]
    fn what_is_infinite_has_no_hull() {
        let plane = Plane::new(DVec3::ZERO, DVec3::Y).unwrap();
        let pipe = Cylinder::infinite(DVec3::ZERO, DVec3::Z, 1.5).unwrap();
        assert_eq!((Shape::from(plane).bounding_volume(), Shape::from(pipe).bounding_volume()), (None, None));
    }
}
