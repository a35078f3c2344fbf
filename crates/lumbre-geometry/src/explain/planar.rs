//! Planes and disks.

use std::f64::consts::TAU;

use lumbre_math::{DVec3, orthonormal_basis};

use super::notes::{Notes, out_of_range};
use super::{Fate, Remark, Topic};
use crate::line::{exact_plane_products, plane_crossing, plane_products};
use crate::support::azimuth;
use crate::{Disk, Plane, Ray};

/// Explains where a line crosses the plane through `point`, called `names[0]`, perpendicular to `normal`, called
/// `names[1]`: the parameter, or `None` where it is parallel.
pub(super) fn tell_plane(
    notes: &mut Notes,
    topic: Topic,
    ray: &Ray,
    (point_name, point): (&'static str, DVec3),
    (normal_name, normal): (&'static str, DVec3),
) -> Option<f64> {
    let (t, along) = plane_crossing(ray, point, normal);
    let (mut away, rough_along, keeps_digits) = plane_products(ray, point, normal);
    let is_exact = !(keeps_digits && rough_along != 0.0);
    let step = notes.step(topic);
    let rough_away = away;
    if is_exact {
        (away, _) = exact_plane_products(ray, point, normal);
    }
    // Where nothing is rounded, twice the precision changes nothing.
    let is_rounded = is_exact && (rough_along, rough_away) != (along, away);
    step.number("μ", format!("D·{normal_name}"), along);
    step.number("δ", format!("({point_name} − O)·{normal_name}"), away);
    if is_rounded {
        step.remark(Remark::TwicePrecision);
    }
    if along == 0.0 {
        step.remark(if away == 0.0 { Remark::InPlane } else { Remark::Parallel });
        return None;
    }
    step.number("t", "δ/μ", t);
    if is_rounded {
        let schoolbook = rough_away / rough_along;
        step.beside(format!("(({point_name} − O)·{normal_name})/(D·{normal_name})"), schoolbook);
        let off = ((schoolbook - t) / t).abs();
        if off > 1e-12 && off.is_finite() {
            step.remark(Remark::Cancellation { digits: super::quadratic::digits_lost(off) });
        }
    }
    Some(t)
}

impl Plane {
    pub(crate) fn explained(&self, ray: &Ray, notes: &mut Notes) {
        notes.step(Topic::Parameters).vector("P₀", "", self.point).vector("n", "", self.normal);
        if let Some(t) = tell_plane(notes, Topic::Plane, ray, ("P₀", self.point), ("n", self.normal)) {
            notes.candidate(t, 0, out_of_range(ray, t).unwrap_or(Fate::Hit));
        }
    }
}

impl Disk {
    pub(crate) fn explained(&self, ray: &Ray, notes: &mut Notes) {
        let step = notes.step(Topic::Parameters);
        step.vector("C", "", self.center).vector("n", "", self.normal).number("r", "", self.radius);
        if self.inner_radius > 0.0 {
            step.number("r₀", "", self.inner_radius);
        }
        let Some(t) = tell_plane(notes, Topic::Plane, ray, ("C", self.center), ("n", self.normal)) else {
            return;
        };
        let fate = out_of_range(ray, t).or_else(|| self.excludes(ray, t));
        notes.candidate(t, 0, fate.unwrap_or(Fate::Hit));
    }

    /// Why the point at `t` of the plane is not on the disk.
    fn excludes(&self, ray: &Ray, t: f64) -> Option<Fate> {
        let w = self.arm(ray, t);
        let (squared, distance) = (w.length_squared(), w.length());
        if squared < self.inner_radius * self.inner_radius {
            return Some(Fate::InsideHole { distance, radius: self.inner_radius });
        }
        if squared > self.radius * self.radius {
            return Some(Fate::OutsideRim { distance, radius: self.radius });
        }
        let (e1, e2) = orthonormal_basis(self.normal());
        let phi = azimuth(w.dot(e2), w.dot(e1));
        let is_swept = self.phi_max >= TAU || phi <= self.phi_max;
        (!is_swept).then_some(Fate::OutsideSweep { phi, max: self.phi_max })
    }
}
