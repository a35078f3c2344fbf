//! The automatic camera: a three-quarter view that frames everything.

use lumbre_geometry::Aabb;
use lumbre_math::{DAffine3, DMat3, DVec2, DVec3, Transform};

use crate::{Camera, CameraKind, UpAxis};

/// Full field of view along the shorter side of the picture, in degrees: a 45 mm lens on 36 by 24 mm film.
const FOV: f64 = 30.0;
/// The fraction of the picture filled by the model along its tighter side.
const FILL: f64 = 0.84;
/// The direction to the camera: to the right, up, and to the front.
const TOWARDS_CAMERA: DVec3 = DVec3::new(0.58, 0.40, 1.0);
/// The number of heights in the outline of a turning model.
const HEIGHTS: usize = 64;
/// Corners of the polygon around the circle of a turning point.
const AROUND: usize = 48;

/// The right, up and front axes of a world with this up axis, rotated about it by `turns`.
pub(crate) fn axes(up: UpAxis, turns: f64) -> [DVec3; 3] {
    let [right, upward, front] = match up {
        UpAxis::Y => [DVec3::X, DVec3::Y, DVec3::Z],
        UpAxis::Z => [DVec3::X, DVec3::Z, -DVec3::Y],
    };
    let (sin, cos) = (std::f64::consts::TAU * turns).sin_cos();
    [cos * right - sin * front, upward, cos * front + sin * right]
}

/// A visitor of points.
pub(crate) type Points<'p> = dyn Fn(&mut dyn FnMut(DVec3)) + 'p;

/// A view of `points` from the front, the right and above that fills a picture of this aspect ratio (width over
/// height); of the cube [-1, 1]³ if there are none.
pub(crate) fn still(points: &Points, up: UpAxis, aspect: f64) -> Camera {
    let eye = Eye::new(up, 0.0, aspect);
    eye.camera(points)
}

/// As [`still`], after rotating by `turns` about the centre of `points`; all rotations share one distance, from
/// which each is in view.
pub(crate) fn turned(points: &Points, up: UpAxis, aspect: f64, turns: f64) -> Camera {
    let eye = Eye::new(up, turns, aspect);
    let [_, upward, _] = axes(up, turns);
    let bounds = bounds(points);
    if bounds.is_empty() {
        return eye.camera(points);
    }
    let center = bounds.center();
    let (low, high) = ((bounds.min - center).dot(upward), (bounds.max - center).dot(upward));
    // The largest circle at each height, and the lowest and the highest point.
    let mut outline = [(f64::INFINITY, f64::NEG_INFINITY, 0.0_f64); HEIGHTS];
    points(&mut |p| {
        let p = p - center;
        let height = p.dot(upward);
        let share = if high > low { (height - low) / (high - low) } else { 0.0 };
        let at = &mut outline[((share * HEIGHTS as f64) as usize).min(HEIGHTS - 1)];
        *at = (at.0.min(height), at.1.max(height), at.2.max((p - height * upward).length()));
    });
    let circles = |visit: &mut dyn FnMut(DVec3)| {
        let [right, _, front] = axes(up, turns);
        // A circumscribed polygon.
        let reach = 1.0 / (std::f64::consts::PI / AROUND as f64).cos();
        for &(low, high, radius) in outline.iter().filter(|(low, high, _)| low <= high) {
            for i in 0..AROUND {
                let (sin, cos) = (std::f64::consts::TAU * i as f64 / AROUND as f64).sin_cos();
                let across = center + reach * radius * (cos * right + sin * front);
                visit(across + low * upward);
                visit(across + high * upward);
            }
        }
    };
    eye.camera(&circles)
}

fn bounds(points: &Points) -> Aabb {
    let mut bounds = Aabb::EMPTY;
    points(&mut |p| bounds = bounds.union(Aabb { min: p, max: p }));
    bounds
}

/// A camera's orientation, before its position is known.
struct Eye {
    x: DVec3,
    y: DVec3,
    forward: DVec3,
    /// The slopes of the sides of the viewing pyramid to be filled.
    slopes: DVec2,
}

impl Eye {
    fn new(up: UpAxis, turns: f64, aspect: f64) -> Self {
        let [right, upward, front] = axes(up, turns);
        let towards = TOWARDS_CAMERA.x * right + TOWARDS_CAMERA.y * upward + TOWARDS_CAMERA.z * front;
        let forward = -towards.normalize();
        // Meshes are right-handed.
        let x = forward.cross(upward).normalize();
        let slope = FILL * (0.5 * FOV.to_radians()).tan();
        let aspect = if aspect > 0.0 && aspect.is_finite() { aspect } else { 1.0 };
        let slopes =
            slope * if aspect > 1.0 { DVec2::new(aspect, 1.0) } else { DVec2::new(1.0, 1.0 / aspect) };
        Self { x, y: x.cross(forward), forward, slopes }
    }

