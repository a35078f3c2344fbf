//! The automatic camera: a three-quarter view that frames everything, or a view of the given options.

use std::f64::consts::FRAC_PI_2;

use lumbre_geometry::Aabb;
use lumbre_math::{DAffine3, DMat3, DQuat, DVec2, DVec3, Elementary, Transform};

use crate::viewpoint::half_window;
use crate::{Camera, CameraKind, UpAxis, Viewpoint};

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
        UpAxis::Towards(up) => match up.try_normalize() {
            None => [DVec3::X, DVec3::Y, DVec3::Z],
            Some(up) if up.y < -1.0 + 1e-12 => [DVec3::X, up, -DVec3::Z],
            // The shortest turn from y up, which is how the axes of z up come about.
            Some(up) => {
                let turn = DQuat::from_rotation_arc(DVec3::Y, up);
                [turn * DVec3::X, up, turn * DVec3::Z]
            }
        },
    };
    let (sin, cos) = (std::f64::consts::TAU * turns).sine_cosine();
    [cos * right - sin * front, upward, cos * front + sin * right]
}

/// A visitor of points.
pub(crate) type Points<'p> = dyn Fn(&mut dyn FnMut(DVec3)) + 'p;

/// The requirements of a camera.
pub(crate) struct Framing<'a> {
    /// The up axis of the world.
    pub up: UpAxis,
    /// Whether x points left in pictures of the world with y up and z towards the viewer.
    pub is_left_handed: bool,
    /// Width over height of the picture.
    pub aspect: f64,
    /// The requested view.
    pub viewpoint: &'a Viewpoint,
    /// The fraction of a turn around the model; `None` for a still view.
    pub turns: Option<f64>,
}

/// A camera, and its rotation about the up axis from the usual place, as a fraction of a turn, as [`axes`] takes it.
pub(crate) struct Framed {
    pub camera: Camera,
    pub turns: f64,
}

/// The usual view of `points` for a picture of this aspect ratio.
pub(crate) fn still(points: &Points, up: UpAxis, aspect: f64) -> Camera {
    let viewpoint = &Viewpoint::default();
    Framing { up, is_left_handed: false, aspect, viewpoint, turns: None }.camera(points).camera
}

impl Framing<'_> {
    /// A camera that sees `points` as requested. Without a given position, it is the nearest one that has all points in
    /// its picture: from the front, the right and above, rotated by azimuth, elevation and turns. All fractions of a
    /// turn share one distance. Without points, it frames the cube [-1, 1]³.
    pub(crate) fn camera(&self, points: &Points) -> Framed {
        let asked = self.viewpoint;
        let bounds = usable_bounds(points);
        let target = asked.target.unwrap_or(bounds.center());
        let axes = self.axes();
        let usual = Direction::of(TOWARDS_CAMERA);
        let local = |v: DVec3| DVec3::new(v.dot(axes[0]), v.dot(axes[1]), v.dot(axes[2]));
        let from_target = asked.eye.map(|eye| eye - target);
        let start = match from_target {
            Some(offset) if 0.0 < offset.length() && offset.is_finite() => Direction::of(local(offset)),
            _ => usual,
        };
        let direction = Direction {
            azimuth: start.azimuth
                + asked.azimuth.to_radians()
                + std::f64::consts::TAU * self.turns.unwrap_or(0.0),
            elevation: (start.elevation + asked.elevation.to_radians()).clamp(-FRAC_PI_2, FRAC_PI_2),
        };
        let eye = Eye::new(axes, direction, self.aspect, asked.fov.unwrap_or(FOV));
        let corners = |visit: &mut dyn FnMut(DVec3)| crate::extent::corners(&bounds).for_each(visit);
        let circles = |visit: &mut dyn FnMut(DVec3)| outline(points, axes, target, visit);
        let visible: &Points = match self.turns {
            _ if !is_usable(&self::bounds(points)) => &corners,
            None => points,
            Some(_) => &circles,
        };
        let place = match from_target {
            Some(offset) => {
                Place { point: target - eye.forward * offset.length(), distance: offset.length() }
            }
            None if asked.orthographic => {
                let reach = eye.reach(visible, target);
                // As far in front of the nearest point as the size of everything.
                let middle = if asked.target.is_some() { DVec2::ZERO } else { reach.middle() };
                let size = bounds.size().length();
                let distance = if size > 0.0 { size } else { 1.0 } - reach.nearest;
                let point = target + middle.x * eye.x + middle.y * eye.y - distance * eye.forward;
                Place { point, distance }
            }
            None if asked.target.is_some() => eye.aimed(visible, target),
            None => eye.nearest(visible, bounds.center()),
        };
        let distance = if place.distance > 0.0 { place.distance } else { 1.0 };
        let (kind, screen_window) = if asked.orthographic {
            let aspect = half_window(self.usable_aspect());
            let half = eye.reach(visible, place.point).half() / aspect / FILL;
            let half = Some(half.max_element()).filter(|half| 0.0 < *half).unwrap_or(1.0) * aspect;
            let kind = CameraKind::Orthographic { lens_radius: 0.0, focal_distance: distance };
            (kind, Some([-half.x, half.x, -half.y, half.y]))
        } else {
            let fov = asked.fov.unwrap_or(FOV);
            (CameraKind::Perspective { fov, lens_radius: 0.0, focal_distance: distance }, None)
        };
        let placement =
            DAffine3::from_mat3_translation(DMat3::from_cols(eye.x, eye.y, eye.forward), place.point);
        let world_from_camera = Transform::from_affine(placement).unwrap_or_default();
        let mut camera = Camera { screen_window, ..Camera::new(kind, world_from_camera) };
        asked.magnify(&mut camera, self.usable_aspect());
        let turned = (direction.azimuth - usual.azimuth) / std::f64::consts::TAU;
        Framed { camera, turns: if self.is_left_handed { -turned } else { turned } }
    }

    /// The right, up and front directions of the picture.
    fn axes(&self) -> [DVec3; 3] {
        let [right, upward, front] = axes(self.up, 0.0);
        [if self.is_left_handed { -right } else { right }, upward, front]
    }

    fn usable_aspect(&self) -> f64 {
        if self.aspect > 0.0 && self.aspect.is_finite() { self.aspect } else { 1.0 }
    }
}

