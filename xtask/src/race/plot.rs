//! Lines as a picture (.svg) with logarithmic axes.

use std::fmt::Write;

/// A line of the plot, with its name.
#[derive(Debug)]
pub(crate) struct Line<'a> {
    pub(crate) name: &'a str,
    pub(crate) points: Vec<[f64; 2]>,
}

const WIDTH: f64 = 760.0;
const HEIGHT: f64 = 460.0;
const LEFT: f64 = 70.0;
const RIGHT: f64 = 540.0;
const TOP: f64 = 40.0;
const BOTTOM: f64 = 410.0;

/// Distinct for most who see colours otherwise: Okabe and Ito, "Color universal design", 2008.
const COLOURS: [&str; 8] =
    ["#d55e00", "#0072b2", "#56b4e9", "#009e73", "#cc79a7", "#e69f00", "#333333", "#999999"];

/// A logarithmic axis from one place of the picture to another.
struct Axis {
    /// The powers of ten at its ends.
    powers: [f64; 2],
    places: [f64; 2],
}

impl Axis {
    /// The whole powers of ten around all values, which are above zero.
    fn around(values: impl Iterator<Item = f64>, places: [f64; 2]) -> Self {
        let (low, high) =
            values.fold((f64::MAX, f64::MIN), |(low, high), x| (low.min(x.log10()), high.max(x.log10())));
        let low = low.floor();
        Self { powers: [low, high.ceil().max(low + 1.0)], places }
    }

    fn place(&self, value: f64) -> f64 {
        let part = (value.log10() - self.powers[0]) / (self.powers[1] - self.powers[0]);
        self.places[0] + part * (self.places[1] - self.places[0])
    }

    /// 1 to 9 times each power of ten, and the last power.
    fn ticks(&self) -> Vec<(f64, bool)> {
        let mut ticks = Vec::new();
        for power in self.powers[0] as i32..self.powers[1] as i32 {
            ticks.extend((1..10).map(|k| (f64::from(k) * 10.0_f64.powi(power), k == 1)));
        }
        ticks.push((10.0_f64.powi(self.powers[1] as i32), true));
        ticks
    }
}

/// The picture, with the names of its axes. Lines without points are left out; points that are not above zero too.
pub(crate) fn svg(title: &str, [across, up]: [&str; 2], lines: &[Line<'_>]) -> String {
    let shown = |line: &Line<'_>| -> Vec<[f64; 2]> {
        line.points.iter().copied().filter(|p| p.iter().all(|x| *x > 0.0)).collect()
    };
    let all: Vec<[f64; 2]> = lines.iter().flat_map(shown).collect();
    let mut out = format!(
        "<svg xmlns=\"http://www.w3.org/2000/svg\" width=\"{WIDTH}\" height=\"{HEIGHT}\" viewBox=\"0 0 {WIDTH} {HEIGHT}\" \
         font-family=\"sans-serif\" font-size=\"13\">\n<rect width=\"100%\" height=\"100%\" fill=\"white\"/>\n\
         <text x=\"{LEFT}\" y=\"24\" font-size=\"16\">{title}</text>\n"
    );
    if !all.is_empty() {
        let x = Axis::around(all.iter().map(|p| p[0]), [LEFT, RIGHT]);
        let y = Axis::around(all.iter().map(|p| p[1]), [BOTTOM, TOP]);
        for (value, whole) in x.ticks() {
            let at = x.place(value);
            let stroke = if whole { "#bbb" } else { "#eee" };
            let _ = writeln!(out, "<path d=\"M{at:.1} {TOP}V{BOTTOM}\" stroke=\"{stroke}\"/>");
            if whole {
                let below = BOTTOM + 18.0;
                let _ =
                    writeln!(out, "<text x=\"{at:.1}\" y=\"{below}\" text-anchor=\"middle\">{value}</text>");
            }
        }
        for (value, whole) in y.ticks() {
            let at = y.place(value);
            let stroke = if whole { "#bbb" } else { "#eee" };
            let _ = writeln!(out, "<path d=\"M{LEFT} {at:.1}H{RIGHT}\" stroke=\"{stroke}\"/>");
            if whole {
                let (before, middle) = (LEFT - 8.0, at + 4.0);
                let _ = writeln!(
                    out,
                    "<text x=\"{before}\" y=\"{middle:.1}\" text-anchor=\"end\">{value}</text>"
                );
            }
        }
        for (i, line) in lines.iter().enumerate() {
            let points = shown(line);
            if points.is_empty() {
                continue;
            }
            let colour = COLOURS[i % COLOURS.len()];
            let place = |p: &[f64; 2]| (x.place(p[0]), y.place(p[1]));
            let path: Vec<String> = points.iter().map(place).map(|(x, y)| format!("{x:.1} {y:.1}")).collect();
            let (thick, path) = (if i == 0 { 3 } else { 2 }, path.join("L"));
            let _ = writeln!(
                out,
                "<path d=\"M{path}\" fill=\"none\" stroke=\"{colour}\" stroke-width=\"{thick}\"/>"
            );
            for (x, y) in points.iter().map(place) {
                let _ = writeln!(out, "<circle cx=\"{x:.1}\" cy=\"{y:.1}\" r=\"4\" fill=\"{colour}\"/>");
            }
            let (swatch, text) = (TOP + 8.0 + 22.0 * i as f64, TOP + 13.0 + 22.0 * i as f64);
            let _ = writeln!(
                out,
                "<path d=\"M552 {swatch}h18\" stroke=\"{colour}\" stroke-width=\"4\"/><text x=\"576\" y=\"{text}\">{}</text>",
                line.name
            );
        }
    }
    let (middle, below) = (f64::midpoint(LEFT, RIGHT), BOTTOM + 38.0);
    let _ = writeln!(out, "<text x=\"{middle}\" y=\"{below}\" text-anchor=\"middle\">{across}</text>");
    let _ = writeln!(
        out,
        "<text transform=\"translate(16 {}) rotate(-90)\" text-anchor=\"middle\">{up}</text>\n</svg>",
        f64::midpoint(TOP, BOTTOM)
    );
    out
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_axis_is_logarithmic_between_powers_of_ten() {
        let axis = Axis::around([0.03, 7.0].into_iter(), [100.0, 400.0]);
        assert_eq!(axis.powers, [-2.0, 1.0]);
        for (value, place) in [(0.01, 100.0), (0.1, 200.0), (10.0_f64.sqrt(), 350.0), (10.0, 400.0)] {
            assert!((axis.place(value) - place).abs() < 1e-9, "{value} is at {}", axis.place(value));
        }
        assert_eq!(axis.ticks().len(), 28);
        // A single value, itself a power of ten, has an axis too.
        assert_eq!(Axis::around([10.0].into_iter(), [100.0, 400.0]).powers, [1.0, 2.0]);
    }

    #[test]
    fn a_plot_shows_a_mark_for_every_point_above_zero() {
        let points = vec![[0.5, 0.2], [2.0, 0.05], [0.0, 0.02]];
        let lines = [Line { name: "One", points }, Line { name: "None", points: Vec::new() }];
        let picture = svg("A scene", ["seconds", "error"], &lines);
        assert_eq!(picture.matches("<circle").count(), 2);
        assert!(picture.contains(">One<") && !picture.contains(">None<"));
    }
}
