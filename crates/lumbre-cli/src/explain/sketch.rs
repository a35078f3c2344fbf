//! A drawing of a ray, of a shape, and of the marks that its explanation names, in one space.

use std::fmt::Write;

use lumbre::geometry::{Leaf, Shape, Surface};
use lumbre::math::Frame;
use lumbre::{DVec2, DVec3, Ray, Transform};

use super::formula::escaped;
use super::labels::{FONT_SIZE, Label, Labels, Rect};

/// The size of the drawing.
pub(super) const WIDTH: f64 = 420.0;
pub(super) const HEIGHT: f64 = 310.0;
const MARGIN: f64 = 34.0;
/// Lines across each surface, in either direction, and points of each line.
const LINES: u32 = 8;
const POINTS: u32 = 48;
/// Maximum parts of a shape: the faces of a box.
const PARTS: u32 = 6;
/// A shape that is this many times as large as the ray is long on its way there is drawn near the crossing alone: a
/// flat one, and others.
const HUGE_FLAT: f64 = 4.0;
const HUGE: f64 = 40.0;
/// Of such a shape the square about the crossing whose half side is this part of the ray's way, with this many lines.
const LOCAL_PART: f64 = 0.45;
const LOCAL_LINES: u32 = 6;
/// The part of a ray that is dotted where its origin is farther away than drawn.
const DOTTED: f64 = 0.16;
/// Vertices of a path that are drawn.
const MAX_CORNERS: usize = 5;
/// The corner with the axes.
const TRIAD: f64 = 58.0;
const AXIS: f64 = 15.0;

/// A point of a surface, with the normal.
#[derive(Clone, Copy, Debug)]
pub(super) struct Place {
    point: DVec3,
    normal: DVec3,
}

/// What a mark is called: by programs, and in the drawing, where it has a label.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Name {
    pub(super) key: String,
    pub(super) label: Option<String>,
}

impl Name {
    pub(super) fn new(symbol: &str) -> Self {
        Self { key: symbol.to_owned(), label: Some(symbol.to_owned()) }
    }
}

/// A crossing of the line.
#[derive(Clone, Debug)]
pub(super) struct Crossing {
    pub(super) name: Name,
    pub(super) t: f64,
    pub(super) is_hit: bool,
    /// The normal there, and what it is called.
    pub(super) normal: Option<(DVec3, Name)>,
}

/// A radius, which is drawn in the direction in which it is seen best.
#[derive(Clone, Debug)]
pub(super) struct Radius {
    pub(super) name: Name,
    pub(super) center: DVec3,
    /// What it is perpendicular to.
    pub(super) axis: Option<DVec3>,
    /// How far from the centre it begins.
    pub(super) from: f64,
    pub(super) length: f64,
}

/// What is drawn, in one space.
#[derive(Clone, Debug)]
pub(super) struct Space {
    /// Lines on the surface.
    pub(super) lines: Vec<Vec<Place>>,
    /// Whether lines on the side that faces away are drawn fainter.
    pub(super) is_solid: bool,
    pub(super) ray: Ray,
    /// What is up in the world, seen from this space.
    pub(super) up: DVec3,
    /// The ray's origin, and the ray itself.
    pub(super) names: [Name; 2],
    pub(super) crossings: Vec<Crossing>,
    pub(super) points: Vec<(Name, DVec3)>,
    pub(super) radii: Vec<Radius>,
    /// Where a ray that misses the shape passes nearest, and the point of the shape there.
    pub(super) nearest: Option<(f64, Option<DVec3>)>,
    /// The vertices of the path that goes on from there.
    pub(super) path: Vec<DVec3>,
}

/// The lines of constant u and v of a shape under a map; near where it was met, of one that is infinite, or huge beside
/// the `reach` of the ray on its way there.
pub(super) fn lines(
    shape: &Shape,
    map: &Transform,
    met: Option<(DVec3, DVec3)>,
    reach: f64,
) -> Vec<Vec<Place>> {
    let is_flat =
        matches!(shape, Shape::Plane(_) | Shape::Disk(_) | Shape::Triangle(_) | Shape::BilinearPatch(_));
    let most = if is_flat { HUGE_FLAT } else { HUGE } * reach;
    let size = shape.bounds(map).map_or(f64::INFINITY, |bounds| (bounds.max - bounds.min).length());
    match met {
        Some((point, normal)) if size > most => local(shape, map, point, normal, LOCAL_PART * reach),
        _ => {
            let lines = outline(shape, map);
            if lines.is_empty() { boxed(shape, map) } else { lines }
        }
    }
}

