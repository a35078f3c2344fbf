//! F(t) along a ray as a picture, with its roots; or the intervals of t within several things.

use std::fmt::Write;

use lumbre::DVec2;

use super::along::{Along, definitions};
use super::formula::escaped;
use super::labels::{FONT_SIZE, Labels, Rect};
use super::numbers::{exact, short};
use super::sketch::{Crossing, HEIGHT, WIDTH, circle, clipped, polyline, written};

/// Where the picture has its axes.
const LEFT: f64 = 16.0;
const RIGHT: f64 = WIDTH - 16.0;
const TOP: f64 = 30.0;
const BOTTOM: f64 = HEIGHT - 34.0;
/// Parts of the curve.
const STEPS: u32 = 160;
/// What is left to the sides of the outermost crossings, as part of their distance.
const BESIDE: f64 = 0.4;
/// The ray's origin is in the picture where it is no farther than this many of their distances.
const ORIGIN: f64 = 2.0;

/// A picture, and what its slider needs.
#[derive(Clone, Debug)]
pub(super) struct Plot {
    pub(super) svg: String,
    /// The first and the last `t`.
    pub(super) range: [f64; 2],
    /// The formula of `F`, where it has one, and those of what stands in it alone.
    pub(super) formula: Option<String>,
    pub(super) definitions: Vec<String>,
    /// The pieces of the function: from where on, the scale and the start of its variable, and the coefficients, the
    /// constant first.
    pub(super) pieces: Vec<Vec<f64>>,
}

/// The `t` that are shown: all crossings, and where a line that has none comes nearest, with some room.
fn range(crossings: &[Crossing], nearest: Option<f64>) -> [f64; 2] {
    let [first, last] = match (ends(crossings), nearest) {
        ([first, last], _) if first <= last => [first, last],
        (_, Some(t)) => [t, t],
        _ => return [0.0, 1.0],
    };
    // One place alone has as much beside it as it is away from the origin.
    let size = last - first;
    let is_one = size <= 1e-9 * first.abs().max(last.abs());
    let size = match is_one {
        true if first == 0.0 => 1.0,
        true => first.abs(),
        false => size,
    };
    let (from, to) = (first - BESIDE * size, last + BESIDE * size);
    let reach = if is_one { 0.0 } else { ORIGIN * size };
    [
        if first > 0.0 && first <= reach { from.min(0.0) } else { from },
        if last < 0.0 && last >= -reach { to.max(0.0) } else { to },
    ]
}

/// The first and the last crossing.
fn ends(crossings: &[Crossing]) -> [f64; 2] {
    let places = crossings.iter().map(|crossing| crossing.t);
    places.fold([f64::INFINITY, f64::NEG_INFINITY], |[first, last], t| [first.min(t), last.max(t)])
}

/// The picture of a shape along a line, `nearest` the place where a line that misses it comes nearest.
pub(super) fn plot(along: &Along, crossings: &[Crossing], nearest: Option<f64>, title: &str) -> Plot {
    let [from, to] = range(crossings, nearest);
    let across = move |t: f64| LEFT + (t - from) / (to - from) * (RIGHT - LEFT);
    let mut out = format!(
        "<svg class=\"plot\" viewBox=\"0 0 {WIDTH} {HEIGHT}\" width=\"{WIDTH}\" height=\"{HEIGHT}\" role=\"group\" \
         aria-label=\"{title}\" xmlns=\"http://www.w3.org/2000/svg\" font-family=\"serif\" font-style=\"italic\" \
         font-size=\"{FONT_SIZE}\" text-anchor=\"middle\" stroke-linecap=\"round\" data-from=\"{}\" data-to=\"{}\" \
         data-left=\"{LEFT}\" data-right=\"{RIGHT}\" ",
        exact(from),
        exact(to),
        title = escaped(title)
    );
    match along {
        Along::Function { formula, pieces } => {
            function(&mut out, along, crossings, [from, to], &across);
            let pieces = pieces.iter().map(|piece| {
                let first = if piece.from.is_finite() { piece.from } else { from };
                [first, piece.scale, piece.start]
                    .into_iter()
                    .chain(piece.coefficients.iter().copied())
                    .collect()
            });
            let definitions = definitions(formula).iter().map(|text| (*text).to_owned()).collect();
            let formula = Some(format!("F(t) = {formula}"));
            Plot { svg: out, range: [from, to], formula, definitions, pieces: pieces.collect() }
        }
        Along::Intervals(rows) => {
            intervals(&mut out, rows, crossings, [from, to], &across);
            Plot { svg: out, range: [from, to], formula: None, definitions: Vec::new(), pieces: Vec::new() }
        }
    }
}

