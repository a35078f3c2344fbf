//! Where the labels of a drawing stand: beside what they name, clear of its lines and of each other.

use lumbre::DVec2;
use lumbre::math::direction_at;

/// The size of the letters, and the width that one of them takes at most.
pub(super) const FONT_SIZE: f64 = 15.0;
const LETTER: f64 = 8.6;
/// How far apart labels and lines are kept.
const GAP: f64 = 2.0;
/// Directions and distances in which a place is looked for.
const DIRECTIONS: u32 = 16;
const DISTANCES: [f64; 6] = [5.0, 10.0, 17.0, 26.0, 38.0, 54.0];
/// What it costs that a label lies over a line of the drawing, over one of the surface, or outside.
const OVER_LINE: f64 = 1e3;
const OVER_SURFACE: f64 = 1.5;
const OUTSIDE: f64 = 1e6;
/// Beyond this distance a thin line leads from a label to what it names.
const LEADER: f64 = 15.0;

/// An upright rectangle.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Rect {
    pub(super) low: DVec2,
    pub(super) high: DVec2,
}

impl Rect {
    pub(super) fn new(low: DVec2, high: DVec2) -> Self {
        Self { low, high }
    }

    fn grown(self, by: f64) -> Self {
        Self { low: self.low - by, high: self.high + by }
    }

    pub(super) fn contains(&self, p: DVec2) -> bool {
        p.cmpge(self.low).all() && p.cmple(self.high).all()
    }

    pub(super) fn overlaps(&self, other: &Self) -> bool {
        self.low.cmplt(other.high).all() && other.low.cmplt(self.high).all()
    }

    /// The part of a segment that is inside (Liang and Barsky, "A new concept and method for line clipping", 1984).
    pub(super) fn clip(&self, [from, to]: [DVec2; 2]) -> Option<[DVec2; 2]> {
        let along = to - from;
        let (mut enter, mut leave) = (0.0_f64, 1.0_f64);
        for axis in 0..2 {
            if along[axis] == 0.0 {
                if from[axis] < self.low[axis] || self.high[axis] < from[axis] {
                    return None;
                }
                continue;
            }
            let a = (self.low[axis] - from[axis]) / along[axis];
            let b = (self.high[axis] - from[axis]) / along[axis];
            enter = enter.max(a.min(b));
            leave = leave.min(a.max(b));
        }
        (enter <= leave).then(|| [from + enter * along, from + leave * along])
    }
}

/// A label in its place.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Label {
    pub(super) text: String,
    /// What it covers.
    pub(super) rect: Rect,
    /// From the label to what it names, where that is not beside it.
    pub(super) leader: Option<[DVec2; 2]>,
}

/// Puts labels into a drawing.
#[derive(Debug)]
pub(super) struct Labels {
    frame: Rect,
    /// Lines that no label may cover.
    lines: Vec<[DVec2; 2]>,
    /// Lines of surfaces, which a label covers where there is no other place.
    surface: Vec<[DVec2; 2]>,
    taken: Vec<Rect>,
}

impl Labels {
    pub(super) fn new(frame: Rect) -> Self {
        Self { frame, lines: Vec::new(), surface: Vec::new(), taken: Vec::new() }
    }

    pub(super) fn line(&mut self, segment: [DVec2; 2]) {
        self.lines.push(segment);
    }

    pub(super) fn surface_line(&mut self, points: &[DVec2]) {
        self.surface.extend(points.windows(2).map(|pair| [pair[0], pair[1]]));
    }

    /// Keeps labels off a place.
    pub(super) fn keep_off(&mut self, rect: Rect) {
        self.taken.push(rect);
    }