fn outline(shape: &Shape, map: &Transform) -> Vec<Vec<Place>> {
    match shape {
        // Its parameters are weights: its outline says more.
        Shape::Triangle(triangle) => {
            let corners = triangle.corners().map(|corner| map.point(corner));
            let normal = (corners[1] - corners[0]).cross(corners[2] - corners[0]).normalize_or_zero();
            let round = [0, 1, 2, 0].map(|i: usize| Place { point: corners[i], normal });
            vec![round.to_vec()]
        }
        Shape::Csg(csg) => {
            let of_leaf = |leaf: &Leaf| match leaf {
                Leaf::Shape(placed) => outline(placed.shape(), &(*map * placed.world_from_object())),
                Leaf::Solid { .. } => Vec::new(),
            };
            csg.leaves().iter().flat_map(of_leaf).collect()
        }
        _ if shape.bounds(&Transform::IDENTITY).is_none() => Vec::new(),
        _ => (0..PARTS).flat_map(|part| lines_of_part(shape, part, map)).collect(),
    }
}

fn lines_of_part(shape: &Shape, part: u32, map: &Transform) -> Vec<Vec<Place>> {
    let line = |fixed: f64, along_u: bool| -> Option<Vec<Place>> {
        let place = |i: u32| {
            let moving = f64::from(i) / f64::from(POINTS);
            let uv = if along_u { DVec2::new(moving, fixed) } else { DVec2::new(fixed, moving) };
            let Surface { point, normal, .. } = shape.surface_at(part, uv)?;
            let place = Place { point: map.point(point), normal: map.normal(normal) };
            place.point.is_finite().then_some(place)
        };
        (0..=POINTS).map(place).collect()
    };
    // The faces of a box need no more than their middles.
    let lines = if matches!(shape, Shape::Cuboid(_)) { 2 } else { LINES };
    let lines = (0..=lines).flat_map(|i| {
        let fixed = f64::from(i) / f64::from(lines);
        [line(fixed, true), line(fixed, false)]
    });
    lines.flatten().collect()
}

/// A line without a surface.
pub(super) fn bare_line(points: impl Iterator<Item = DVec3>) -> Vec<Place> {
    points.map(|point| Place { point, normal: DVec3::ZERO }).collect()
}

/// The edges of a shape's box.
fn boxed(shape: &Shape, map: &Transform) -> Vec<Vec<Place>> {
    let Some(bounds) = shape.bounds(map) else { return Vec::new() };
    let corner = |i: usize| {
        let pick = |axis: usize| if i >> axis & 1 == 0 { bounds.min[axis] } else { bounds.max[axis] };
        Place { point: DVec3::new(pick(0), pick(1), pick(2)), normal: DVec3::ZERO }
    };
    let edges = (0..8)
        .flat_map(|i| (0..3).filter(move |axis| i >> axis & 1 == 0).map(move |axis| (i, i | 1 << axis)));
    edges.map(|(from, to)| vec![corner(from), corner(to)]).collect()
}

/// A grid in the tangent plane about a point, as far as a flat shape reaches.
fn local(shape: &Shape, map: &Transform, point: DVec3, normal: DVec3, size: f64) -> Vec<Vec<Place>> {
    let frame = Frame::from_z(normal);
    let at = |i: u32, n: u32| size * (2.0 * f64::from(i) / f64::from(n) - 1.0);
    let is_there = |p: DVec3| match shape {
        Shape::Disk(_) | Shape::Triangle(_) => shape
            .closest_point(map, p)
            .is_ok_and(|nearest| nearest.distance <= 1e-9 * (size + point.length())),
        _ => true,
    };
    let line = |fixed: f64, along_x: bool| -> Vec<Vec<Place>> {
        let mut runs = vec![Vec::new()];
        for i in 0..=POINTS {
            let (x, y) = if along_x { (at(i, POINTS), fixed) } else { (fixed, at(i, POINTS)) };
            let point = point + x * frame.x + y * frame.y;
            if is_there(point) {
                if let Some(run) = runs.last_mut() {
                    run.push(Place { point, normal });
                }
            } else {
                runs.push(Vec::new());
            }
        }
        runs.into_iter().filter(|run| run.len() > 1).collect()
    };
    let lines = (0..=LOCAL_LINES).flat_map(|i| {
        let fixed = at(i, LOCAL_LINES);
        line(fixed, true).into_iter().chain(line(fixed, false))
    });
    lines.collect()
}

