//! Boxes that together bound a tree's contents, and the box around them where the tree is placed.

use lumbre_geometry::Aabb;
use lumbre_math::{AnimatedTransform, DMat3, DVec3, Transform};

use crate::intersect::{Dispatch, Isa, Simd};
use crate::simd::{F32x16, LANES, Row};
use crate::tree::Tree;
use crate::tree::geometry::Placement;
use crate::tree::node::{Node, TreeSpace, tag};

/// Approximate number of boxes in an outline.
const OUTLINE: usize = 256;

/// Boxes of a tree that together bound its finite contents. The box around an instance is the union of the images of
/// these boxes, which is tighter than the image of the one box around the whole.
///
/// # Error bound
///
/// Boxes are kept in single precision, relative to the middle of all of them, in units of half their largest extent:
/// |c| + h ≤ 1 + 2u for each coordinate of a box's middle and half size, with u = 2⁻²⁴, and each of these has an error
/// of at most u/2. A row of a map is divided by its largest number, so that each number has an error of at most u. The
/// sums of |m c| and of |m h| over a row are together below 3.1. The rounding errors of the products and of the last
/// sum or difference are less than 8u of that: 25u in total. The conversion back to double precision adds 32u, and then
/// the rounding errors of the image of the middle, which is computed in double precision.
/// from these units in double precision has 32u of them added, and then what rounds in the image of the middle, which
/// is found in double precision.
pub(crate) struct Outline {
    whole: Aabb,
    /// The middle, and half the largest extent.
    center: DVec3,
    unit: f64,
    boxes: Vec<SixteenBoxes>,
    /// The largest coordinates.
    reach: DVec3,
}

/// Error bound of an outline's image in its units: 32u, see there.
const IMAGE_ERROR: f64 = 32.0 / (1 << 24) as f64;

impl Outline {
    /// The outline of a whole tree.
    pub(crate) fn of(inner: &Tree) -> Self {
        let whole = inner.bounds;
        match inner.packed.root.filter(|_| inner.infinite.is_empty()) {
            Some(root) => Self { whole, ..Self::below(inner, root, OUTLINE) },
            None => Self::of_box(whole),
        }
    }

    fn of_box(whole: Aabb) -> Self {
        Self { whole, center: DVec3::ZERO, unit: 0.0, boxes: Vec::new(), reach: DVec3::ZERO }
    }

    /// The outline of what is below a node: at most `count` + 1 boxes, or those of the node's children if they are
    /// more. A leaf has none.
    pub(crate) fn below(inner: &Tree, reference: u32, count: usize) -> Self {
        let node = |reference: u32| tag::is_inner(reference).then(|| &inner.packed.nodes[reference as usize]);
        let Some(root) = node(reference) else { return Self::of_box(Aabb::EMPTY) };
        let children = |node: &Node| -> Vec<(Aabb, u32)> {
            (0..node.len())
                .map(|lane| (box_in_space(&inner.tree_space, node, lane), node.children[lane]))
                .collect()
        };
        let mut open = children(root);
        while open.len() < count {
            let area = |i: &usize| open[*i].0.half_area();
            let inner_ones = (0..open.len()).filter(|&i| node(open[i].1).is_some());
            let Some(largest) = inner_ones.max_by(|a, b| area(a).total_cmp(&area(b))) else { break };
            let below = node(open[largest].1).map(children).unwrap_or_default();
            if open.len() + below.len() > count + 1 {
                break;
            }
            open.swap_remove(largest);
            open.extend(below);
        }
        open.retain(|(bounds, _)| !bounds.is_empty());
        let boxes: Vec<_> = open.into_iter().map(|(bounds, _)| bounds).collect();
        Self::of_boxes(&boxes)
    }

    /// The outline of these non-empty boxes.
    fn of_boxes(boxes: &[Aabb]) -> Self {
        let whole = boxes.iter().fold(Aabb::EMPTY, |whole, bounds| whole.union(*bounds));
        let boxes: Vec<_> = boxes.iter().map(center_and_half).collect();
        let reach = boxes.iter().fold(DVec3::ZERO, |most, [center, half]| most.max(center.abs() + *half));
        let [center, half] = center_and_half(&whole);
        let unit = half.max_element();
        if !(f64::MIN_POSITIVE..f64::INFINITY).contains(&unit) {
            return Self::of_box(whole);
        }
        let boxes = boxes.chunks(LANES).map(|boxes| SixteenBoxes::new(boxes, center, unit)).collect();
        Self { whole, center, unit, boxes, reach }
    }