fn function(
    out: &mut String,
    along: &Along,
    crossings: &[Crossing],
    [from, to]: [f64; 2],
    across: &dyn Fn(f64) -> f64,
) {
    let at = |i: u32| from + (to - from) * f64::from(i) / f64::from(STEPS);
    let samples: Vec<(f64, f64)> = (0..=STEPS).filter_map(|i| Some((at(i), along.at(at(i))?))).collect();
    // The line of zero is in the picture.
    let low = samples.iter().fold(0.0_f64, |low, (_, f)| low.min(*f));
    let high = samples.iter().fold(0.0_f64, |high, (_, f)| high.max(*f));
    // Steep sides do not hide what is between the roots.
    let [first, last] = ends(crossings);
    let inner = samples.iter().filter(|(t, _)| first <= *t && *t <= last);
    let depth = inner.fold(0.0_f64, |most, (_, f)| most.max(f.abs()));
    let most = if first < last && depth > 0.0 { 4.0 * depth } else { f64::INFINITY };
    let (low, high) = (low.max(-most), high.min(most));
    let (low, high) = if low < high { (low, high) } else { (-1.0, 1.0) };
    let upward = |f: f64| BOTTOM - (f - low) / (high - low) * (BOTTOM - TOP);
    let zero = upward(0.0);
    // For the script: where F is 0, and where it is 1 above.
    let _ = write!(out, "data-zero=\"{zero}\" data-one=\"{}\">", (BOTTOM - TOP) / (high - low));

    let frame = Rect::new(DVec2::new(LEFT, TOP - 14.0), DVec2::new(RIGHT, BOTTOM + 14.0));
    let mut labels = Labels::new(Rect::new(DVec2::ONE, DVec2::new(WIDTH - 1.0, HEIGHT - 1.0)));
    let curve: Vec<DVec2> = samples.iter().map(|(t, f)| DVec2::new(across(*t), upward(*f))).collect();
    for run in clipped(&curve, &frame) {
        run.windows(2).for_each(|pair| labels.line([pair[0], pair[1]]));
        polyline(&run, " class=\"curve\" stroke=\"#5b7fb5\" stroke-width=\"2\"", out);
    }
    axes(out, &mut labels, zero, [from, to], across);
    let name = labels.place(
        "F(t)",
        DVec2::new(
            LEFT + 16.0,
            if curve.first().is_some_and(|p| p.y < 0.5 * (TOP + BOTTOM)) { BOTTOM } else { TOP },
        ),
    );
    let _ = write!(out, "<g class=\"name\" stroke=\"none\" fill=\"#5b7fb5\">{}</g>", written(&name));
    marks(out, &mut labels, crossings, zero, across);
    moving(out);
}

