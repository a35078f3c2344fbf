//! Bilinear patches, by the rulings that meet the ray.

use lumbre_math::DVec2;
use lumbre_math::quadratic::quadratic;

use super::notes::{Notes, out_of_range};
use super::triangle::{tell_edges, tell_shear};
use super::{Fate, Remark, Topic};
use crate::patch::Sheared;
use crate::{BilinearPatch, Ray, WatertightRay};

/// The names of what is found at each root: u, v and t.
const ROOTS: [[&str; 3]; 2] = [["u₁", "v₁", "t₁"], ["u₂", "v₂", "t₂"]];

impl BilinearPatch {
    pub(crate) fn explained(&self, ray: &Ray, notes: &mut Notes) {
        let [p00, p10, p01, p11] = self.corners();
        let named = [("P₀₀", p00), ("P₁₀", p10), ("P₀₁", p01), ("P₁₁", p11)];
        let step = notes.step(Topic::Parameters);
        for (name, point) in named {
            step.vector(name, "", point);
        }
        if !ray.origin.is_finite() {
            notes.remark_last(Remark::NoRay);
            return;
        }
        let sheared = WatertightRay::new(ray.origin, ray.direction);
        let patch = self.sheared(&sheared);
        tell_shear(notes, &sheared, &named, &patch.corners);

        let sides = patch.sides();
        let signs = sides.map(|side| if side.is_positive { 1.0 } else { -1.0 });
        let winding = patch.winding(sides);
        let step = notes.step(Topic::Winding);
        // In the order of the outline: 00, 10, 11, 01.
        let edges = ["x₀·y₁ − y₀·x₁", "x₁·y₃ − y₁·x₃", "x₃·y₂ − y₃·x₂", "x₂·y₀ − y₂·x₀"];
        let outline = patch.outline();
        for (i, formula) in edges.into_iter().enumerate() {
            let (from, to) = (outline[i], outline[(i + 1) % 4]);
            step.number(["f₁", "f₂", "f₃", "f₄"][i], formula, from.x * to.y - from.y * to.x);
        }
        step.numbers("σ", "", signs.to_vec()).number("n", "", f64::from(winding));
        tell_edges(step, std::array::from_fn::<_, 4, _>(|i| [outline[i], outline[(i + 1) % 4]]));

        let crossings = self.line_crossings(ray);
        let [c, h, a, delta] = patch.rulings();
        let step = notes.step(Topic::Rulings);
        step.number("c", "x₀·y₂ − y₀·x₂", c);
        step.number("a", "(x₁ − x₀)·(y₃ − y₂) − (y₁ − y₀)·(x₃ − x₂)", a);
        step.number("h", "(x₁·y₃ − y₁·x₃ − a − c)/2", h).beside("b = 2·h", 2.0 * h);
        step.number("Δ", "h² − a·c", delta).beside("b² − 4·a·c", 4.0 * h * h - 4.0 * a * c);
        if crossings.is_edge_on {
            step.remark(Remark::EdgeOn);
        }
        let rulings = quadratic(a, h, c, delta);
        match rulings {
            Some((first, second)) if first == second => {
                step.number("u₁", "−h/a", first).remark(Remark::Touches);
            }
            Some((first, second)) => {
                let q = -(h + delta.sqrt().copysign(h));
                step.number("q", if q < 0.0 { "−(h + √(Δ))" } else { "√(Δ) − h" }, q);
                let is_ascending = if a == 0.0 { !first.is_finite() } else { (q < 0.0) == (a > 0.0) };
                let formulas = if is_ascending { ["q/a", "c/q"] } else { ["c/q", "q/a"] };
                for ((symbol, formula), u) in ["u₁", "u₂"].into_iter().zip(formulas).zip([first, second])
                {
                    if u.is_finite() {
                        step.number(symbol, formula, u);
                    } else {
                        step.remark(Remark::AtInfinity);
                    }
                }
            }
            None if [a, h, c] == [0.0; 3] => {
                step.remark(Remark::EveryRuling);
            }
            None => {
                step.remark(Remark::Misses);
            }
        }
        let is_along = rulings.is_some_and(|(first, second)| {
            [first, second].into_iter().any(|u| u.is_finite() && patch.runs_along_ruling(u))
        });
        if is_along {
            step.remark(Remark::AlongRuling);
        }
        let hits = &crossings.of_line;
        let step = notes.step(Topic::Roots);
        for (root, [u, v, t]) in hits.iter().map(|crossing| crossing.root).zip(ROOTS) {
            step.number(u, "", root.local.x).number(v, "", root.local.y).number(t, "", root.t);
            if root.multiplicity > 1 {
                step.remark(Remark::Touches);
            }
        }
        if hits.is_empty() && !crossings.is_edge_on {
            step.remark(Remark::Misses);
        }
        for crossing in hits {
            let t = crossing.root.t;
            notes.candidate(t, 0, out_of_range(ray, t).unwrap_or(Fate::Hit));
        }
        for uv in roots_outside(&patch, rulings) {
            let t = sheared.t(patch.at(uv).z);
            notes.candidate(t, 0, Fate::OutsidePatch { u: uv.x, v: uv.y });
        }
    }
}

/// The crossings of the surface that continues the patch, given the rulings that meet the line. One that is outside by
/// rounding alone, if at all, is the patch's own.
fn roots_outside(patch: &Sheared, rulings: Option<(f64, f64)>) -> Vec<DVec2> {
    let Some((first, second)) = rulings else {
        return vec![];
    };
    let rulings = if first == second { vec![first] } else { vec![first, second] };
    let is_plainly_outside = |uv: &DVec2| {
        let beyond = (-*uv).max(*uv - DVec2::ONE).max_element();
        uv.is_finite() && beyond > 1e-9
    };
    rulings.into_iter().map(|u| patch.refined(patch.on_ruling(u))).filter(is_plainly_outside).collect()
}
