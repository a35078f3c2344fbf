//! A drawing of a ray, its hits, and the normals there.

use std::fmt::Write;

use lumbre::geometry::{Shape, Surface};
use lumbre::math::Frame;
use lumbre::{DVec2, DVec3, Ray, Transform};

/// The size of the drawing.
const WIDTH: f64 = 480.0;
const HEIGHT: f64 = 320.0;
const MARGIN: f64 = 24.0;
/// Lines across each surface in each direction, and points per line.
const LINES: u32 = 8;
const POINTS: u32 = 48;
/// Maximum parts of a shape: the faces of a box.
const PARTS: u32 = 6;

/// The contents of the drawing.
#[derive(Debug, Default)]
pub(super) struct Scenery {
    /// Lines on the surfaces, in the world.
    lines: Vec<Vec<DVec3>>,
    /// The number of lines of the first shape, which fills the drawing.
    of_first: usize,
    /// The middle of the first shape, if it has one.
    middle: Option<DVec3>,
}

impl Scenery {
    /// Adds the lines of constant u and v of a shape, mapped to the world, which has a hit at this surface.
    pub(super) fn add(&mut self, shape: &Shape, map: &Transform, met: Option<&Surface>) {
        let before = self.lines.len();
        if shape.bounds(&Transform::IDENTITY).is_some() {
            for part in 0..PARTS {
                self.lines.extend(lines_of(shape, part, map));
            }
        }
        if self.lines.len() == before {
            self.lines.extend(boxed(shape, map, met));
        }
        if before == 0 {
            self.of_first = self.lines.len();
            self.middle = match shape {
                Shape::Sphere(sphere) => Some(map.point(sphere.center())),
                Shape::Torus(torus) => Some(map.point(torus.center())),
                _ => None,
            };
        }
    }

    /// Whether there is anything to draw.
    pub(super) fn is_anything(&self) -> bool {
        !self.lines.is_empty()
    }
}

fn lines_of(shape: &Shape, part: u32, map: &Transform) -> Vec<Vec<DVec3>> {
    if let Shape::Triangle(_) = shape {
        // Its parameters are barycentric weights: the outline shows more.
        let corners = [DVec2::ZERO, DVec2::X, DVec2::Y, DVec2::ZERO];
        let points: Option<Vec<DVec3>> =
            corners.iter().map(|uv| Some(map.point(shape.surface_at(part, *uv)?.point))).collect();
        return points.into_iter().filter(|_| part == 0).collect();
    }
    let line = |fixed: f64, along_u: bool| -> Option<Vec<DVec3>> {
        let place = |i: u32| {
            let moving = f64::from(i) / f64::from(POINTS);
            let uv = if along_u { DVec2::new(moving, fixed) } else { DVec2::new(fixed, moving) };
            let Surface { point, .. } = shape.surface_at(part, uv)?;
            Some(map.point(point)).filter(|point| point.is_finite())
        };
        (0..=POINTS).map(place).collect()
    };
    let lines = (0..=LINES).flat_map(|i| {
        let fixed = f64::from(i) / f64::from(LINES);
        [line(fixed, true), line(fixed, false)]
    });
    lines.flatten().collect()
}

/// The edges of a shape's box; for an infinite shape, a square around its hit.
fn boxed(shape: &Shape, map: &Transform, met: Option<&Surface>) -> Vec<Vec<DVec3>> {
    if let Some(bounds) = shape.bounds(map) {
        let corner = |i: usize| {
            let pick = |axis: usize| if i >> axis & 1 == 0 { bounds.min[axis] } else { bounds.max[axis] };
            DVec3::new(pick(0), pick(1), pick(2))
        };
        let edges = (0..8)
            .flat_map(|i| (0..3).filter(move |axis| i >> axis & 1 == 0).map(move |axis| (i, i | 1 << axis)));
        return edges.map(|(from, to)| vec![corner(from), corner(to)]).collect();
    }
    let Some(met) = met else { return Vec::new() };
    let place = met.point;
    let size = place.length().max(1.0) * 0.5;
    let frame = Frame::from_z(met.normal);
    let corner = |x: f64, y: f64| place + size * (x * frame.x + y * frame.y);
    vec![vec![corner(-1.0, -1.0), corner(1.0, -1.0), corner(1.0, 1.0), corner(-1.0, 1.0), corner(-1.0, -1.0)]]
}