    /// The best place for a label of a point: near it, and over nothing.
    pub(super) fn place(&mut self, text: &str, anchor: DVec2) -> Label {
        let size = DVec2::new(LETTER * text.chars().count() as f64, FONT_SIZE);
        let mut best: Option<(f64, Rect)> = None;
        for distance in DISTANCES {
            for i in 0..DIRECTIONS {
                let angle = std::f64::consts::TAU * (f64::from(i) + 0.5) / f64::from(DIRECTIONS);
                let towards = direction_at(angle);
                // From the point to the middle of the label, whose near side is at the distance.
                let reach = (0.5 * size / towards.abs()).min_element() + distance;
                let middle = anchor + reach * towards;
                let rect = Rect::new(middle - 0.5 * size, middle + 0.5 * size);
                let cost = distance + self.cost(&rect);
                if best.is_none_or(|(least, _)| cost < least) {
                    best = Some((cost, rect));
                }
            }
        }
        // The loops are not empty.
        let rect = best.map_or(Rect::new(anchor, anchor), |(_, rect)| rect);
        let rect = self.inside(rect);
        let near = anchor.clamp(rect.low, rect.high);
        let leader = ((near - anchor).length() > LEADER).then_some([near, anchor]);
        self.taken.push(rect);
        self.lines.extend(leader);
        Label { text: text.to_owned(), rect, leader }
    }

    fn cost(&self, rect: &Rect) -> f64 {
        let room = rect.grown(GAP);
        let is_inside = self.frame.contains(room.low) && self.frame.contains(room.high);
        let over = |lines: &[[DVec2; 2]]| lines.iter().filter(|line| room.clip(**line).is_some()).count();
        let labels = self.taken.iter().filter(|taken| taken.overlaps(&room)).count();
        let outside = if is_inside { 0.0 } else { OUTSIDE };
        outside
            + OVER_LINE * (10 * labels + over(&self.lines)) as f64
            + OVER_SURFACE * over(&self.surface) as f64
    }

    /// The rectangle moved into the frame.
    fn inside(&self, rect: Rect) -> Rect {
        let shift =
            (self.frame.low - rect.low).max(DVec2::ZERO) + (self.frame.high - rect.high).min(DVec2::ZERO);
        Rect::new(rect.low + shift, rect.high + shift)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn labels_of_one_place_stand_beside_each_other_and_beside_lines() {
        let frame = Rect::new(DVec2::ZERO, DVec2::new(300.0, 200.0));
        let mut labels = Labels::new(frame);
        let lines = [
            [DVec2::new(10.0, 100.0), DVec2::new(290.0, 100.0)],
            [DVec2::new(150.0, 10.0), DVec2::new(150.0, 190.0)],
        ];
        lines.iter().for_each(|line| labels.line(*line));
        let placed: Vec<Label> = ["t₁", "t₂", "C", "N", "O + t·D"]
            .iter()
            .map(|text| labels.place(text, DVec2::new(150.0, 100.0)))
            .collect();
        for (i, label) in placed.iter().enumerate() {
            assert!(frame.contains(label.rect.low) && frame.contains(label.rect.high), "{label:?}");
            assert!(lines.iter().all(|line| label.rect.clip(*line).is_none()), "{label:?}");
            assert!(placed[..i].iter().all(|other| !other.rect.overlaps(&label.rect)), "{label:?}");
        }
        // In a corner there is room on one side only.
        let corner = labels.place("O", DVec2::new(1.0, 1.0));
        assert!(frame.contains(corner.rect.low), "{corner:?}");
    }

    #[test]
    fn a_segment_is_cut_at_the_sides() {
        let rect = Rect::new(DVec2::new(1.0, 2.0), DVec2::new(5.0, 4.0));
        let cut = |from: [f64; 2], to: [f64; 2]| {
            rect.clip([DVec2::from_array(from), DVec2::from_array(to)]).map(|ends| ends.map(|p| p.to_array()))
        };
        assert_eq!(cut([0.0, 3.0], [6.0, 3.0]), Some([[1.0, 3.0], [5.0, 3.0]]));
        assert_eq!(cut([2.0, 3.0], [4.0, 3.5]), Some([[2.0, 3.0], [4.0, 3.5]]));
        assert_eq!(cut([0.0, 5.0], [6.0, 5.0]), None);
        assert_eq!(cut([0.0, 0.0], [1.0, 4.5]), None);
    }
}
