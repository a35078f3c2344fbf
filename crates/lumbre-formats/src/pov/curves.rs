//! Prisms, lathes and surfaces of revolution: the curves that they are made of.

use std::sync::Arc;

use lumbre_math::{DVec2, DVec4};

use super::objects::Form;
use super::sweep::Sweep;
use super::swept::{Outline, Swept};
use super::{Parser, Result};

#[derive(Clone, Copy, PartialEq, Eq)]
enum Spline {
    Linear,
    Quadratic,
    Cubic,
    Bezier,
}

impl Parser<'_, '_> {
    fn spline_word(&mut self) -> Result<Option<Spline>> {
        let spline = match self.word()?.as_deref() {
            Some("linear_spline") => Spline::Linear,
            Some("quadratic_spline") => Spline::Quadratic,
            Some("cubic_spline") => Spline::Cubic,
            Some("bezier_spline") => Spline::Bezier,
            _ => return Ok(None),
        };
        self.peeked = None;
        Ok(Some(spline))
    }

    fn plane_points(&mut self) -> Result<Vec<DVec2>> {
        let count = self.whole(2.0, 1e7)?;
        self.comma()?;
        let mut points = Vec::new();
        for _ in 0..count {
            self.budget.bytes(80, "points of a curve")?;
            points.push(self.vector()?.truncate());
            self.comma()?;
        }
        Ok(points)
    }

    pub(super) fn prism(&mut self) -> Result<Form> {
        let (mut conic, mut spline) = (false, Spline::Linear);
        loop {
            if self.take_word("conic_sweep")? {
                conic = true;
            } else if self.take_word("linear_sweep")? {
                conic = false;
            } else if let Some(word) = self.spline_word()? {
                spline = word;
            } else {
                break;
            }
        }
        let from = self.finite()?;
        self.comma()?;
        let to = self.finite()?;
        self.comma()?;
        let points = self.plane_points()?;
        let open = self.take_word("open")?;
        let mut outline = Outline::default();
        let mut rest = &points[..];
        while !rest.is_empty() {
            // A loop ends where its first point comes again.
            let lead = usize::from(matches!(spline, Spline::Quadratic | Spline::Cubic));
            let tail = usize::from(spline == Spline::Cubic);
            let start = rest.get(lead).copied();
            let again = |i: &usize| Some(rest[*i]) == start;
            let end = match spline {
                Spline::Bezier => (3..rest.len()).step_by(4).find(again),
                _ => (lead + 1..rest.len()).find(again),
            };
            let Some(end) = end else {
                if rest.len() == points.len() {
                    self.warn("the outline of a prism is not closed");
                }
                // What is not closed is closed by a straight line.
                let end = rest.len() - 1;
                curve(&mut outline, rest, spline);
                if let (Some(last), Some(first)) = (rest.get(end - tail.min(end)), start) {
                    outline.line(*last, first);
                }
                break;
            };
            let end = (end + 1 + tail).min(rest.len());
            curve(&mut outline, &rest[..end], spline);
            rest = &rest[end..];
        }
        Ok(Form::Swept(Arc::new(Swept::Prism { outline, heights: [from, to], conic, open })))
    }

    pub(super) fn lathe(&mut self) -> Result<Form> {
        let spline = self.spline_word()?.unwrap_or(Spline::Linear);
        let points = self.plane_points()?;
        let mut outline = Outline::default();
        curve(&mut outline, &points, spline);
        if outline.is_empty() {
            return Err(self.error("too few points for a lathe"));
        }
        Ok(Form::Swept(Arc::new(Swept::Lathe(outline))))
    }

    /// A sphere sweep, up to what modifies it.
    pub(super) fn sphere_sweep(&mut self) -> Result<Form> {
        let Some(word) = self.word()? else { return Err(self.unexpected("the spline of a sphere_sweep")) };
        let (sweep, least): (fn(&[DVec4]) -> Sweep, u32) = match &*word {
            "linear_spline" => (Sweep::linear, 2),
            "b_spline" => (Sweep::b_spline, 4),
            "cubic_spline" => (Sweep::cubic, 4),
            _ => return Err(self.unexpected("linear_spline, b_spline or cubic_spline")),
        };
        self.peeked = None;
        let count = self.whole(0.0, 1e7)?;
        if count < least {
            return Err(self.error("too few spheres for a sphere_sweep"));
        }
        let mut spheres = Vec::new();
        for _ in 0..count {
            self.budget.bytes(Sweep::SEGMENT_BYTES, "spheres of a sweep")?;
            self.comma()?;
            let center = self.vector()?;
            self.comma()?;
            spheres.push(center.extend(self.finite()?));
        }
        if self.take_word("tolerance")? {
            self.float()?;
        }
        Ok(Form::Sweep(Arc::new(sweep(&spheres))))
    }

    pub(super) fn sor(&mut self) -> Result<Form> {
        let points = self.plane_points()?;
        let open = self.take_word("open")?;
        if points.len() < 4 {
            return Err(self.error("a sor has four points or more"));
        }
        if points.windows(2).skip(1).take(points.len() - 3).any(|pair| pair[0].y >= pair[1].y) {
            return Err(self.error("the heights of a sor rise from point to point"));
        }
        let mut outline = Outline::default();
        // The square of the radius over the height.
        let place = |i: usize| DVec2::new(points[i].x * points[i].x, points[i].y);
        let slope = |i: usize| {
            let apart = points[i + 1] - points[i - 1];
            2.0 * points[i].x * apart.x / apart.y
        };
        for i in 1..points.len() - 2 {
            let height = points[i + 1].y - points[i].y;
            let tangent = |i: usize| DVec2::new(slope(i) * height, height);
            outline.hermite(place(i), tangent(i), place(i + 1), tangent(i + 1));
        }
        Ok(Form::Swept(Arc::new(Swept::Revolution { outline, open })))
    }
}

/// The pieces of a curve through points.
fn curve(outline: &mut Outline, points: &[DVec2], spline: Spline) {
    match spline {
        Spline::Linear => points.windows(2).for_each(|p| outline.line(p[0], p[1])),
        Spline::Quadratic => points.windows(3).for_each(|p| {
            outline.push([p[1], 0.5 * (p[2] - p[0]), 0.5 * (p[0] + p[2]) - p[1], DVec2::ZERO]);
        }),
        Spline::Cubic => points.windows(4).for_each(|p| {
            outline.hermite(p[1], 0.5 * (p[2] - p[0]), p[2], 0.5 * (p[3] - p[1]));
        }),
        Spline::Bezier => points.chunks_exact(4).for_each(|p| outline.bezier([p[0], p[1], p[2], p[3]])),
    }
}
