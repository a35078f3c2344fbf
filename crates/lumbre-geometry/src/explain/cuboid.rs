//! Boxes, by their slabs.

use super::notes::{Notes, out_of_range};
use super::{Fate, Remark, Topic};
use crate::{Cuboid, Ray};

/// What the crossings with the planes of each axis are called: those of the lower coordinates, and those of the higher.
const NAMES: [[&str; 2]; 3] = [["x₀", "x₁"], ["y₀", "y₁"], ["z₀", "z₁"]];

impl Cuboid {
    pub(crate) fn explained(&self, ray: &Ray, notes: &mut Notes) {
        let [low, high] = self.corners();
        notes.step(Topic::Parameters).vector("P₀", "", low).vector("P₁", "", high);
        let d = ray.direction;
        let (at_low, at_high) = ((low - ray.origin) / d, (high - ray.origin) / d);
        let step = notes.step(Topic::Slabs);
        for (axis, name) in ["⟨1, 0, 0⟩", "⟨0, 1, 0⟩", "⟨0, 0, 1⟩"].into_iter().enumerate() {
            if d[axis] == 0.0 {
                let is_between = low[axis] <= ray.origin[axis] && ray.origin[axis] <= high[axis];
                step.remark(if is_between { Remark::Between { axis } } else { Remark::Beside { axis } });
                continue;
            }
            let formula = |corner: &str| format!("(({corner} − O)·{name})/(D·{name})");
            step.number(NAMES[axis][0], formula("P₀"), at_low[axis]);
            step.number(NAMES[axis][1], formula("P₁"), at_high[axis]);
        }
        let span = self.span(ray);
        let (enter, leave) = (at_low.min(at_high), at_low.max(at_high));
        let crossed: Vec<usize> = (0..3).filter(|&axis| d[axis] != 0.0).collect();
        tell_span(notes, span, &crossed);

        let outside = |t: f64| {
            (0..3).find(|&axis| t < enter[axis] || leave[axis] < t).map(|axis| Fate::OutsideSlab {
                axis,
                enter: enter[axis],
                leave: leave[axis],
            })
        };
        for axis in crossed {
            for (t, part) in [(at_low[axis], 2 * axis as u32), (at_high[axis], 2 * axis as u32 + 1)] {
                let owner =
                    span.and_then(
                        |[near, far]| {
                            if t == near.0 { Some(near.1) } else { (t == far.0).then_some(far.1) }
                        },
                    );
                let fate = match owner {
                    Some(owner) => out_of_range(ray, t).unwrap_or(if owner == part {
                        Fate::Hit
                    } else {
                        Fate::Shared { part: owner }
                    }),
                    None => outside(t).unwrap_or(Fate::NotReturned),
                };
                notes.candidate(t, part, fate);
            }
        }
    }
}

/// Explains the interval inside the box; `crossed` are the axes whose slabs the line is not parallel to.
fn tell_span(notes: &mut Notes, span: Option<[(f64, u32); 2]>, crossed: &[usize]) {
    let step = notes.step(Topic::Span);
    let Some([near, far]) = span else {
        step.remark(Remark::Misses);
        return;
    };
    let over_axes = |outer: &str, inner: &str| {
        let parts: Vec<String> = crossed
            .iter()
            .map(|&axis| {
                let [low, high] = NAMES[axis];
                format!("{inner}({low}, {high})")
            })
            .collect();
        if let [only] = &parts[..] { only.clone() } else { format!("{outer}({})", parts.join(", ")) }
    };
    step.number("t₁", over_axes("max", "min"), near.0).number("t₂", over_axes("min", "max"), far.0);
    if near.0 == far.0 {
        step.remark(Remark::Touches);
    }
}
