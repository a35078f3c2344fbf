//! The camera, and the ray that it sends through a point of the film.

use lumbre::description::{Camera, CameraKind, CameraView};
use lumbre::math::Elementary;
use lumbre::math::glam::{DMat4, DVec2, DVec4};
use lumbre::math::matrix::rows4;
use lumbre::{DVec3, ExplainedSample, Ray, Transform};

use super::document::{Section, Value};
use super::formula::Scope;
use super::texts::Texts;
use crate::language::filled;

/// The near and far planes of the projection matrix that is shown; rays have none.
const NEAR: f64 = 0.01;
const FAR: f64 = 1000.0;

/// A camera, and how it makes the ray of a sample.
pub(super) fn camera(
    camera: &Camera,
    (width, height): (u32, u32),
    (x, y): (u32, u32),
    sample: &ExplainedSample,
    texts: &Texts,
) -> Section {
    let mut section = Section::new("camera", texts.camera);
    let view = CameraView::new(camera, width, height);
    let place = view.placement(sample.ray.time);
    section.fact(texts.kind, kind(&camera.kind, texts));
    if let Some(name) = &camera.name {
        section.fact(texts.name, name.clone());
    }
    section.fact(texts.size, Value::Text(format!("{width} × {height}")));
    let mut scope = Scope::default();
    let eye = place.point(DVec3::ZERO);
    section.quantity(&mut scope, "E", texts.eye, "", eye);
    for (symbol, label, axis) in
        [("e₁", texts.right, DVec3::X), ("e₂", texts.up, DVec3::Y), ("e₃", texts.forward, DVec3::Z)]
    {
        section.quantity(&mut scope, symbol, label, "", place.vector(axis).normalize_or_zero());
    }
    let [u, v, w] = [DVec3::X, DVec3::Y, DVec3::Z].map(|axis| place.vector(axis));
    section.text(if u.cross(v).dot(w) > 0.0 { texts.frame_of_same_hand } else { texts.frame_of_other_hand });
    section.fact(texts.look_at, DMat4::from(*place.inverse_affine()));
    let projection = projection(&camera.kind, &view, (width, height));
    if let Some(matrix) = projection {
        let ends = [NEAR, FAR].map(super::numbers::exact);
        section.fact(filled(texts.projection, &[&ends[0], &ends[1]]), matrix);
    }
    film(&mut section, &view, &place, (x, y), sample, texts);
    if let Some(matrix) = projection {
        projected(&mut section, &matrix, &place, focus(&camera.kind), (width, height), &sample.ray, texts);
    }
    section
}

/// The distance from the eye along the camera's axis at which the rays of a pixel converge; 1 for a pinhole, where any
/// distance will do.
fn focus(kind: &CameraKind) -> f64 {
    match kind {
        CameraKind::Perspective { lens_radius, focal_distance, .. }
        | CameraKind::Orthographic { lens_radius, focal_distance }
            if *lens_radius > 0.0 =>
        {
            *focal_distance
        }
        _ => 1.0,
    }
}

/// Projects a point of the ray back to the picture.
fn projected(
    section: &mut Section,
    projection: &DMat4,
    place: &Transform,
    focus: f64,
    size: (u32, u32),
    ray: &Ray,
    texts: &Texts,
) {
    let along = place.inverse_vector(ray.direction).z;
    let t = (focus - place.inverse_point(ray.origin).z) / along;
    if !(along > 0.0 && t.is_finite()) {
        return;
    }
    let point = ray.at(t);
    let Back { in_camera, clip, on_film } = back(projection, place, size, point);
    let mut scope = Scope::default();
    scope.set_ray(["O", "D"], ray);
    section.text(texts.projected);
    section.quantity(&mut scope, "tₑ", texts.in_focus, "", t);
    section.quantity(&mut scope, "X", texts.point_of_ray, "O + tₑ·D", point);
    section.fact(texts.by_look_at, in_camera);
    section.fact(texts.by_projection, Value::Numbers(clip.to_array().to_vec()));
    section.fact(texts.by_division, clip.truncate() / clip.w);
    section.fact(texts.back_on_film, Value::Numbers(vec![on_film.x, on_film.y]));
}

/// The stages of a point's projection to the picture.
struct Back {
    in_camera: DVec3,
    clip: DVec4,
    /// In pixels from the upper left corner.
    on_film: DVec2,
}