    /// A box around the placed outline at all times, without the box around the whole tree; `None` if only that is
    /// known.
    pub(crate) fn part_at(&self, placement: &Placement) -> Option<Aabb> {
        match placement {
            Placement::Still(map) => Isa::best().run(Around { outline: self, placing: &Placing::of(map) }),
            Placement::Moving(motion) => (!self.boxes.is_empty()).then(|| self.swept(motion)),
        }
    }

    /// A box around the placed outline at all times.
    pub(crate) fn at(&self, placement: &Placement) -> Aabb {
        match placement {
            Placement::Still(map) => self.placed(map),
            Placement::Moving(motion) => self.swept(motion),
        }
    }

    fn placed(&self, map: &Transform) -> Aabb {
        let (whole, placing) = (placed_bounds(&self.whole, map), Placing::of(map));
        match Isa::best().run(Around { outline: self, placing: &placing }) {
            // Both bound it, so their intersection does.
            Some(parts) => Aabb { min: parts.min.max(whole.min), max: parts.max.min(whole.max) },
            None => whole,
        }
    }

    /// The box around the images of its boxes; `None` without boxes.
    #[inline(always)]
    pub(crate) fn around<L: Simd>(&self, placing: &Placing) -> Option<Aabb> {
        if self.boxes.is_empty() {
            return None;
        }
        let middle = placing.linear * self.center + placing.translation;
        let rounding = placing.rounding(self.reach);
        let (mut min, mut max) = (middle - rounding, middle + rounding);
        for axis in 0..3 {
            let row = [placing.linear.x_axis[axis], placing.linear.y_axis[axis], placing.linear.z_axis[axis]];
            let largest =
                row.iter().fold(f64::MIN_POSITIVE, |largest: f64, number| largest.max(number.abs()));
            let [low, high] = images::<L::F32x16>(&self.boxes, row.map(|number| (number / largest) as f32));
            let size = largest * self.unit;
            min[axis] += (f64::from(low) - IMAGE_ERROR) * size;
            max[axis] += (f64::from(high) + IMAGE_ERROR) * size;
        }
        Some(Aabb { min, max })
    }
}

/// A map, and what else the images of boxes need of it.
pub(crate) struct Placing {
    linear: DMat3,
    /// The absolute values of its numbers.
    sizes: DMat3,
    translation: DVec3,
}

impl Placing {
    #[inline(always)]
    pub(crate) fn of(map: &Transform) -> Self {
        Self { linear: map.linear(), sizes: sizes_of(map), translation: map.affine().translation }
    }

    /// Error bound of the image of a box whose coordinates are at most `reach`.
    #[inline(always)]
    fn rounding(&self, reach: DVec3) -> DVec3 {
        8.0 * f64::EPSILON * (self.sizes * reach + self.translation.abs())
    }
}

impl Outline {
    /// The box around the outline as it moves.
    ///
    /// # Correctness
    ///
    /// Between two neighbouring steps of a list, every point of the outline follows a curve that stays within a known
    /// distance of its chord. The ends of the chord lie in the boxes at the two steps, so the chord lies in the box
    /// around both, and the curve lies in that box widened by the distance. Before the first key and after the last,
    /// the map is constant. The rounding error of a map between two keys is a few 2⁻⁵³ of the outline's images at the
    /// keys, times their condition.
    fn swept(&self, motion: &AnimatedTransform) -> Aabb {
        let mut swept = Aabb::EMPTY;
        for (_, map) in motion.keys() {
            swept = swept.union(self.placed(map));
        }
        if self.whole.is_empty() {
            return swept;
        }
        let [center, half] = center_and_half(&self.whole);
        // Widens an instance by a fiftieth of its size.
        let sizes = |map: &Transform| (sizes_of(map) * half).length();
        let smallest = motion.keys().iter().map(|(_, map)| sizes(map)).fold(f64::INFINITY, f64::min);
        for (maps, distance) in motion.steps(center, half, 0.02 * smallest) {
            let along = maps.iter().fold(Aabb::EMPTY, |along, map| along.union(self.placed(map)));
            let reach = along.min.abs().max(along.max.abs());
            let rounding = 64.0 * f64::EPSILON * motion.condition() * reach.max_element();
            let margin = DVec3::splat(distance + rounding);
            swept = swept.union(Aabb { min: along.min - margin, max: along.max + margin });
        }
        swept
    }
}