/// From where a space is looked at, orthographically: from the side of the ray, and a little from above and behind.
/// What is up points up.
#[derive(Debug)]
struct Eye {
    frame: Frame,
}

impl Eye {
    fn new(along: DVec3, up: DVec3) -> Self {
        let up = up.normalize_or(DVec3::Y);
        // A ray that goes up or down is seen from anywhere around it.
        let level = along - along.dot(up) * up;
        let level = if level.length() > 0.05 { level.normalize() } else { up.any_orthonormal_vector() };
        let side = level.cross(up);
        let frame = Frame::from_two_or_any(0.8 * side + 0.35 * up - 0.3 * level, up);
        Self { frame: frame.unwrap_or_else(|| Frame::from_z(DVec3::Z)) }
    }

    /// To the right and downwards.
    fn flat(&self, p: DVec3) -> DVec2 {
        DVec2::new(p.dot(self.frame.x), -p.dot(self.frame.y))
    }

    fn faces(&self, normal: DVec3) -> bool {
        normal.dot(self.frame.z) >= 0.0
    }

    /// The direction perpendicular to an axis in which a length is seen best.
    fn across(&self, axis: Option<DVec3>) -> DVec3 {
        let Frame { x, y, z } = self.frame;
        let direction = match axis {
            None => y - 0.6 * x,
            Some(axis) => axis.cross(z),
        };
        let direction = direction.normalize_or(y);
        if direction.dot(y - 0.1 * x) < 0.0 { -direction } else { direction }
    }
}

/// What part of the line is drawn.
struct Seen {
    from: f64,
    to: f64,
    /// Whether the ray's origin is in the drawing.
    has_origin: bool,
}