/// A direction by its angles in radians: the azimuth from the front to the right, the elevation upwards.
#[derive(Clone, Copy)]
struct Direction {
    azimuth: f64,
    elevation: f64,
}

impl Direction {
    /// From a vector to the right, up and to the front.
    fn of(v: DVec3) -> Self {
        Self { azimuth: v.x.angle_from(v.z), elevation: v.y.angle_from(v.x.hypotenuse(v.z)) }
    }
}

/// The circles around the up axis through `center` on which points go around: of each height the largest, as polygons
/// around them, and the lowest and the highest point.
fn outline(points: &Points, [right, upward, front]: [DVec3; 3], center: DVec3, visit: &mut dyn FnMut(DVec3)) {
    let bounds = bounds(points);
    // Of the corners of the box, as far along an axis of the world.
    let (mut low, mut high) = (f64::INFINITY, f64::NEG_INFINITY);
    crate::extent::corners(&bounds).for_each(|p| {
        let height = (p - center).dot(upward);
        (low, high) = (low.min(height), high.max(height));
    });
    let mut outline = [(f64::INFINITY, f64::NEG_INFINITY, 0.0_f64); HEIGHTS];
    points(&mut |p| {
        let p = p - center;
        let height = p.dot(upward);
        let share = if high > low { (height - low) / (high - low) } else { 0.0 };
        let at = &mut outline[((share * HEIGHTS as f64) as usize).min(HEIGHTS - 1)];
        *at = (at.0.min(height), at.1.max(height), at.2.max((p - height * upward).length()));
    });
    // A circumscribed polygon.
    let reach = 1.0 / (std::f64::consts::PI / AROUND as f64).cosine();
    for &(low, high, radius) in outline.iter().filter(|(low, high, _)| low <= high) {
        for i in 0..AROUND {
            let (sin, cos) = (std::f64::consts::TAU * i as f64 / AROUND as f64).sine_cosine();
            let across = center + reach * radius * (cos * right + sin * front);
            visit(across + low * upward);
            visit(across + high * upward);
        }
    }
}

fn bounds(points: &Points) -> Aabb {
    let mut bounds = Aabb::EMPTY;
    points(&mut |p| bounds = bounds.union(Aabb { min: p, max: p }));
    bounds
}