/// Boxes per vector.
const EIGHT: usize = 8;

/// Half the sizes of eight boxes, by axis.
pub(crate) struct EightSizes {
    halves: [[f64; EIGHT]; 3],
}

impl EightSizes {
    /// For any number of boxes.
    pub(crate) fn of(boxes: &[Aabb]) -> Vec<Self> {
        boxes.chunks(EIGHT).map(Self::new).collect()
    }

    /// For up to eight boxes; repeats the first to fill up.
    fn new(boxes: &[Aabb]) -> Self {
        let half = |lane: usize| center_and_half(boxes.get(lane).unwrap_or(&boxes[0]))[1];
        Self { halves: [0, 1, 2].map(|axis| std::array::from_fn(|lane| half(lane)[axis])) }
    }

    /// Half the summed areas of the boxes around the images of `count` boxes.
    #[inline(always)]
    pub(crate) fn placed_area(boxes: &[Self], count: usize, placing: &Placing) -> f64 {
        let mut area = 0.0;
        for (i, eight) in boxes.iter().enumerate() {
            area += eight.area_of_first(count - EIGHT * i, placing);
        }
        area
    }

    #[inline(always)]
    fn area_of_first(&self, count: usize, placing: &Placing) -> f64 {
        let (halves, s) = (&self.halves, &placing.sizes);
        let mut areas = [0.0; EIGHT];
        for (lane, area) in areas.iter_mut().enumerate() {
            let [x, y, z] = [0, 1, 2].map(|axis| halves[axis][lane]);
            let size = |axis: usize| 2.0 * (s.x_axis[axis] * x + s.y_axis[axis] * y + s.z_axis[axis] * z);
            *area = size(0) * size(1) + size(1) * size(2) + size(2) * size(0);
        }
        areas[..count.min(EIGHT)].iter().sum()
    }
}

/// The box around the images of an outline's boxes.
struct Around<'a> {
    outline: &'a Outline,
    placing: &'a Placing,
}

impl Dispatch for Around<'_> {
    type Output = Option<Aabb>;

    #[inline(always)]
    fn run<L: Simd>(self) -> Option<Aabb> {
        self.outline.around::<L>(self.placing)
    }
}

/// Sixteen boxes in an outline's units.
struct SixteenBoxes {
    centers: [Row<f32>; 3],
    halves: [Row<f32>; 3],
}

impl SixteenBoxes {
    /// For up to sixteen boxes; repeats the first to fill up.
    fn new(boxes: &[[DVec3; 2]], middle: DVec3, unit: f64) -> Self {
        let rows = |number: &dyn Fn(&[DVec3; 2], usize) -> f64| {
            [0, 1, 2].map(|axis| {
                Row(std::array::from_fn(|lane| {
                    (number(boxes.get(lane).unwrap_or(&boxes[0]), axis) / unit) as f32
                }))
            })
        };
        Self {
            centers: rows(&|[center, _], axis| center[axis] - middle[axis]),
            halves: rows(&|[_, half], axis| half[axis]),
        }
    }
}

/// The range of the boxes' images on an axis, for that row of a map. Every instruction set performs the same
/// operations, so that trees are the same.
#[inline(always)]
fn images<W: F32x16>(boxes: &[SixteenBoxes], row: [f32; 3]) -> [f32; 2] {
    let [x, y, z] = [W::splat(row[0]), W::splat(row[1]), W::splat(row[2])];
    // The largest coordinates, and the largest negated ones.
    let (mut high, mut low) = (W::splat(f32::NEG_INFINITY), W::splat(f32::NEG_INFINITY));
    for SixteenBoxes { centers, halves } in boxes {
        let [cx, cy, cz] = [W::load(&centers[0].0), W::load(&centers[1].0), W::load(&centers[2].0)];
        let [hx, hy, hz] = [W::load(&halves[0].0), W::load(&halves[1].0), W::load(&halves[2].0)];
        let image = x * cx + y * cy + z * cz;
        let reach = x.abs() * hx + y.abs() * hy + z.abs() * hz;
        high = high.max(reach + image);
        low = low.max(reach - image);
    }
    [-low.reduce_max(), high.reduce_max()]
}