/// The drawing as SVG.
pub(super) fn svg(space: &Space, title: &str) -> String {
    let ray = &space.ray;
    let speed = ray.direction.length();
    let eye = Eye::new(ray.direction / speed, space.up);
    // What is explained fills the picture.
    let (mut low, mut high) = (DVec3::INFINITY, DVec3::NEG_INFINITY);
    for place in space.lines.iter().flatten() {
        (low, high) = (low.min(place.point), high.max(place.point));
    }
    let (middle, size) = (0.5 * (low + high), (high - low).length());
    let is_near = |p: DVec3| !size.is_finite() || (p - middle).length() <= 1.5 * size;
    let radii: Vec<(&Name, [DVec3; 2])> = space
        .radii
        .iter()
        .map(|radius| {
            let towards = eye.across(radius.axis);
            let from = radius.center + radius.from * towards;
            (&radius.name, [from, from + radius.length * towards])
        })
        // Of a shape of which only a part is drawn, the radius is not.
        .filter(|(_, ends)| ends.iter().all(|p| is_near(*p)))
        .collect();
    let near: Vec<&Crossing> =
        space.crossings.iter().filter(|crossing| is_near(ray.at(crossing.t))).collect();
    let mut shown = Extent::default();
    space.lines.iter().flatten().for_each(|place| shown.add(eye.flat(place.point)));
    radii.iter().flat_map(|(_, ends)| ends).for_each(|p| shown.add(eye.flat(*p)));
    near.iter().for_each(|crossing| shown.add(eye.flat(ray.at(crossing.t))));
    if let Some((t, _)) = space.nearest {
        shown.add(eye.flat(ray.at(t)));
    }
    let Seen { from, to, has_origin } = seen(space, &near, shown.size() / speed);
    shown.add(eye.flat(ray.at(from)));
    shown.add(eye.flat(ray.at(to)));
    let room = DVec2::new(WIDTH - 2.0 * MARGIN, HEIGHT - 2.0 * MARGIN);
    let scale = (room / (shown.high - shown.low).max(DVec2::splat(1e-9 * shown.size()))).min_element();
    let center = 0.5 * (shown.low + shown.high);
    let place = |p: DVec3| scale * (eye.flat(p) - center) + 0.5 * DVec2::new(WIDTH, HEIGHT);

    let mut drawing = Drawing::new();
    for line in &space.lines {
        drawing.surface(line, &place, |place| !space.is_solid || eye.faces(place.normal));
    }
    let path: Vec<DVec2> = space.path.iter().take(MAX_CORNERS).map(|p| place(*p)).collect();
    drawing.path(&path);
    drawing.ray(space, [from, to], has_origin, &place);
    for (name, ends) in &radii {
        drawing.radius(name, ends.map(place));
    }
    if let Some((t, Some(point))) = space.nearest {
        drawing.nearest([place(ray.at(t)), place(point)]);
    }
    for (name, point) in &space.points {
        drawing.point(name, place(*point));
    }
    let arrow = 0.14 * shown.size();
    for crossing in &near {
        let p = ray.at(crossing.t);
        drawing.crossing(
            crossing,
            place(p),
            crossing.normal.as_ref().map(|(normal, _)| place(p + arrow * *normal)),
        );
    }
    drawing.triad(&eye);
    // The point at t, for the slider: it is on a straight line.
    let (start, step) = (place(ray.origin), place(ray.origin + ray.direction) - place(ray.origin));
    // What is dotted is not to scale.
    let first = if has_origin { f64::NEG_INFINITY } else { from + DOTTED * (to - from) };
    let zero = place(DVec3::ZERO);
    let view = [zero].into_iter().chain(DVec3::AXES.map(|axis| scale * eye.flat(axis)));
    let view: Vec<String> = view.map(|p| format!("{} {}", p.x, p.y)).collect();
    drawing.finish(title, [start, step], first, &view.join(" "))
}

/// Grows by what is shown.
struct Extent {
    low: DVec2,
    high: DVec2,
}

impl Default for Extent {
    fn default() -> Self {
        Self { low: DVec2::INFINITY, high: DVec2::NEG_INFINITY }
    }
}

impl Extent {
    fn add(&mut self, p: DVec2) {
        if p.is_finite() {
            (self.low, self.high) = (self.low.min(p), self.high.max(p));
        }
    }

    /// The diagonal; 1 of a point or of nothing.
    fn size(&self) -> f64 {
        let size = (self.high - self.low).length();
        if size.is_finite() && size > 0.0 { size } else { 1.0 }
    }
}

/// What of the line is drawn: from a little before the first crossing to a little after the last, and the ray's origin
/// where that is not far away. `unit` is the `t` that is as long as the picture.
fn seen(space: &Space, near: &[&Crossing], unit: f64) -> Seen {
    let places = near.iter().map(|crossing| crossing.t).chain(space.nearest.map(|(t, _)| t));
    let (first, last) =
        places.fold((f64::INFINITY, f64::NEG_INFINITY), |(first, last), t| (first.min(t), last.max(t)));
    let (first, last) = if first <= last { (first, last) } else { (0.0, unit) };
    let has_origin = first - 1.3 * unit <= 0.0 && 0.0 <= last + 1.3 * unit;
    if has_origin {
        let from = if first < 0.0 { first - 0.15 * unit } else { 0.0 };
        Seen { from, to: last.max(0.0) + 0.35 * unit, has_origin }
    } else {
        Seen { from: first - 0.5 * unit, to: last + 0.35 * unit, has_origin }
    }
}

/// A label that is still to be put in its place.
struct Wanted {
    /// In which of the marks it stands.
    mark: usize,
    text: String,
    anchor: DVec2,
    /// Those of lower rank are placed first.
    rank: u32,
}

/// A mark: what is drawn of it, without its label.
struct Mark {
    key: String,
    class: &'static str,
    body: String,
}