fn is_usable(bounds: &Aabb) -> bool {
    !bounds.is_empty() && bounds.min.is_finite() && bounds.max.is_finite()
}

/// The bounds of the points; those of the cube [-1, 1]³ if they have none.
fn usable_bounds(points: &Points) -> Aabb {
    let bounds = bounds(points);
    if is_usable(&bounds) { bounds } else { Aabb { min: -DVec3::ONE, max: DVec3::ONE } }
}

/// A camera's position, with the distance of what it is focused on.
struct Place {
    point: DVec3,
    distance: f64,
}

/// The extent of points to the left, right, bottom and top of an axis, and their least depth along it.
struct Reach {
    low: DVec2,
    high: DVec2,
    nearest: f64,
}

impl Reach {
    fn middle(&self) -> DVec2 {
        0.5 * (self.low + self.high)
    }

    /// Half the sides of the window that is centred on the axis and contains all points.
    fn half(&self) -> DVec2 {
        self.high.max(-self.low)
    }
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
    fn new([right, upward, front]: [DVec3; 3], direction: Direction, aspect: f64, fov: f64) -> Self {
        let (sin, cos) = direction.azimuth.sine_cosine();
        let (rise, run) = direction.elevation.sine_cosine();
        let horizontal = sin * right + cos * front;
        let towards = run * horizontal + rise * upward;
        // By the azimuth, so that they exist straight above, too.
        let x = cos * right - sin * front;
        let y = run * upward - rise * horizontal;
        let slope = FILL * (0.5 * fov.to_radians()).tangent();
        let aspect = if aspect > 0.0 && aspect.is_finite() { aspect } else { 1.0 };
        Self { x, y, forward: -towards, slopes: slope * half_window(aspect) }
    }

    /// The extent of points around the axis through `origin`.
    fn reach(&self, points: &Points, origin: DVec3) -> Reach {
        let mut reach = Reach { low: DVec2::INFINITY, high: DVec2::NEG_INFINITY, nearest: f64::INFINITY };
        points(&mut |p| {
            let p = p - origin;
            let at = DVec2::new(p.dot(self.x), p.dot(self.y));
            (reach.low, reach.high) = (reach.low.min(at), reach.high.max(at));
            reach.nearest = reach.nearest.min(p.dot(self.forward));
        });
        reach
    }

