//! Capsules: the side and the balls about its ends.

use super::notes::{Notes, out_of_range};
use super::sphere::tell_sphere;
use super::{Fate, Remark, Topic};
use crate::axial::{CAP1, LATERAL};
use crate::{Capsule, Ray};

impl Capsule {
    pub(crate) fn explained(&self, ray: &Ray, notes: &mut Notes) {
        let tube = &self.tube;
        tube.tell_parameters(notes);
        tube.tell_side(ray, notes);
        let Some(side) = tube.lateral_span(ray) else {
            return;
        };
        tube.tell_cuts(ray, notes);
        let mut found = side.to_vec();
        let mut parts = vec![("I₀", self.within_cylinder(ray).into_iter().collect())];
        for part in self.balls(ray) {
            let topic = if part == CAP1 { Topic::FirstBall } else { Topic::SecondBall };
            let (center, radius) = (self.cap(part).0, self.radius());
            notes.step(topic).vector("C", "", center).number("r", "", radius);
            if let Some((near, far)) = tell_sphere(notes, center, radius, ray) {
                found.extend([(near, part), (far, part)]);
                parts.push((if part == CAP1 { "I₁" } else { "I₂" }, vec![[near, far]]));
            }
        }
        let span = self.span(ray);
        let step = notes.step(Topic::Span);
        for (name, within) in parts {
            step.intervals(name, within);
        }
        match span {
            Some([near, far]) => {
                step.number("t₁", "", near.0).number("t₂", "", far.0);
                if near.0 == far.0 {
                    step.remark(Remark::Touches);
                }
            }
            None => {
                step.remark(Remark::Misses);
            }
        }
        // Both roots of a touch are one.
        found.dedup();
        for end @ (t, part) in found {
            let owner = span.and_then(
                |[near, far]| {
                    if t == near.0 { Some(near) } else { (t == far.0).then_some(far) }
                },
            );
            let z = tube.arm(ray, t, LATERAL).0;
            let is_between = 0.0 <= z && z <= tube.length;
            let fate = match owner {
                Some(owner) if owner == end => out_of_range(ray, t).unwrap_or(Fate::Hit),
                Some(owner) => out_of_range(ray, t).unwrap_or(Fate::Shared { part: owner.1 }),
                None if part == LATERAL && !is_between => tube.outside_heights(ray, t),
                None => Fate::InsideSolid,
            };
            notes.candidate(t, part, fate);
        }
    }

    /// The interval of the line within the side and between the planes of both ends.
    fn within_cylinder(&self, ray: &Ray) -> Option<[f64; 2]> {
        let [side_near, side_far] = self.tube.lateral_span(ray)?;
        let [slab_near, slab_far] = self.tube.slab_span(ray)?;
        let (near, far) = (side_near.0.max(slab_near.0), side_far.0.min(slab_far.0));
        (near <= far).then_some([near, far])
    }

    /// The ends whose balls the search asks: those beyond which the line passes within the side's cylinder.
    fn balls(&self, ray: &Ray) -> Vec<u32> {
        let Some([side_near, side_far]) = self.tube.lateral_span(ray) else {
            return vec![];
        };
        let Some([slab_near, slab_far]) = self.tube.slab_span(ray) else {
            return vec![self.ball_beyond(ray)];
        };
        let mut balls = vec![];
        if side_near.0 < slab_near.0 {
            balls.push(slab_near.1);
        }
        if side_far.0 > slab_far.0 {
            balls.push(slab_far.1);
        }
        balls
    }
}