/// A drawing in the making.
struct Drawing {
    frame: Rect,
    labels: Labels,
    far: String,
    front: String,
    below: String,
    marks: Vec<Mark>,
    wanted: Vec<Wanted>,
    triad: String,
    /// All segments, for what looks for free room.
    segments: Vec<[DVec2; 2]>,
}

impl Drawing {
    fn new() -> Self {
        let frame = Rect::new(DVec2::ONE, DVec2::new(WIDTH - 1.0, HEIGHT - 1.0));
        Self {
            frame,
            labels: Labels::new(frame),
            far: String::new(),
            front: String::new(),
            below: String::new(),
            marks: Vec::new(),
            wanted: Vec::new(),
            triad: String::new(),
            segments: Vec::new(),
        }
    }

    /// A line on the surface, in runs that face the eye or do not.
    fn surface(&mut self, line: &[Place], place: &dyn Fn(DVec3) -> DVec2, is_front: impl Fn(&Place) -> bool) {
        let mut at = 0;
        while at + 1 < line.len() {
            let faces = is_front(&line[at]);
            let mut end = at + 1;
            while end + 1 < line.len() && is_front(&line[end]) == faces {
                end += 1;
            }
            let points: Vec<DVec2> = line[at..=end].iter().map(|it| place(it.point)).collect();
            self.segments.extend(points.windows(2).map(|pair| [pair[0], pair[1]]));
            self.labels.surface_line(&points);
            let runs = clipped(&points, &self.frame);
            let out = if faces { &mut self.front } else { &mut self.far };
            runs.iter().for_each(|run| polyline(run, "", out));
            at = end;
        }
    }

    fn hard(&mut self, segment: [DVec2; 2]) {
        self.segments.push(segment);
        if let Some(inside) = self.frame.clip(segment) {
            self.labels.line(inside);
        }
    }

    fn path(&mut self, points: &[DVec2]) {
        for pair in points.windows(2) {
            self.hard([pair[0], pair[1]]);
        }
        for run in clipped(points, &self.frame) {
            polyline(
                &run,
                " class=\"path\" stroke=\"#d9822b\" stroke-width=\"1.2\" stroke-dasharray=\"4 3\"",
                &mut self.below,
            );
        }
    }

    fn add(&mut self, name: &Name, class: &'static str, body: String, anchor: DVec2, rank: u32) {
        if let Some(label) = &name.label
            && self.frame.contains(anchor)
        {
            self.wanted.push(Wanted { mark: self.marks.len(), text: label.clone(), anchor, rank });
        }
        self.marks.push(Mark { key: name.key.clone(), class, body });
    }

    /// The line, and on it the ray, with its origin.
    fn ray(&mut self, space: &Space, [from, to]: [f64; 2], has_origin: bool, place: &dyn Fn(DVec3) -> DVec2) {
        let ray = &space.ray;
        let [origin, along] = &space.names;
        let (begin, end) = (from.max(ray.t_min.max(0.0)).min(to), to.min(ray.t_max).max(from));
        let [a, b, c, d] = [from, begin, end, to].map(|t| place(ray.at(t)));
        self.hard([a, d]);
        let mut body = String::new();
        for outside in [[a, b], [c, d]] {
            if (outside[1] - outside[0]).length() > 0.5 {
                polyline(&outside, " class=\"line\" stroke-width=\"1\" stroke-dasharray=\"2 4\"", &mut body);
            }
        }
        let is_forward = begin < end;
        if is_forward {
            // From where it begins farther away than it is drawn, it is dotted.
            let broken = if has_origin { b } else { b + DOTTED * (c - b) };
            if !has_origin {
                polyline(
                    &[b, broken],
                    " class=\"far\" stroke-width=\"2\" stroke-dasharray=\"2 3\"",
                    &mut body,
                );
            }
            polyline(&[broken, c], " stroke-width=\"2\"", &mut body);
            let back = (b - c).normalize_or(DVec2::NEG_X);
            let wing = DVec2::new(-back.y, back.x);
            let head = [c + 9.0 * back + 4.0 * wing, c, c + 9.0 * back - 4.0 * wing];
            head.windows(2).for_each(|pair| self.hard([pair[0], pair[1]]));
            polyline(&head, " stroke-width=\"2\"", &mut body);
        }
        self.add(along, "ray", body, c + 0.04 * (a - c), 5);
        let at = if has_origin {
            place(ray.origin)
        } else if from > 0.0 {
            a
        } else {
            d
        };
        let dot = if has_origin { circle(at, 3.2, "") } else { circle(at, 3.2, " fill-opacity=\"0\"") };
        self.add(origin, "origin", dot, at, 0);
        self.hard_dot(at);
    }