fn back(projection: &DMat4, place: &Transform, (width, height): (u32, u32), point: DVec3) -> Back {
    let in_camera = place.inverse_point(point);
    let clip = *projection * in_camera.extend(1.0);
    let size = DVec2::new(f64::from(width), f64::from(height));
    let on_film = 0.5 * DVec2::new(clip.w + clip.x, clip.w - clip.y) / clip.w * size;
    Back { in_camera, clip, on_film }
}

fn kind(kind: &CameraKind, texts: &Texts) -> String {
    match kind {
        CameraKind::Perspective { fov, lens_radius, focal_distance } => {
            let fov = super::numbers::exact(*fov);
            let pinhole = filled(texts.perspective, &[&fov]);
            if *lens_radius > 0.0 {
                let lens = [lens_radius, focal_distance].map(|x| super::numbers::exact(*x));
                format!("{pinhole}, {}", filled(texts.lens, &[&lens[0], &lens[1]]))
            } else {
                pinhole
            }
        }
        CameraKind::Orthographic { .. } => texts.orthographic.to_owned(),
        CameraKind::Spherical { .. } => texts.spherical.to_owned(),
        CameraKind::Mesh(_) => texts.of_meshes.to_owned(),
        CameraKind::Realistic(lens) => {
            let mm = [lens.focal_length(), lens.film_distance(), lens.diagonal()];
            let mm = mm.map(|metres| super::numbers::exact((1e6 * metres).rounded() / 1e3));
            filled(texts.realistic, &[&mm[0], &mm[1], &mm[2]])
        }
    }
}

/// The projection matrix from camera space, z into the picture, to the cube [-1, 1]³ with y upwards; `None` for cameras
/// without such a matrix.
fn projection(kind: &CameraKind, view: &CameraView, (width, height): (u32, u32)) -> Option<DMat4> {
    // The screen is at a distance of 1; a file may shift it off the axis.
    let first = view.on_screen(DVec2::ZERO);
    let last = view.on_screen(DVec2::new(f64::from(width), f64::from(height)));
    let (left, top, right, bottom) = (first.x, first.y, last.x, last.y);
    let (x, y) = (2.0 / (right - left), 2.0 / (top - bottom));
    // Avoids -0.
    let (dx, dy) = (0.0 - (right + left) / (right - left), 0.0 - (top + bottom) / (top - bottom));
    let depth = FAR - NEAR;
    match kind {
        CameraKind::Perspective { .. } => Some(rows4(
            [
                [x, 0.0, dx, 0.0],
                [0.0, y, dy, 0.0],
                [0.0, 0.0, (FAR + NEAR) / depth, -2.0 * FAR * NEAR / depth],
                [0.0, 0.0, 1.0, 0.0],
            ]
            .concat()
            .try_into()
            .ok()?,
        )),
        CameraKind::Orthographic { .. } => Some(rows4(
            [
                [x, 0.0, 0.0, dx],
                [0.0, y, 0.0, dy],
                [0.0, 0.0, 2.0 / depth, -(FAR + NEAR) / depth],
                [0.0, 0.0, 0.0, 1.0],
            ]
            .concat()
            .try_into()
            .ok()?,
        )),
        CameraKind::Spherical { .. } | CameraKind::Realistic(_) | CameraKind::Mesh(_) => None,
    }
}

/// From the film point to the ray.
fn film(
    section: &mut Section,
    view: &CameraView,
    place: &Transform,
    (x, y): (u32, u32),
    sample: &ExplainedSample,
    texts: &Texts,
) {
    let mut scope = Scope::default();
    section.fact(texts.pixel, Value::Text(format!("({x}, {y})")));
    section.fact(texts.film_point, Value::Numbers(vec![sample.film.x, sample.film.y]));
    let on_screen = view.on_screen(sample.film);
    section.fact(texts.screen_point, Value::Numbers(vec![on_screen.x, on_screen.y]));
    if view.has_lens() {
        section.fact(texts.lens_point, Value::Numbers(vec![sample.lens.x, sample.lens.y]));
    }
    let direction = place.inverse_vector(sample.ray.direction);
    // Up to the screen, which is at a distance of 1.
    let towards = if direction.z > 0.0 { direction / direction.z } else { direction };
    section.quantity(&mut scope, "Dₑ", texts.direction_in_camera, "", towards);
    section.quantity(&mut scope, "D₀", texts.direction_turned, "", place.vector(towards));
    section.quantity(&mut scope, "O", texts.origin, "", sample.ray.origin);
    section.quantity(&mut scope, "D", texts.direction, "D₀/|D₀|", sample.ray.direction);
    section.fact(texts.range, Value::Intervals(vec![[sample.ray.t_min, sample.ray.t_max]]));
    if sample.ray.time != 0.0 {
        section.fact(texts.time, sample.ray.time);
    }
    section.text(texts.ray_is);
}

