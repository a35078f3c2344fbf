//! CSG trees, by the intervals of the line within each operand.

use super::notes::{Notes, out_of_range};
use super::{Explanation, Fate, Operand, Remark, Topic};
use crate::csg::{Event, Events, Membership, coincident};
use crate::{Csg, Leaf, Ray, Root};

impl Csg {
    pub(crate) fn explained(&self, ray: &Ray, notes: &mut Notes) {
        let (mut membership, mut events) = (Membership::new(self), Events::new());
        // The intervals are those of the whole line; the range decides only which of their ends are hits.
        let line = ray.with_range(f64::NEG_INFINITY, f64::INFINITY);
        let mut is_looked_at = vec![false; self.leaves().len()];
        let gathered =
            self.gather(&line, &mut membership, &mut events, |leaf| is_looked_at[leaf as usize] = true);
        let operands: Vec<Operand> =
            self.leaves().iter().zip(&is_looked_at).map(|(leaf, &is)| operand(leaf, is, ray)).collect();
        for (leaf, operand) in operands.iter().enumerate() {
            let of_leaf = operand.explanation.iter().flat_map(|explanation| &explanation.candidates);
            for root in of_leaf.filter_map(|candidate| candidate.root) {
                if root.multiplicity % 2 == 0 {
                    let fate = out_of_range(ray, root.t).unwrap_or(Fate::Touch);
                    notes.candidate(root.t, self.encoded(leaf, &root).part, fate);
                }
            }
        }
        notes.operands = operands;
        let starts_inside: Vec<bool> =
            (0..is_looked_at.len()).map(|leaf| membership.is_inside(leaf as u32)).collect();
        let step = notes.step(Topic::Intervals);
        for (leaf, &is_looked_at) in is_looked_at.iter().enumerate() {
            if is_looked_at {
                let of_leaf = events.iter().filter(|event| event.leaf as usize == leaf);
                let ends = of_leaf.map(|event| (event.root.t, event.enters));
                step.intervals(numbered("I", leaf + 1), intervals(starts_inside[leaf], ends));
            } else {
                step.remark(Remark::NotLookedAt { operand: leaf });
            }
            if starts_inside[leaf] {
                step.remark(Remark::StartsInside { operand: leaf });
            }
        }
        let result_starts_inside = membership.contains(0);
        let mut ends = vec![];
        let mut candidates = vec![];
        let mut rest = &events[..];
        while let Some((group, later)) = coincident(&line, rest) {
            rest = later;
            let reasons: Vec<Option<Fate>> =
                group.iter().map(|event| obstacle(&mut membership, event, is_looked_at.len())).collect();
            // Where the search has seen that nothing is left, it does not go on to the crossings.
            let root = gathered.and_then(|()| membership.cross_group(group));
            if let Some(root) = root {
                ends.push((root.t, membership.contains(0)));
            }
            for (event, reason) in group.iter().zip(reasons) {
                candidates.push((event.root, self.fate(ray, event, group, root, reason, &membership)));
            }
        }
        let result = intervals(result_starts_inside, ends.into_iter());
        if result.is_empty() {
            notes.remark_last(Remark::Misses);
        }
        notes.intervals_last("I", result);
        for (root, fate) in candidates {
            notes.candidate(root.t, root.part, fate);
        }
    }

    /// What became of a crossing among those that coincide with it, given the root that the result has there.
    fn fate(
        &self,
        ray: &Ray,
        event: &Event,
        group: &[Event],
        root: Option<Root>,
        reason: Option<Fate>,
        membership: &Membership,
    ) -> Fate {
        if let Some(fate) = out_of_range(ray, event.root.t) {
            return fate;
        }
        let is_here = |operand: usize| {
            operand != event.leaf as usize && group.iter().any(|other| other.leaf as usize == operand)
        };
        let no_change = Fate::NoChange { inside: membership.contains(0) };
        match (root, reason) {
            (Some(root), _) if root == event.root => Fate::Hit,
            (Some(root), _) => match self.leaf_of(&root) {
                Some(owner) => Fate::Coincides { operand: owner.leaf },
                None => Fate::NotReturned,
            },
            (None, Some(Fate::InsideOperand { operand } | Fate::OutsideOperand { operand }))
                if is_here(operand) =>
            {
                Fate::Coincides { operand }
            }
            (None, Some(reason)) => reason,
            // Alone it would be a crossing of the result.
            (None, None) => {
                let another = group.iter().map(|other| other.leaf as usize).find(|&leaf| is_here(leaf));
                another.map_or(no_change, |operand| Fate::Coincides { operand })
            }
        }
    }
}

/// Why a crossing alone changes nothing: the first of the operands that, if it were entered or left, would let it;
/// `None` where it does change whether the line is inside the result.
fn obstacle(membership: &mut Membership, event: &Event, leaves: usize) -> Option<Fate> {
    let was_inside = membership.contains(0);
    let decides = |membership: &mut Membership| {
        let before = membership.contains(0);
        membership.cross(event.leaf, event.enters);
        let after = membership.contains(0);
        membership.cross(event.leaf, !event.enters);
        before != after
    };
    if decides(membership) {
        return None;
    }
    let found = (0..leaves as u32).filter(|&leaf| leaf != event.leaf).find_map(|leaf| {
        let is_inside = membership.is_inside(leaf);
        membership.cross(leaf, !is_inside);
        let would_decide = decides(membership);
        membership.cross(leaf, is_inside);
        let operand = leaf as usize;
        let why = if is_inside { Fate::InsideOperand { operand } } else { Fate::OutsideOperand { operand } };
        would_decide.then_some(why)
    });
    Some(found.unwrap_or(Fate::NoChange { inside: was_inside }))
}

/// An operand, with what its own search finds on the whole line.
fn operand(leaf: &Leaf, is_looked_at: bool, ray: &Ray) -> Operand {
    match leaf {
        Leaf::Shape(placed) => {
            let line = placed.object_ray(ray).with_range(f64::NEG_INFINITY, f64::INFINITY);
            let explanation: Option<Explanation> = is_looked_at.then(|| placed.shape().explain(&line));
            Operand {
                name: placed.shape().name(),
                world_from_object: placed.world_from_object(),
                explanation,
            }
        }
        Leaf::Solid { world_from_object, .. } => Operand {
            name: "solid",
            world_from_object: world_from_object.as_deref().copied().unwrap_or_default(),
            explanation: None,
        },
    }
}

/// The intervals inside, from ends in ascending order, each marked as entered or left.
fn intervals(starts_inside: bool, ends: impl Iterator<Item = (f64, bool)>) -> Vec<[f64; 2]> {
    let mut found = vec![];
    let mut depth = i32::from(starts_inside);
    let mut from = f64::NEG_INFINITY;
    for (t, enters) in ends {
        let before = depth;
        depth += if enters { 1 } else { -1 };
        if before <= 0 && depth > 0 {
            from = t;
        } else if before > 0 && depth <= 0 {
            found.push([from, t]);
        }
    }
    if depth > 0 {
        found.push([from, f64::INFINITY]);
    }
    found
}

/// A symbol with a number below.
fn numbered(symbol: &str, number: usize) -> String {
    let digits = number.to_string();
    let below = digits.chars().filter_map(|digit| char::from_u32(digit as u32 - '0' as u32 + '₀' as u32));
    symbol.chars().chain(below).collect()
}