    fn hard_dot(&mut self, at: DVec2) {
        self.hard([at - DVec2::splat(3.0), at + DVec2::splat(3.0)]);
    }

    fn radius(&mut self, name: &Name, ends: [DVec2; 2]) {
        let Some(inside) = self.frame.clip(ends) else { return };
        self.hard(inside);
        let mut body = String::new();
        polyline(&inside, " stroke-width=\"1.6\"", &mut body);
        self.add(name, "radius", body, 0.5 * (inside[0] + inside[1]), 3);
    }

    /// From the ray to the point of the shape that it passes nearest.
    fn nearest(&mut self, ends: [DVec2; 2]) {
        let Some(inside) = self.frame.clip(ends) else { return };
        self.hard(inside);
        polyline(
            &inside,
            " class=\"gap\" stroke=\"#c0392b\" stroke-width=\"1.4\" stroke-dasharray=\"3 2\"",
            &mut self.below,
        );
    }

    fn point(&mut self, name: &Name, at: DVec2) {
        if self.frame.contains(at) {
            self.hard_dot(at);
            self.add(name, "point", circle(at, 2.6, ""), at, 2);
        }
    }

    fn crossing(&mut self, crossing: &Crossing, at: DVec2, tip: Option<DVec2>) {
        if !self.frame.contains(at) {
            return;
        }
        if let (Some(tip), Some((_, name))) =
            (tip.and_then(|tip| self.frame.clip([at, tip])), &crossing.normal)
        {
            self.hard(tip);
            let mut body = String::new();
            polyline(&tip, " stroke-width=\"2\"", &mut body);
            self.add(name, "normal", body, tip[1], 4);
        }
        self.hard_dot(at);
        let style = if crossing.is_hit { "" } else { " fill-opacity=\"0\"" };
        self.add(&crossing.name, "crossing", circle(at, 3.6, style), at, 1);
    }

    /// The axes of the space, in the emptiest corner.
    fn triad(&mut self, eye: &Eye) {
        let corners =
            [[0.0, HEIGHT - TRIAD], [WIDTH - TRIAD, HEIGHT - TRIAD], [0.0, 0.0], [WIDTH - TRIAD, 0.0]];
        let rects = corners.map(|[x, y]| Rect::new(DVec2::new(x, y), DVec2::new(x + TRIAD, y + TRIAD)));
        let crowd =
            |rect: &Rect| self.segments.iter().filter(|segment| rect.clip(**segment).is_some()).count();
        let Some(rect) = rects.into_iter().min_by_key(crowd) else { return };
        let middle = 0.5 * (rect.low + rect.high);
        for (axis, name) in DVec3::AXES.into_iter().zip(["x", "y", "z"]) {
            let tip = middle + AXIS * eye.flat(axis);
            let at = tip + 8.0 * eye.flat(axis).normalize_or(DVec2::X);
            let _ = write!(
                self.triad,
                "<line data-axis=\"{name}\" x1=\"{:.1}\" y1=\"{:.1}\" x2=\"{:.1}\" y2=\"{:.1}\"/>\
                 <text x=\"{:.1}\" y=\"{:.1}\" font-size=\"11\" stroke=\"none\">{name}</text>",
                middle.x,
                middle.y,
                tip.x,
                tip.y,
                at.x,
                at.y + 3.5
            );
        }
        self.labels.keep_off(rect);
    }