fn intervals(
    out: &mut String,
    rows: &[(String, Vec<[f64; 2]>)],
    crossings: &[Crossing],
    [from, to]: [f64; 2],
    across: &dyn Fn(f64) -> f64,
) {
    let height = (BOTTOM - TOP - 16.0) / rows.len().max(1) as f64;
    let middle = |row: usize| TOP + (row as f64 + 0.5) * height;
    let _ = write!(out, "data-zero=\"{BOTTOM}\">");
    let mut labels = Labels::new(Rect::new(DVec2::ONE, DVec2::new(WIDTH - 1.0, HEIGHT - 1.0)));
    // The names of the rows stand left of the bars.
    let bar = |t: f64| across(t.clamp(from, to));
    for (row, (name, pieces)) in rows.iter().enumerate() {
        let is_last = row + 1 == rows.len();
        let y = middle(row);
        let class = if is_last { "bar result" } else { "bar" };
        let colour = if is_last { "#c0392b" } else { "#5b7fb5" };
        let _ = write!(
            out,
            "<text class=\"name\" x=\"{}\" y=\"{:.1}\" text-anchor=\"start\" fill=\"#5b7fb5\">{}</text>",
            LEFT + 8.0,
            y - 0.24 * height - 3.0,
            escaped(name)
        );
        let _ = write!(out, "<g class=\"{class}\" stroke=\"{colour}\" fill=\"{colour}\">");
        for [begin, end] in pieces.iter().filter(|[begin, end]| from <= *end && *begin <= to) {
            let (left, right) = (bar(*begin), bar(*end));
            let _ = write!(
                out,
                "<rect x=\"{left:.1}\" y=\"{:.1}\" width=\"{:.1}\" height=\"{:.1}\" fill-opacity=\"0.35\"/>",
                y - 0.22 * height,
                (right - left).max(0.5),
                0.44 * height
            );
        }
        out.push_str("</g>");
        labels.keep_off(Rect::new(DVec2::new(LEFT, y - 0.5 * height), DVec2::new(RIGHT, y + 0.25 * height)));
    }
    axes(out, &mut labels, BOTTOM, [from, to], across);
    marks(out, &mut labels, crossings, BOTTOM, across);
    moving(out);
}

/// The axis of t, with its ends, and the place of the ray's origin on it.
fn axes(out: &mut String, labels: &mut Labels, zero: f64, [from, to]: [f64; 2], across: &dyn Fn(f64) -> f64) {
    let line = [DVec2::new(LEFT, zero), DVec2::new(RIGHT, zero)];
    labels.line(line);
    out.push_str("<g class=\"axis\" stroke=\"#7a8ca5\" fill=\"#7a8ca5\">");
    polyline(&line, " stroke-width=\"1\"", out);
    if from <= 0.0 && 0.0 <= to {
        let x = across(0.0);
        let tick = [DVec2::new(x, TOP - 8.0), DVec2::new(x, BOTTOM + 8.0)];
        labels.line(tick);
        polyline(&tick, " stroke-width=\"1\" stroke-dasharray=\"2 3\"", out);
        out.push_str(&written(&labels.place("t = 0", DVec2::new(x, BOTTOM + 8.0))));
    }
    out.push_str(&written(&labels.place("t", DVec2::new(RIGHT - 4.0, zero))));
    out.push_str("</g>");
}

/// The crossings on the axis, each with its number.
fn marks(
    out: &mut String,
    labels: &mut Labels,
    crossings: &[Crossing],
    zero: f64,
    across: &dyn Fn(f64) -> f64,
) {
    for crossing in crossings {
        let at = DVec2::new(across(crossing.t), zero);
        labels.keep_off(Rect::new(at - 4.0, at + 4.0));
    }
    for crossing in crossings {
        let at = DVec2::new(across(crossing.t), zero);
        let style = if crossing.is_hit { "" } else { " fill-opacity=\"0\"" };
        let number = short(crossing.t);
        let text = match &crossing.name.label {
            Some(label) if label.contains('=') => label.clone(),
            Some(label) => format!("{label} = {number}"),
            None => String::new(),
        };
        let label = if text.is_empty() { String::new() } else { written(&labels.place(&text, at)) };
        let _ = write!(
            out,
            "<g class=\"mark crossing\" data-mark=\"{}\" data-t=\"{}\" tabindex=\"0\" role=\"img\" aria-label=\"{}\" stroke=\"#c0392b\" \
             fill=\"#c0392b\">{}{label}</g>",
            escaped(&crossing.name.key),
            exact(crossing.t),
            escaped(if text.is_empty() { &number } else { &text }),
            circle(at, 4.0, style)
        );
    }
}

/// What the slider moves; without a script it is not seen.
fn moving(out: &mut String) {
    let _ = write!(
        out,
        "<g class=\"moving\" visibility=\"hidden\"><line y1=\"{TOP}\" y2=\"{BOTTOM}\"/><circle r=\"4.5\"/></g></svg>"
    );
}
