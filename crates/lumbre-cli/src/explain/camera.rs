//! The camera, and the ray that it sends through a point of the film.

use lumbre::description::{Camera, CameraKind, CameraView};
use lumbre::math::glam::{DMat4, DVec2};
use lumbre::math::projection::{orthographic, perspective};
use lumbre::{DVec3, ExplainedSample, Transform};

use super::document::{Section, Value};
use super::formula::Scope;
use super::texts::Texts;
use crate::language::filled;

/// Where the projection matrix that is told begins and ends; rays need neither.
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
        [("u", texts.right, DVec3::X), ("v", texts.up, DVec3::Y), ("w", texts.forward, DVec3::Z)]
    {
        section.quantity(&mut scope, symbol, label, "", place.vector(axis).normalize_or_zero());
    }
    section.text(texts.frame);
    section.fact(texts.look_at, DMat4::from(*place.inverse_affine()));
    if let Some((matrix, label)) = projection(&camera.kind, &view, (width, height), texts) {
        section.fact(label, matrix);
    }
    film(&mut section, &view, &place, (x, y), sample, texts);
    section
}

fn kind(kind: &CameraKind, texts: &Texts) -> String {
    match kind {
        CameraKind::Perspective { fov, lens_radius, focal_distance } => {
            let fov = super::document::exact(*fov);
            let pinhole = filled(texts.perspective, &[&fov]);
            if *lens_radius > 0.0 {
                let lens = [lens_radius, focal_distance].map(|x| super::document::exact(*x));
                format!("{pinhole}, {}", filled(texts.lens, &[&lens[0], &lens[1]]))
            } else {
                pinhole
            }
        }
        CameraKind::Orthographic { .. } => texts.orthographic.to_owned(),
        CameraKind::Spherical { .. } => texts.spherical.to_owned(),
        CameraKind::Realistic(lens) => {
            let mm = [lens.focal_length(), lens.film_distance(), lens.diagonal()];
            let mm = mm.map(|metres| super::document::exact((1e6 * metres).round() / 1e3));
            filled(texts.realistic, &[&mm[0], &mm[1], &mm[2]])
        }
    }
}

/// The projection matrix of a camera, in the manner of OpenGL.
fn projection(
    kind: &CameraKind,
    view: &CameraView,
    (width, height): (u32, u32),
    texts: &Texts,
) -> Option<(DMat4, String)> {
    let (low, high) =
        (view.on_screen(DVec2::ZERO), view.on_screen(DVec2::new(f64::from(width), f64::from(height))));
    let ends = [NEAR, FAR].map(super::document::exact);
    let label = filled(texts.projection, &[&ends[0], &ends[1]]);
    let matrix = match kind {
        CameraKind::Perspective { .. } => {
            // The screen is at a distance of 1, and symmetric unless the file shifts it.
            let is_centred = (low + high).length() <= 1e-9 * (low - high).length();
            let fovy = 2.0 * low.y.abs().atan().to_degrees();
            is_centred.then(|| perspective(fovy, (high.x - low.x) / (low.y - high.y), NEAR, FAR))??
        }
        CameraKind::Orthographic { .. } => orthographic(low.x, high.x, high.y, low.y, NEAR, FAR)?,
        CameraKind::Spherical { .. } | CameraKind::Realistic(_) => return None,
    };
    Some((matrix, label))
}

/// From the point of the film to the ray.
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
    // As far as the screen, which is at a distance of 1.
    let towards = if direction.z > 0.0 { direction / direction.z } else { direction };
    section.quantity(&mut scope, "d", texts.direction_in_camera, "", towards);
    section.quantity(&mut scope, "R", texts.direction_turned, "M d", place.vector(towards));
    section.quantity(&mut scope, "O", texts.origin, "", sample.ray.origin);
    section.quantity(&mut scope, "D", texts.direction, "R/|R|", sample.ray.direction);
    section.fact(texts.range, Value::Intervals(vec![[sample.ray.t_min, sample.ray.t_max]]));
    if sample.ray.time != 0.0 {
        section.fact(texts.time, sample.ray.time);
    }
    section.text(texts.ray_is);
}

/// A ray that was given.
pub(super) fn given(ray: &lumbre::Ray, texts: &Texts) -> Section {
    let mut section = Section::new("ray", texts.given_ray);
    let mut scope = Scope::default();
    section.quantity(&mut scope, "O", texts.origin, "", ray.origin);
    section.quantity(&mut scope, "D", texts.direction, "", ray.direction);
    section.quantity(&mut scope, "|D|", "", "√(D·D)", ray.direction.length());
    section.fact(texts.range, Value::Intervals(vec![[ray.t_min, ray.t_max]]));
    section.text(texts.ray_is);
    section
}
