//! A tree of boxes around the many parts of one solid.

use lumbre_geometry::{Aabb, Ray};
use lumbre_math::DVec3;

/// Boxes around parts, the nearest together: which of them a ray or a point meets.
#[derive(Clone, Debug)]
pub(super) struct PartTree {
    /// In the order of a walk that goes into each box.
    nodes: Vec<Node>,
    /// The numbers of the parts, those of a leaf together.
    parts: Vec<u32>,
}

#[derive(Clone, Debug)]
struct Node {
    bounds: Aabb,
    /// The node after all that are within this one.
    next: u32,
    /// Which of the parts lie in a leaf; none in other nodes.
    parts: [u32; 2],
}

/// A leaf has at most this many parts.
const LEAF: usize = 4;

impl PartTree {
    /// Of parts with these boxes.
    pub(super) fn new(bounds: &[Aabb]) -> Self {
        // Wider than they are by rounding.
        let wider = |b: &Aabb| {
            let margin = DVec3::splat(1e-9 * (b.min.abs().max(b.max.abs())).max_element());
            Aabb { min: b.min - margin, max: b.max + margin }
        };
        let bounds: Vec<Aabb> = bounds.iter().map(wider).collect();
        let mut tree = Self { nodes: Vec::new(), parts: (0..bounds.len() as u32).collect() };
        let mut parts = std::mem::take(&mut tree.parts);
        tree.add(&bounds, &mut parts, 0);
        tree.parts = parts;
        tree
    }

    /// The node of a list of parts, which begins at a place in the list of all.
    fn add(&mut self, bounds: &[Aabb], parts: &mut [u32], first: u32) {
        let all = parts.iter().map(|&part| bounds[part as usize]).fold(Aabb::EMPTY, Aabb::union);
        let node = self.nodes.len();
        let end = first + parts.len() as u32;
        self.nodes.push(Node { bounds: all, next: 0, parts: [first, end] });
        if parts.len() > LEAF {
            self.nodes[node].parts = [first, first];
            let size = all.size();
            let axis = if size.x >= size.y && size.x >= size.z {
                0
            } else if size.y >= size.z {
                1
            } else {
                2
            };
            let half = parts.len() / 2;
            parts.select_nth_unstable_by(half, |&a, &b| {
                let center = |part: u32| bounds[part as usize].center()[axis];
                center(a).total_cmp(&center(b)).then(a.cmp(&b))
            });
            let (below, above) = parts.split_at_mut(half);
            self.add(bounds, below, first);
            self.add(bounds, above, first + half as u32);
        }
        self.nodes[node].next = self.nodes.len() as u32;
    }

    /// The parts whose boxes a ray meets in its range, in ascending order.
    pub(super) fn along(&self, ray: &Ray) -> Vec<u32> {
        let inverse = ray.direction.recip();
        self.parts_in(|bounds| {
            let (a, b) = ((bounds.min - ray.origin) * inverse, (bounds.max - ray.origin) * inverse);
            let (near, far) = (a.min(b).max_element(), a.max(b).min_element());
            near.max(ray.t_min) <= far.min(ray.t_max)
        })
    }

    /// The parts whose boxes contain a point, in ascending order.
    pub(super) fn around(&self, p: DVec3) -> Vec<u32> {
        self.parts_in(|bounds| bounds.contains(p))
    }

    fn parts_in(&self, is_met: impl Fn(&Aabb) -> bool) -> Vec<u32> {
        let mut found = Vec::new();
        let mut at = 0;
        while let Some(node) = self.nodes.get(at) {
            if is_met(&node.bounds) {
                let [first, end] = node.parts;
                found.extend_from_slice(&self.parts[first as usize..end as usize]);
                at += 1;
            } else {
                at = node.next as usize;
            }
        }
        found.sort_unstable();
        found
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn random(i: u32, k: u32) -> f64 {
        f64::from(i.wrapping_mul(2_654_435_761).wrapping_add(k.wrapping_mul(40_503)) >> 8 & 0xFFFF) / 65_536.0
    }

    #[test]
    fn no_part_that_is_met_is_left_out_and_few_others_are_found() {
        let bounds: Vec<Aabb> = (0..300)
            .map(|i| {
                let low = DVec3::new(random(i, 1), random(i, 2), random(i, 3)) * 9.0 - 4.0;
                Aabb { min: low, max: low + DVec3::new(1.3, 1.2, 1.4) }
            })
            .collect();
        let tree = PartTree::new(&bounds);
        let (mut met, mut found) = (0, 0);
        for i in 0..500 {
            let p = DVec3::new(random(i, 5), random(i, 6), random(i, 7)) * 9.0 - 4.0;
            let direction = match i % 3 {
                0 => DVec3::Y,
                1 => DVec3::new(0.0, 1.5, -0.7),
                _ => DVec3::new(random(i, 8) - 0.5, 0.9, random(i, 9) - 0.5),
            };
            let ray = Ray::new(p, direction).with_range(0.5, 3.0);
            let along = tree.along(&ray);
            for (part, b) in (0..).zip(&bounds) {
                let is_met = b.slabs(&ray).is_some();
                assert!(!is_met || along.contains(&part), "{ray:?} {part}");
                met += usize::from(is_met);
            }
            found += along.len();
            let expected: Vec<u32> =
                (0..).zip(&bounds).filter(|(_, b)| b.contains(p)).map(|(part, _)| part).collect();
            let around = tree.around(p);
            assert!(expected.iter().all(|part| around.contains(part)) && around.is_sorted(), "{p}");
        }
        assert!(met > 500 && found < 10 * met, "{met} {found}");
    }
}