/// A node's box in space, from tree units.
pub(crate) fn box_in_space(tree_space: &TreeSpace, node: &Node, lane: usize) -> Aabb {
    let plane = |side: usize| {
        let planes = [0, 2, 4].map(|axis| f64::from(node.planes[axis + side][lane]));
        DVec3::from_array(planes) / tree_space.scale + tree_space.origin
    };
    // Rounded once more than the planes were.
    Aabb { min: plane(0), max: plane(1) }.outward(2)
}

/// A box around the image of a box (J. Arvo, "Transforming axis-aligned bounding boxes", Graphics Gems, 1990).
fn placed_bounds(bounds: &Aabb, map: &Transform) -> Aabb {
    if bounds.is_empty() {
        return Aabb::EMPTY;
    }
    let placing = Placing::of(map);
    let [center, half] = center_and_half(bounds);
    let image = map.affine().transform_point3(center);
    let reach = placing.sizes * half;
    let rounding = placing.rounding(center.abs() + half);
    Aabb { min: image - reach - rounding, max: image + reach + rounding }
}

/// The middle of a box, and half its size.
fn center_and_half(bounds: &Aabb) -> [DVec3; 2] {
    let center = bounds.center();
    [center, (bounds.max - center).max(center - bounds.min)]
}

/// The absolute values of a map's linear part.
#[inline(always)]
fn sizes_of(map: &Transform) -> DMat3 {
    let linear = map.linear();
    DMat3::from_cols(linear.x_axis.abs(), linear.y_axis.abs(), linear.z_axis.abs())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::tests::scenes::Random;

    #[test]
    fn what_is_placed_stays_within_its_box_which_is_hardly_larger() {
        let mut random = Random(411);
        for (size, offset) in [(1.0, 0.0), (1e-6, 3.0), (1e5, 0.0), (0.3, 1e6), (1e-30, 0.0), (1e30, 1.0)] {
            let origin = size * offset * DVec3::new(1.0, -0.7, 0.4);
            for _ in 0..300 {
                let boxes: Vec<_> = (0..1 + random.below(40))
                    .map(|_| {
                        let corner = origin + size * random.vector();
                        let other = corner + 0.2 * size * random.vector();
                        Aabb { min: corner.min(other), max: corner.max(other) }
                    })
                    .collect();
                let outline = Outline::of_boxes(&boxes);
                let mut factors = DVec3::splat(10f64.powf(random.between(-3.0, 3.0)));
                factors[random.below(3)] *= [1.0, -1.0, 1e-5][random.below(3)];
                let map = Transform::translate([0.0, 10.0][random.below(2)] * size * random.vector())
                    * Transform::rotate(random.vector(), random.between(-180.0, 180.0)).unwrap()
                    * Transform::scale(factors).unwrap();
                let mut exact = Aabb::EMPTY;
                for bounds in &boxes {
                    for corner in 0..8 {
                        let axis = |i: usize| (if corner >> i & 1 == 1 { bounds.max } else { bounds.min })[i];
                        let image = map.affine().transform_point3(DVec3::new(axis(0), axis(1), axis(2)));
                        exact = exact.union(Aabb { min: image, max: image });
                    }
                }
                let around = outline.part_at(&map.into()).expect("boxes");
                // The rounding errors of `exact` are far smaller than the outline's.
                assert!(around.min.cmple(exact.min).all() && around.max.cmpge(exact.max).all());
                let largest = factors.abs().max_element() * size;
                let rounding = 1e-14 * (1.0 + offset + 10.0 / factors.abs().max_element()) * largest;
                let slack = (exact.min - around.min).max(around.max - exact.max).max_element();
                assert!(slack < 1e-5 * largest + rounding, "{slack} of {largest}");
            }
        }
    }
}