    /// The nearest place that sees all points and has `target` in the middle.
    fn aimed(&self, points: &Points, target: DVec3) -> Place {
        let mut distance: f64 = 0.0;
        points(&mut |p| {
            let p = p - target;
            let across = DVec2::new(p.dot(self.x), p.dot(self.y)).abs() / self.slopes;
            distance = distance.max(across.max_element() - p.dot(self.forward));
        });
        let distance = if distance > 0.0 { distance } else { 1.0 };
        Place { point: target - distance * self.forward, distance }
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

    /// The nearest place that sees all points, centred horizontally and vertically.
    ///
    /// A point (x, y, z) is left of the right side of a pyramid of slope s with its tip at (a, b, c) when x − s
    /// z ≤ a − s c, and right of the left side when −x − s z ≤ −a − s c. With R and L the greatest left-hand
    /// sides over all points, a = (R − L) / 2 and c ≤ −(R + L) / 2 s. In the looser of the two directions the
    /// camera is farther away than that, so the centre is found by iteration from there.
    fn nearest(&self, points: &Points, center: DVec3) -> Place {
        let mut most = [f64::NEG_INFINITY; 4];
        points(&mut |p: DVec3| {
            let p = p - center;
            let (x, y, z) = (p.dot(self.x), p.dot(self.y), p.dot(self.forward));
            let s = self.slopes;
            let sides = [x - s.x * z, -x - s.x * z, y - s.y * z, -y - s.y * z];
            most = std::array::from_fn(|i| most[i].max(sides[i]));
        });
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
        Place {
            point: center + middle.x * self.x + middle.y * self.y + depth * self.forward,
            distance: -depth,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::View;
    use crate::extent::corners;

    fn framed(points: &Points, up: UpAxis, aspect: f64, viewpoint: &Viewpoint) -> Camera {
        Framing { up, is_left_handed: false, aspect, viewpoint, turns: None }.camera(points).camera
    }

    fn turned(points: &Points, up: UpAxis, aspect: f64, turns: f64) -> Camera {
        let viewpoint = &Viewpoint::default();
        Framing { up, is_left_handed: false, aspect, viewpoint, turns: Some(turns) }.camera(points).camera
    }

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

    fn box_points() -> impl Fn(&mut dyn FnMut(DVec3)) {
        let bounds = Aabb { min: DVec3::new(-3.0, 2.0, 5.0), max: DVec3::new(4.0, 2.5, 9.0) };
        move |visit| corners(&bounds).for_each(visit)
    }

    const CENTER: DVec3 = DVec3::new(0.5, 2.25, 7.0);

    fn place(camera: &Camera) -> DVec3 {
        camera.world_from_camera.point(DVec3::ZERO)
    }

    fn towards(camera: &Camera) -> DVec3 {
        -camera.world_from_camera.vector(DVec3::Z)
    }

    #[test]
    fn azimuth_goes_right_and_elevation_up_in_degrees() {
        let points = box_points();
        let view = |azimuth, elevation| {
            let viewpoint = Viewpoint { azimuth, elevation, ..Viewpoint::default() };
            framed(&points, UpAxis::Y, 1.5, &viewpoint)
        };
        let usual = TOWARDS_CAMERA.normalize();
        assert!((towards(&view(0.0, 0.0)) - usual).length() < 1e-12);
        // A quarter of a turn about y: z to x, x to -z.
        let quarter = DVec3::new(usual.z, usual.y, -usual.x);
        assert!((towards(&view(90.0, 0.0)) - quarter).length() < 1e-12);
        assert!((towards(&view(450.0, 0.0)) - quarter).length() < 1e-12);
        let angle = |camera: &Camera| towards(camera).y.asin().to_degrees();
        let elevation = usual.y.asin().to_degrees();
        assert!((angle(&view(0.0, 25.0)) - elevation - 25.0).abs() < 1e-9);
        assert!((angle(&view(0.0, -50.0)) - elevation + 50.0).abs() < 1e-9);
        // Straight above the top of the picture still is to the back.
        let above = view(10.0, 500.0);
        assert!((towards(&above) - DVec3::Y).length() < 1e-9, "{}", towards(&above));
        let top = above.world_from_camera.vector(DVec3::Y);
        let back = -DVec3::new(usual.x, 0.0, usual.z).normalize();
        let (sin, cos) = 10_f64.to_radians().sin_cos();
        let back = DVec3::new(cos * back.x + sin * back.z, 0.0, cos * back.z - sin * back.x);
        assert!((top - back).length() < 1e-9, "{top} {back}");
    }

    #[test]
    fn framing_fills_the_picture_from_every_side() {
        let points = box_points();
        for (azimuth, elevation, fov) in
            [(90.0, 0.0, 30.0), (-130.0, 50.0, 12.0), (20.0, 90.0, 100.0), (5.0, -80.0, 50.0)]
        {
            for orthographic in [false, true] {
                for target in [None, Some(DVec3::new(2.0, 2.5, 6.0))] {
                    let viewpoint = Viewpoint {
                        azimuth,
                        elevation,
                        fov: Some(fov),
                        orthographic,
                        target,
                        ..Viewpoint::default()
                    };
                    let camera = framed(&points, UpAxis::Z, 1.5, &viewpoint);
                    let (width, height) = (300, 200);
                    let view = View::new(&camera, width, height);
                    let mut most: f64 = 0.0;
                    points(&mut |p| {
                        let local = camera.world_from_camera.inverse_point(p);
                        assert!(local.z > 0.0, "behind the camera");
                        let half = match camera.screen_window {
                            Some([_, x, _, y]) => DVec2::new(x, y) / local.z,
                            None => (0.5 * fov.to_radians()).tan() * DVec2::new(1.5, 1.0),
                        };
                        most = most.max((local.truncate() / local.z / half).abs().max_element());
                    });
                    assert!((most - FILL).abs() < 2e-3, "{viewpoint:?}: {most}");
                    if let Some(target) = target {
                        let middle = DVec2::new(150.0, 100.0);
                        let ray = view.ray(middle, DVec2::splat(0.5), 0.0, 1.0).ray;
                        let off = target - ray.origin;
                        assert!((off - off.dot(ray.direction) * ray.direction).length() < 1e-9);
                    }
                }
            }
        }
    }

    #[test]
    fn an_eye_looks_from_where_it_is_at_its_target() {
        let points = box_points();
        let eye = DVec3::new(-6.0, 4.0, 1.0);
        let look =
            |viewpoint: Viewpoint, up| framed(&points, up, 1.5, &Viewpoint { eye: Some(eye), ..viewpoint });
        let target = DVec3::new(1.0, 2.0, -3.0);
        for up in [UpAxis::Y, UpAxis::Z, UpAxis::Towards(DVec3::new(1.0, 2.0, 2.0))] {
            let camera = look(Viewpoint { target: Some(target), ..Viewpoint::default() }, up);
            assert!((place(&camera) - eye).length() < 1e-12);
            assert!((towards(&camera) - (eye - target).normalize()).length() < 1e-12);
            let [_, upward, _] = axes(up, 0.0);
            let x = camera.world_from_camera.vector(DVec3::X);
            assert!(
                x.dot(upward).abs() < 1e-12 && camera.world_from_camera.vector(DVec3::Y).dot(upward) > 0.0
            );
            // A right-handed world is not mirrored.
            assert!((x - -towards(&camera).cross(upward).normalize()).length() < 1e-12);
        }
        let at_everything = look(Viewpoint::default(), UpAxis::Y);
        assert!((towards(&at_everything) - (eye - CENTER).normalize()).length() < 1e-12);
        // It goes around what it looks at.
        let around =
            look(Viewpoint { target: Some(target), azimuth: 180.0, ..Viewpoint::default() }, UpAxis::Y);
        assert!((place(&around) - DVec3::new(8.0, 4.0, -7.0)).length() < 1e-9, "{}", place(&around));
        // Straight down, and at what it stands in.
        let down = look(Viewpoint { target: Some(eye - 3.0 * DVec3::Y), ..Viewpoint::default() }, UpAxis::Y);
        assert!((towards(&down) - DVec3::Y).length() < 1e-12 && place(&down).is_finite());
        let inside = look(Viewpoint { target: Some(eye), ..Viewpoint::default() }, UpAxis::Y);
        assert!((place(&inside) - eye).length() < 1e-12);
        assert!((towards(&inside) - TOWARDS_CAMERA.normalize()).length() < 1e-12);
    }

    #[test]
    fn a_left_handed_world_is_seen_in_its_mirror() {
        let points = box_points();
        let mirrored = |visit: &mut dyn FnMut(DVec3)| points(&mut |p| visit(p * DVec3::new(-1.0, 1.0, 1.0)));
        let viewpoint = Viewpoint { azimuth: 25.0, elevation: 10.0, ..Viewpoint::default() };
        let camera = |is_left_handed, points: &Points| {
            let turns = Some(0.125);
            Framing { up: UpAxis::Y, is_left_handed, aspect: 1.5, viewpoint: &viewpoint, turns }
                .camera(points)
        };
        let (right, left) = (camera(false, &points), camera(true, &mirrored));
        for v in [DVec3::ZERO, DVec3::X, DVec3::Y, DVec3::Z] {
            let expected = right.camera.world_from_camera.point(v) * DVec3::new(-1.0, 1.0, 1.0);
            assert!((left.camera.world_from_camera.point(v) - expected).length() < 1e-9);
        }
        assert!(
            (right.turns - (25.0 / 360.0 + 0.125)).abs() < 1e-12 && (right.turns + left.turns).abs() < 1e-12
        );
    }

    #[test]
    fn axes_of_any_up_are_those_of_y_and_z_where_they_are_these() {
        for (up, expected) in [
            (DVec3::Y, axes(UpAxis::Y, 0.1)),
            (3.0 * DVec3::Z, axes(UpAxis::Z, 0.1)),
            (DVec3::ZERO, axes(UpAxis::Y, 0.1)),
        ] {
            let found = axes(UpAxis::Towards(up), 0.1);
            assert!(found.iter().zip(expected).all(|(a, b)| (*a - b).length() < 1e-12), "{found:?}");
        }
        for up in [-DVec3::Y, DVec3::X, -DVec3::X, -DVec3::Z, DVec3::new(1.0, -2.0, 0.5)] {
            let [right, upward, front] = axes(UpAxis::Towards(up), 0.3);
            assert!((upward - up.normalize()).length() < 1e-12);
            assert!((right.cross(upward) - front).length() < 1e-12 && (front.length() - 1.0).abs() < 1e-12);
        }
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