/// The drawing as SVG: the surfaces, the ray, and its hits with their normals. `path` continues from there.
pub(super) fn svg(
    scenery: &Scenery,
    ray: &Ray,
    hits: &[(DVec3, DVec3)],
    path: &[DVec3],
    up: DVec3,
    title: &str,
) -> String {
    let along = ray.direction.normalize_or(DVec3::Z);
    // From the side, and slightly from above and behind; for a vertical ray, from any side.
    let up = if along.dot(up).abs() < 0.95 { up } else { up.any_orthonormal_vector() };
    let side = along.cross(up).normalize_or(DVec3::X);
    let frame = Frame::from_two_or_any(0.8 * side + 0.35 * up - 0.3 * along, up)
        .unwrap_or_else(|| Frame::from_z(DVec3::Z));
    let flat = |p: DVec3| DVec2::new(p.dot(frame.x), -p.dot(frame.y));

    // The explained shape fills the drawing; shapes behind it, such as the ground, may extend beyond.
    let first_lines = &scenery.lines[..scenery.of_first];
    let first_hits = hits.iter().take(2).map(|(point, _)| *point);
    let things = first_lines.iter().flatten().copied().chain(first_hits);
    let mut low = DVec2::INFINITY;
    let mut high = DVec2::NEG_INFINITY;
    for p in things.map(flat) {
        (low, high) = (low.min(p), high.max(p));
    }
    if !(low.is_finite() && high.is_finite()) {
        (low, high) = (flat(ray.origin), flat(ray.at(1.0)));
        (low, high) = (low.min(high), low.max(high));
    }
    // The ray starts in the drawing, if necessary nearer than in the scene.
    let extent = (high - low).length().max(1e-9);
    // For a miss, the ray is drawn where it is nearest to the middle of the shape.
    let things = first_lines.iter().flatten().copied();
    let (sum, count) = things.fold((DVec3::ZERO, 0.0), |(sum, count), p| (sum + p, count + 1.0));
    let nearest = if count > 0.0 { (sum / count - ray.origin).dot(along).max(0.0) } else { 1.0 };
    let first = hits.first().map_or(ray.origin + nearest * along, |(point, _)| *point);
    let last = hits.iter().take(2).next_back().map_or(first, |(point, _)| *point);
    let from = (first - ray.origin).length().min(0.7 * extent);
    let (start, end) = (first - from * along, last + 0.25 * extent * along);
    for p in [start, end].map(flat) {
        (low, high) = (low.min(p), high.max(p));
    }
    let room = DVec2::new(WIDTH - 2.0 * MARGIN, HEIGHT - 2.0 * MARGIN);
    let scale = (room / (high - low).max(DVec2::splat(1e-9))).min_element();
    let middle = 0.5 * (low + high);
    let place = |p: DVec3| scale * (flat(p) - middle) + 0.5 * DVec2::new(WIDTH, HEIGHT);

    let mut out = format!(
        "<svg viewBox=\"0 0 {WIDTH} {HEIGHT}\" width=\"{WIDTH}\" height=\"{HEIGHT}\" role=\"img\" \
         xmlns=\"http://www.w3.org/2000/svg\"><title>{}</title>",
        super::formula::escaped(title)
    );
    let line = |points: &[DVec3], style: &str, out: &mut String| {
        let points: Vec<String> =
            points.iter().map(|p| place(*p)).map(|p| format!("{:.1},{:.1}", p.x, p.y)).collect();
        let _ = write!(out, "<polyline points=\"{}\" fill=\"none\" {style}/>", points.join(" "));
    };
    for points in &scenery.lines {
        line(points, "stroke=\"#7a8ca5\" stroke-width=\"0.8\" stroke-opacity=\"0.7\"", &mut out);
    }
    line(&[start, end], "stroke=\"#d9822b\" stroke-width=\"2\"", &mut out);
    let way: Vec<DVec3> = path.iter().copied().take(4).collect();
    if way.len() > 1 {
        line(&way, "stroke=\"#d9822b\" stroke-width=\"1.2\" stroke-dasharray=\"4 3\"", &mut out);
    }
    let label = |text: &str, at: DVec2, colour: &str, out: &mut String| {
        // Labels stay inside the drawing.
        let at = at.clamp(DVec2::new(2.0, 12.0), DVec2::new(WIDTH - 34.0, HEIGHT - 4.0));
        let _ = write!(
            out,
            "<text x=\"{:.1}\" y=\"{:.1}\" font-size=\"13\" font-family=\"serif\" font-style=\"italic\" fill=\"{colour}\">{text}</text>",
            at.x, at.y
        );
    };
    for (i, (point, normal)) in hits.iter().enumerate() {
        let tip = *point + (0.14 * extent) * *normal;
        line(&[*point, tip], "stroke=\"#2f9e62\" stroke-width=\"2\"", &mut out);
        let dot = place(*point);
        let _ = write!(out, "<circle cx=\"{:.1}\" cy=\"{:.1}\" r=\"3.5\" fill=\"#c0392b\"/>", dot.x, dot.y);
        if i < 2 {
            label(["t₁", "t₂"][i], dot + DVec2::new(6.0, 14.0), "#c0392b", &mut out);
            label("N", place(tip) + DVec2::new(3.0, -2.0), "#2f9e62", &mut out);
        }
    }
    if let Some(middle) = scenery.middle {
        let dot = place(middle);
        let _ = write!(out, "<circle cx=\"{:.1}\" cy=\"{:.1}\" r=\"2\" fill=\"#7a8ca5\"/>", dot.x, dot.y);
        label("C", dot + DVec2::new(5.0, -4.0), "#7a8ca5", &mut out);
    }
    if (start - ray.origin).length() <= 1e-9 * extent {
        let dot = place(start);
        let _ = write!(out, "<circle cx=\"{:.1}\" cy=\"{:.1}\" r=\"3\" fill=\"#d9822b\"/>", dot.x, dot.y);
        label("O", dot + DVec2::new(-12.0, 14.0), "#d9822b", &mut out);
    }
    label("O + t·D", place(start) + DVec2::new(4.0, -6.0), "#d9822b", &mut out);
    out.push_str("</svg>");
    out
}