    /// The approximate displacement of a camera that centres the points in its view, horizontally and
    /// vertically.
    fn off_middle(&self, points: &Points, center: DVec3, middle: DVec2, depth: f64) -> DVec2 {
        // The greatest slopes to the right, left, top and bottom, and the depths.
        let mut most = [(f64::NEG_INFINITY, 1.0); 4];
        points(&mut |p| {
            let p = p - center;
            let z = p.dot(self.forward) - depth;
            let at = (DVec2::new(p.dot(self.x), p.dot(self.y)) - middle) / z;
            for (most, slope) in most.iter_mut().zip([at.x, -at.x, at.y, -at.y]) {
                if slope > most.0 && z > 0.0 {
                    *most = (slope, z);
                }
            }
        });
        let move_by = |[(high, far), (low, other)]: [(f64, f64); 2]| (high - low) / (1.0 / far + 1.0 / other);
        let off = DVec2::new(move_by([most[0], most[1]]), move_by([most[2], most[3]]));
        if off.is_finite() { off } else { DVec2::ZERO }
    }

    /// The nearest camera that sees all points, centred horizontally and vertically.
    ///
    /// A point (x, y, z) is left of the right side of a pyramid of slope s with its tip at (a, b, c) when x − s
    /// z ≤ a − s c, and right of the left side when −x − s z ≤ −a − s c. With R and L the greatest left-hand
    /// sides over all points, a = (R − L) / 2 and c ≤ −(R + L) / 2 s. In the looser of the two directions the
    /// camera is farther away than that, so the centre is found by iteration from there.
    fn camera(&self, points: &Points) -> Camera {
        let bounds = bounds(points);
        let is_usable = !bounds.is_empty() && bounds.min.is_finite() && bounds.max.is_finite();
        let bounds = if is_usable { bounds } else { Aabb { min: -DVec3::ONE, max: DVec3::ONE } };
        let center = bounds.center();
        let mut most = [f64::NEG_INFINITY; 4];
        let mut see = |p: DVec3| {
            let p = p - center;
            let (x, y, z) = (p.dot(self.x), p.dot(self.y), p.dot(self.forward));
            let s = self.slopes;
            let sides = [x - s.x * z, -x - s.x * z, y - s.y * z, -y - s.y * z];
            most = std::array::from_fn(|i| most[i].max(sides[i]));
        };
        if is_usable {
            points(&mut see);
        } else {
            crate::extent::corners(&bounds).for_each(&mut see);
        }
        let [right, left, top, bottom] = most;
        let depth = (-(right + left) / (2.0 * self.slopes.x)).min(-(top + bottom) / (2.0 * self.slopes.y));
        // A single point is viewed from some distance.
        let depth = if depth < 0.0 { depth } else { -1.0 };
        let mut middle = 0.5 * DVec2::new(right - left, top - bottom);
        for _ in 0..4 {
            let off = self.off_middle(points, center, middle, depth);
            middle += off;
            if off.length() < 1e-4 * depth.abs() {
                break;
            }
        }
        let place = center + middle.x * self.x + middle.y * self.y + depth * self.forward;
        let placement =
            DAffine3::from_mat3_translation(DMat3::from_cols(self.x, self.y, self.forward), place);
        Camera {
            name: None,
            kind: CameraKind::Perspective { fov: FOV, lens_radius: 0.0, focal_distance: -depth },
            world_from_camera: Transform::from_affine(placement).unwrap_or_default(),
            motion: None,
            frame_aspect: None,
            screen_window: None,
            shutter_open: 0.0,
            shutter_close: 1.0,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::View;
    use crate::extent::corners;

    fn boxes() -> [Aabb; 4] {
        [
            Aabb { min: DVec3::new(-3.0, 2.0, 5.0), max: DVec3::new(4.0, 2.5, 9.0) },
            Aabb { min: DVec3::new(1e6, 0.0, -1e6), max: DVec3::new(1e6 + 3.0, 70.0, -1e6 + 0.5) },
            Aabb { min: DVec3::splat(-1e-3), max: DVec3::splat(2e-3) },
            Aabb { min: DVec3::new(2.0, 3.0, 4.0), max: DVec3::new(2.0, 3.0, 9.0) },
        ]
    }

    /// Where a point falls in the picture: from -1 to 1 both ways.
    fn on_screen(camera: &Camera, aspect: f64, p: DVec3) -> DVec2 {
        let local = camera.world_from_camera.inverse_point(p);
        assert!(local.z > 0.0, "behind the camera");
        let slope = (0.5 * FOV.to_radians()).tan();
        let half = if aspect > 1.0 { DVec2::new(aspect, 1.0) } else { DVec2::new(1.0, 1.0 / aspect) };
        local.truncate() / local.z / slope / half
    }

    #[test]
    fn the_whole_model_is_in_the_picture_of_any_aspect_and_fills_it() {
        for bounds in boxes() {
            for up in [UpAxis::Y, UpAxis::Z] {
                for aspect in [0.2, 0.75, 1.0, 1.5, 4.0] {
                    let points = |visit: &mut dyn FnMut(DVec3)| corners(&bounds).for_each(visit);
                    let camera = still(&points, up, aspect);
                    let seen: Vec<DVec2> = corners(&bounds).map(|p| on_screen(&camera, aspect, p)).collect();
                    let high = seen.iter().copied().fold(DVec2::NEG_INFINITY, DVec2::max);
                    let low = seen.iter().copied().fold(DVec2::INFINITY, DVec2::min);
                    let most = high.max(-low);
                    assert!((most.max_element() - FILL).abs() < 1e-6, "{bounds:?} {aspect}: {most}");
                    // As much room on both sides.
                    let off = (high + low).abs();
                    assert!(off.min_element() < 1e-6, "{bounds:?} {aspect}: {low} to {high}");
                    assert!(off.max_element() < 1e-3, "{bounds:?} {aspect}: {low} to {high}");
                }
            }
        }
    }

    #[test]
    fn a_turning_model_stays_in_the_picture_and_keeps_its_distance() {
        for bounds in boxes() {
            let points = |visit: &mut dyn FnMut(DVec3)| corners(&bounds).for_each(visit);
            let mut widest: f64 = 0.0;
            let mut distances = vec![];
            for frame in 0..24 {
                let camera = turned(&points, UpAxis::Y, 1.6, f64::from(frame) / 24.0);
                distances.push((camera.world_from_camera.point(DVec3::ZERO) - bounds.center()).length());
                for p in corners(&bounds) {
                    widest = widest.max(on_screen(&camera, 1.6, p).abs().max_element());
                }
            }
            assert!(0.5 * FILL < widest && widest <= FILL + 1e-6, "{bounds:?}: {widest}");
            let spread = distances.iter().fold(0.0_f64, |most, d| most.max((d / distances[0] - 1.0).abs()));
            assert!(spread < 1e-6, "{bounds:?}: {distances:?}");
        }
    }

    #[test]
    fn turning_goes_around_the_model_once() {
        let bounds = boxes()[0];
        let points = |visit: &mut dyn FnMut(DVec3)| corners(&bounds).for_each(visit);
        for up in [UpAxis::Y, UpAxis::Z] {
            let [_, upward, _] = axes(up, 0.0);
            let side = |turns| {
                let towards =
                    turned(&points, up, 1.5, turns).world_from_camera.point(DVec3::ZERO) - bounds.center();
                (towards - towards.dot(upward) * upward).normalize()
            };
            let start = side(0.0);
            assert!((side(0.5) + start).length() < 1e-9);
            assert!((side(1.0) - start).length() < 1e-9);
            // The camera goes to the right: what it sees turns to the left.
            assert!((side(0.25) - upward.cross(start)).length() < 1e-9, "{}", side(0.25));
        }
    }

    #[test]
    fn the_picture_of_a_right_handed_world_is_not_mirrored() {
        let bounds = Aabb { min: DVec3::splat(-2.0), max: DVec3::splat(3.0) };
        let points = |visit: &mut dyn FnMut(DVec3)| corners(&bounds).for_each(visit);
        let view = View::new(&still(&points, UpAxis::Y, 1.0), 200, 200);
        let direction = |x, y| view.ray(DVec2::new(x, y), DVec2::splat(0.5), 0.0, 1.0).ray.direction;
        let (left, right, top) = (direction(10.0, 100.0), direction(190.0, 100.0), direction(100.0, 10.0));
        assert!(left.cross(right).dot(top) < 0.0);
        assert!(top.y > right.y);
    }

    #[test]
    fn nothing_at_all_is_seen_too() {
        let camera = still(&|_| {}, UpAxis::Z, 1.25);
        assert!(camera.world_from_camera.point(DVec3::ZERO).is_finite());
        let point = DVec3::new(3.0, -4.0, 5.0);
        let camera = still(&|visit| visit(point), UpAxis::Z, 1.25);
        assert!((on_screen(&camera, 1.25, point)).length() < 1e-9);
    }
}