    /// `view` is where the origin of the space is seen, and by how much a unit along x, y and z moves that: for what is
    /// dragged.
    fn finish(mut self, title: &str, [start, step]: [DVec2; 2], first: f64, view: &str) -> String {
        self.wanted.sort_by_key(|wanted| wanted.rank);
        let mut placed: Vec<Option<Label>> = vec![None; self.marks.len()];
        for Wanted { mark, text, anchor, .. } in &self.wanted {
            placed[*mark] = Some(self.labels.place(text, *anchor));
        }
        let mut out = format!(
            "<svg class=\"sketch\" data-view=\"{view}\" viewBox=\"0 0 {WIDTH} {HEIGHT}\" width=\"{WIDTH}\" height=\"{HEIGHT}\" role=\"group\" \
             aria-label=\"{title}\" xmlns=\"http://www.w3.org/2000/svg\" font-family=\"serif\" font-style=\"italic\" \
             font-size=\"{FONT_SIZE}\" text-anchor=\"middle\" stroke-linecap=\"round\" stroke-linejoin=\"round\">",
            title = escaped(title)
        );
        for (class, opacity, lines) in [("surface back", 0.3, &self.far), ("surface", 0.75, &self.front)] {
            let _ = write!(
                out,
                "<g class=\"{class}\" fill=\"none\" stroke=\"#7a8ca5\" stroke-width=\"0.8\" stroke-opacity=\"{opacity}\">{lines}</g>"
            );
        }
        let _ = write!(out, "<g fill=\"none\">{}</g>", self.below);
        let _ = write!(out, "<g class=\"triad\" stroke=\"#7a8ca5\" fill=\"#7a8ca5\">{}</g>", self.triad);
        for (Mark { key, class, body }, label) in self.marks.iter().zip(&placed) {
            let colour = match *class {
                "ray" | "origin" => "#d9822b",
                "crossing" => "#c0392b",
                "normal" => "#2f9e62",
                _ => "#5b7fb5",
            };
            let text = label.as_ref().map(written).unwrap_or_default();
            let _ = write!(
                out,
                "<g class=\"mark {class}\" data-mark=\"{key}\" tabindex=\"0\" role=\"img\" aria-label=\"{name}\" stroke=\"{colour}\" \
                 fill=\"{colour}\">{body}{text}</g>",
                key = escaped(key),
                name = escaped(label.as_ref().map_or(key, |label| &label.text))
            );
        }
        // Without a script it is not seen.
        let _ = write!(
            out,
            "<circle class=\"moving\" data-start=\"{} {}\" data-step=\"{} {}\" data-first=\"{}\" r=\"4.5\" visibility=\"hidden\"/></svg>",
            start.x,
            start.y,
            step.x,
            step.y,
            first.max(f64::MIN)
        );
        out
    }
}

/// A label with its line, as SVG.
pub(super) fn written(label: &Label) -> String {
    let Label { text, rect, leader } = label;
    let mut out = String::new();
    if let Some([from, to]) = leader {
        polyline(&[*from, *to], " class=\"leader\" stroke-width=\"0.7\"", &mut out);
    }
    let _ = write!(
        out,
        "<text x=\"{:.1}\" y=\"{:.1}\" stroke=\"none\">{}</text>",
        0.5 * (rect.low.x + rect.high.x),
        rect.high.y - 0.26 * FONT_SIZE,
        escaped(text)
    );
    out
}

pub(super) fn circle(at: DVec2, radius: f64, style: &str) -> String {
    format!("<circle cx=\"{:.2}\" cy=\"{:.2}\" r=\"{radius}\"{style}/>", at.x, at.y)
}

pub(super) fn polyline(points: &[DVec2], style: &str, out: &mut String) {
    let points: Vec<String> = points.iter().map(|p| format!("{:.1},{:.1}", p.x, p.y)).collect();
    let _ = write!(out, "<polyline points=\"{}\" fill=\"none\"{style}/>", points.join(" "));
}

/// The pieces of a line of segments that are inside.
pub(super) fn clipped(points: &[DVec2], frame: &Rect) -> Vec<Vec<DVec2>> {
    let mut runs: Vec<Vec<DVec2>> = Vec::new();
    for pair in points.windows(2) {
        let Some([from, to]) = frame.clip([pair[0], pair[1]]) else { continue };
        match runs.last_mut() {
            Some(run) if run.last() == Some(&from) => run.push(to),
            _ => runs.push(vec![from, to]),
        }
    }
    runs
}
