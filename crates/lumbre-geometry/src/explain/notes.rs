//! Where an explanation is written down while it is made.

use std::borrow::Cow;

use lumbre_math::DVec3;

use super::{Candidate, Explanation, Fate, Operand, Quantity, Remark, Step, Topic, Value};
use crate::{Ray, Root, Surface};

/// An explanation in the making.
pub(crate) struct Notes {
    steps: Vec<Step>,
    pub(crate) operands: Vec<Operand>,
    candidates: Vec<Candidate>,
    line: Option<Ray>,
    /// What takes the `t` of a scaled ray to those of the given one, in two factors.
    scale: Option<[f64; 2]>,
}

impl Notes {
    pub(crate) fn new(ray: &Ray) -> Self {
        let mut notes = Self { steps: vec![], operands: vec![], candidates: vec![], line: None, scale: None };
        let is_a_ray = !ray.origin.is_nan() && !ray.t_min.is_nan() && !ray.t_max.is_nan();
        if is_a_ray && ray.has_ordinary_direction() {
            notes.line = Some(*ray);
            return notes;
        }
        match ray.with_direction_scaled() {
            Some((scaled, scale)) if is_a_ray => {
                let step = notes.step(Topic::ScaledRay);
                step.number("λ", "", scale[0] * scale[1]).vector("D", "", scaled.direction);
                notes.line = Some(scaled.with_range(f64::NEG_INFINITY, f64::INFINITY));
                notes.scale = Some(scale);
            }
            _ => {
                notes.step(Topic::Parameters).remark(Remark::NoRay);
            }
        }
        notes
    }

    /// The ray whose crossings are to be explained; `None` for one that is none.
    pub(crate) fn line(&self) -> Option<Ray> {
        self.line
    }

    /// Begins a step.
    pub(crate) fn step(&mut self, topic: Topic) -> &mut Step {
        self.steps.push(Step { topic, quantities: vec![], remarks: vec![] });
        let last = self.steps.len() - 1;
        &mut self.steps[last]
    }

    /// Adds a remark to the last step.
    pub(super) fn remark_last(&mut self, remark: Remark) {
        if let Some(step) = self.steps.last_mut() {
            step.remark(remark);
        }
    }

    /// Adds intervals to the last step.
    pub(super) fn intervals_last(&mut self, symbol: &'static str, value: Vec<[f64; 2]>) {
        if let Some(step) = self.steps.last_mut() {
            step.intervals(symbol, value);
        }
    }

    /// Adds a crossing, unless it is at infinity.
    pub(crate) fn candidate(&mut self, t: f64, part: u32, fate: Fate) {
        if t.is_finite() {
            self.candidates.push(Candidate { t, part, fate, root: None });
        }
    }

    /// The explanation, given what the search returns for the ray: that decides about the hits.
    pub(crate) fn finished(
        mut self,
        ray: &Ray,
        roots: &[Root],
        surface: impl FnOnce(&Root) -> Surface,
    ) -> Explanation {
        if let Some([one, other]) = self.scale {
            for candidate in &mut self.candidates {
                candidate.t = candidate.t / one / other;
                if candidate.fate == Fate::Hit {
                    candidate.fate = out_of_range(ray, candidate.t).unwrap_or(Fate::Hit);
                }
            }
            self.candidates.retain(|candidate| candidate.t.is_finite());
        }
        let mut left: Vec<Root> = roots.to_vec();
        for candidate in self.candidates.iter_mut().filter(|candidate| candidate.fate == Fate::Hit) {
            let is_it =
                |root: &Root| root.t.to_bits() == candidate.t.to_bits() && root.part == candidate.part;
            match left.iter().position(is_it) {
                Some(place) => candidate.root = Some(left.remove(place)),
                None => candidate.fate = Fate::NotReturned,
            }
        }
        let missed = left.iter().map(|root| Candidate {
            t: root.t,
            part: root.part,
            fate: Fate::Hit,
            root: Some(*root),
        });
        self.candidates.extend(missed);
        self.candidates.sort_by(|a, b| a.t.total_cmp(&b.t));
        if let Some(nearest) = roots.first() {
            let surface = surface(nearest);
            let step = self.step(Topic::Surface);
            step.vector("P", "", surface.point).vector("N", "", surface.normal);
            step.number("u", "", surface.uv.x).number("v", "", surface.uv.y);
        }
        Explanation { steps: self.steps, operands: self.operands, candidates: self.candidates }
    }
}

/// Why `t` is not in the ray's range; `None` where it is.
pub(super) fn out_of_range(ray: &Ray, t: f64) -> Option<Fate> {
    if ray.contains(t) {
        None
    } else if t < ray.t_min {
        let is_behind = t < 0.0 && 0.0 <= ray.t_min;
        Some(if is_behind { Fate::Behind } else { Fate::BeforeRange { t_min: ray.t_min } })
    } else {
        Some(Fate::BeyondRange { t_max: ray.t_max })
    }
}

impl Step {
    fn quantity(
        &mut self,
        symbol: impl Into<Cow<'static, str>>,
        formula: impl Into<Cow<'static, str>>,
        value: Value,
    ) -> &mut Self {
        let quantity = Quantity { symbol: symbol.into(), formula: formula.into(), value, schoolbook: None };
        self.quantities.push(quantity);
        self
    }

    pub(super) fn number(
        &mut self,
        symbol: impl Into<Cow<'static, str>>,
        formula: impl Into<Cow<'static, str>>,
        value: f64,
    ) -> &mut Self {
        self.quantity(symbol, formula, Value::Number(value))
    }

    pub(super) fn vector(
        &mut self,
        symbol: impl Into<Cow<'static, str>>,
        formula: impl Into<Cow<'static, str>>,
        value: DVec3,
    ) -> &mut Self {
        self.quantity(symbol, formula, Value::Vector(value))
    }

    pub(super) fn numbers(
        &mut self,
        symbol: impl Into<Cow<'static, str>>,
        formula: impl Into<Cow<'static, str>>,
        value: Vec<f64>,
    ) -> &mut Self {
        self.quantity(symbol, formula, Value::Numbers(value))
    }

    pub(super) fn intervals(
        &mut self,
        symbol: impl Into<Cow<'static, str>>,
        value: Vec<[f64; 2]>,
    ) -> &mut Self {
        self.quantity(symbol, "", Value::Intervals(value))
    }

    /// Adds the textbook's formula to the last quantity.
    pub(super) fn beside(&mut self, formula: impl Into<Cow<'static, str>>, value: f64) -> &mut Self {
        if let Some(last) = self.quantities.last_mut() {
            last.schoolbook = Some((formula.into(), Value::Number(value)));
        }
        self
    }

    pub(super) fn remark(&mut self, remark: Remark) -> &mut Self {
        self.remarks.push(remark);
        self
    }
}
