//! Bilinear patches, by the rulings that meet the ray.

use lumbre_math::DVec2;
use lumbre_math::quadratic::quadratic;

use super::notes::{Notes, out_of_range};
use super::triangle::{tell_edges, tell_shear};
use super::{Fate, Remark, Step, Topic};
use crate::patch::Sheared;
use crate::{BilinearPatch, Ray, Root, WatertightRay};

/// The names of what is found at each root: u, v and t.
const ROOTS: [[&str; 3]; 2] = [["u₁", "v₁", "t₁"], ["u₂", "v₂", "t₂"]];
/// The names of both rulings.
const RULINGS: [&str; 2] = ["w₁", "w₂"];
/// The subscripts of what is computed on the way to each root: the ruling's ends, the place on it, and the derivatives
/// and their area.
const ON_THE_WAY: [[&str; 5]; 2] = [["₄", "₅", "₆", "₁", "₂"], ["₇", "₈", "₉", "₃", "₄"]];

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
                step.number(RULINGS[0], "−h/a", first).remark(Remark::Touches);
            }
            Some((first, second)) => {
                let q = -(h + delta.sqrt().copysign(h));
                step.number("q", if q < 0.0 { "−(h + √(Δ))" } else { "√(Δ) − h" }, q);
                let is_ascending = if a == 0.0 { !first.is_finite() } else { (q < 0.0) == (a > 0.0) };
                let formulas = if is_ascending { ["q/a", "c/q"] } else { ["c/q", "q/a"] };
                for ((symbol, formula), u) in RULINGS.into_iter().zip(formulas).zip([first, second]) {
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
        let rulings = of_both(rulings);
        if rulings.iter().any(|&(_, u)| patch.runs_along_ruling(u)) {
            step.remark(Remark::AlongRuling);
        }
        if rulings.iter().any(|&(_, u)| patch.is_parallel_to_ruling(u)) {
            step.remark(Remark::ParallelRuling);
        }
        let hits = &crossings.of_line;
        let step = notes.step(Topic::Roots);
        for (i, root) in hits.iter().map(|crossing| crossing.root).enumerate().take(2) {
            let [u, v, t] = ROOTS[i];
            let found = rulings.iter().find_map(|&ruling| Found::new(&patch, ruling, &root));
            let [of_u, of_v] = match found {
                Some(found) => found.tell(&patch, step, i),
                None => Default::default(),
            };
            step.number(u, of_u, root.local.x).number(v, of_v, root.local.y);
            let of_t = format!("σ₃·((1 − {v})·((1 − {u})·z₀ + {u}·z₁) + {v}·((1 − {u})·z₂ + {u}·z₃))");
            step.number(t, of_t, root.t);
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
        for uv in roots_outside(&patch, &rulings) {
            let t = sheared.t(patch.at(uv).z);
            notes.candidate(t, 0, Fate::OutsidePatch { u: uv.x, v: uv.y });
        }
    }
}

/// The finite rulings, with their names.
fn of_both(rulings: Option<(f64, f64)>) -> Vec<(&'static str, f64)> {
    let rulings = match rulings {
        Some((first, second)) if first == second => vec![(RULINGS[0], first)],
        Some((first, second)) => vec![(RULINGS[0], first), (RULINGS[1], second)],
        None => vec![],
    };
    rulings.into_iter().filter(|(_, u)| u.is_finite()).collect()
}

/// How a root was found on a ruling.
struct Found {
    ruling: (&'static str, f64),
    /// The place on the ruling that is nearest to the ray.
    near: DVec2,
    /// After a step of Newton's method, if one was made.
    refined: DVec2,
    /// Whether the root was moved into the patch.
    is_moved: bool,
}

impl Found {
    /// `None` if this root was not found on this ruling, but on an edge, say.
    fn new(patch: &Sheared, ruling: (&'static str, f64), root: &Root) -> Option<Self> {
        let near = patch.on_ruling(ruling.1);
        let refined = if root.multiplicity == 2 { near } else { patch.refined(near) };
        let is_there = refined == root.local;
        let is_moved = refined.clamp(DVec2::ZERO, DVec2::ONE) == root.local;
        (is_there || is_moved).then_some(Self { ruling, near, refined, is_moved: !is_there })
    }

    /// Tells how the place on the ruling follows, and how the step of Newton's method goes on from there; returns the
    /// formulas of the root's u and v.
    fn tell(&self, patch: &Sheared, step: &mut Step, which: usize) -> [String; 2] {
        let [p00, p10, p01, p11] = patch.corners;
        let (w, u) = self.ruling;
        let [a, b, c, g, h] = ON_THE_WAY[which];
        let (start, end) = ((1.0 - u) * p00 + u * p10, (1.0 - u) * p01 + u * p11);
        for (below, [from, to], place) in [(a, ["₀", "₁"], start), (b, ["₂", "₃"], end)] {
            step.number(format!("x{below}"), format!("(1 − {w})·x{from} + {w}·x{to}"), place.x);
            step.number(format!("y{below}"), format!("(1 − {w})·y{from} + {w}·y{to}"), place.y);
        }
        let v = ["v′₁", "v′₂"][which];
        let (x, y) = (format!("(x{b} − x{a})"), format!("(y{b} − y{a})"));
        step.number(v, format!("−(x{a}·{x} + y{a}·{y})/({x}² + {y}²)"), self.near.y);
        let [of_u, of_v] = if self.refined == self.near {
            [w.to_owned(), v.to_owned()]
        } else {
            let (place, [along_u, along_v]) = (patch.at(self.near), patch.derivatives(self.near));
            step.number(format!("x{c}"), format!("(1 − {v})·x{a} + {v}·x{b}"), place.x);
            step.number(format!("y{c}"), format!("(1 − {v})·y{a} + {v}·y{b}"), place.y);
            step.number(format!("g{g}"), format!("(1 − {v})·(x₁ − x₀) + {v}·(x₃ − x₂)"), along_u.x);
            step.number(format!("g{h}"), format!("(1 − {v})·(y₁ − y₀) + {v}·(y₃ − y₂)"), along_u.y);
            let area = along_u.x * along_v.y - along_u.y * along_v.x;
            let area_name = ["A₁", "A₂"][which];
            step.number(area_name, format!("g{g}·{y} − g{h}·{x}"), area);
            [
                format!("{w} − (x{c}·{y} − y{c}·{x})/{area_name}"),
                format!("{v} − (g{g}·y{c} − g{h}·x{c})/{area_name}"),
            ]
        };
        if self.is_moved {
            [of_u, of_v].map(|formula| format!("min(max({formula}, 0), 1)"))
        } else {
            [of_u, of_v]
        }
    }
}

/// The crossings of the surface that continues the patch, given the rulings that meet the line. One that is outside by
/// rounding alone, if at all, is the patch's own.
fn roots_outside(patch: &Sheared, rulings: &[(&'static str, f64)]) -> Vec<DVec2> {
    let is_plainly_outside = |uv: &DVec2| {
        let beyond = (-*uv).max(*uv - DVec2::ONE).max_element();
        uv.is_finite() && beyond > 1e-9
    };
    // A parallel ruling meets the line at infinity.
    let meeting = rulings.iter().map(|&(_, u)| u).filter(|&u| !patch.is_parallel_to_ruling(u));
    meeting.map(|u| patch.refined(patch.on_ruling(u))).filter(is_plainly_outside).collect()
}