/// A ray that was given.
pub(super) fn given(ray: &Ray, texts: &Texts) -> Section {
    let mut section = Section::new("ray", texts.given_ray);
    let mut scope = Scope::default();
    section.quantity(&mut scope, "O", texts.origin, "", ray.origin);
    section.quantity(&mut scope, "D", texts.direction, "", ray.direction);
    section.quantity(&mut scope, "|D|", "", "√(D·D)", ray.direction.length());
    section.fact(texts.range, Value::Intervals(vec![[ray.t_min, ray.t_max]]));
    section.text(texts.ray_is);
    section
}

#[cfg(test)]
mod tests {
    use lumbre::SceneDesc;
    use lumbre::math::random::RandomStream;

    use super::*;

    /// A camera of either hand, of every kind that a matrix describes, on and off the axis, with and without a lens.
    fn cameras() -> Vec<SceneDesc> {
        let mut all = Vec::new();
        for hand in ["", "Scale -1 1 1 "] {
            for look in ["LookAt 1 2 -6  0 0.5 0  0 1 0", "LookAt 0 -5 1  0 0 1  0 0 1"] {
                for kind in [
                    r#""perspective" "float fov" 40"#,
                    r#""perspective" "float fov" 75 "float screenwindow" [-0.5 2 -1 0.25]"#,
                    r#""perspective" "float fov" 30 "float lensradius" 0.3 "float focaldistance" 4"#,
                    r#""orthographic" "float screenwindow" [-3 3 -2 2]"#,
                    r#""orthographic" "float screenwindow" [-1 5 -4 0] "float lensradius" 0.2 "float focaldistance" 7"#,
                ] {
                    let text = format!(
                        "{hand}{look} Camera {kind} Film \"rgb\" \"integer xresolution\" 90 \"integer yresolution\" 60 WorldBegin Shape \"sphere\""
                    );
                    let folder = std::env::temp_dir().join(format!(
                        "lumbre-camera-{}-{}",
                        std::process::id(),
                        all.len()
                    ));
                    std::fs::write(&folder, &text).expect("a file");
                    let path = folder.with_extension("pbrt");
                    std::fs::rename(&folder, &path).expect("a name");
                    let read = lumbre::describe(&[&path], &lumbre::ReadOptions::default());
                    std::fs::remove_file(&path).expect("it is there");
                    all.push(read.expect("a scene").0);
                }
            }
        }
        all
    }

    #[test]
    fn the_matrices_take_every_point_in_focus_to_its_pixel() {
        let mut random = RandomStream::new(3);
        let (mut points, mut hands) = (0, [0, 0]);
        for desc in cameras() {
            let camera = &desc.cameras[0];
            let (width, height) = (90, 60);
            let view = CameraView::new(camera, width, height);
            let projection = projection(&camera.kind, &view, (width, height)).expect("a matrix");
            let place = view.placement(0.0);
            hands[usize::from(place.is_mirror())] += 1;
            for _ in 0..50 {
                let film = DVec2::new(90.0 * random.next_f64(), 60.0 * random.next_f64());
                let lens = DVec2::new(random.next_f64(), random.next_f64());
                let ray = view.ray(film, lens, 0.0, 1.0).ray;
                let along = place.inverse_vector(ray.direction).z;
                let s = (focus(&camera.kind) - place.inverse_point(ray.origin).z) / along;
                let found = back(&projection, &place, (width, height), ray.at(s));
                assert!((found.on_film - film).length() < 1e-9, "{} for {film} of {camera:?}", found.on_film);
                // Between near and far it is in the cube.
                let depth = found.clip.z / found.clip.w;
                assert!((-1.0..=1.0).contains(&depth), "{depth}");
                // Without a lens, any other point of the ray will do.
                if !view.has_lens() {
                    let farther = back(&projection, &place, (width, height), ray.at(s + 11.0));
                    assert!((farther.on_film - film).length() < 1e-9, "{} for {film}", farther.on_film);
                }
                points += 1;
            }
        }
        assert_eq!((points, hands), (1000, [10, 10]));
    }
}
