//! Boxes that together hold what is in a tree, and the box around them where the tree is placed.

use lumbre_geometry::Aabb;
use lumbre_math::{AnimatedTransform, DMat3, DVec3, Transform};

use crate::lanes::{Lanes, Level, Task};
use crate::node::{Node, Units, tag};
use crate::{Accel, Placement};

/// Boxes of an outline, about.
const OUTLINE: usize = 256;

/// Boxes of a tree that together hold what is finite in it. The box around an instance is that of many boxes, each taken over
/// by itself, which is tighter than the image of the whole.
pub(crate) struct Outline {
    whole: Aabb,
    boxes: Vec<EightBoxes>,
    /// No coordinate is larger.
    reach: DVec3,
}

impl Outline {
    /// Of a whole tree.
    pub(crate) fn of(inner: &Accel) -> Self {
        let whole = inner.bounds;
        match inner.tree.root.filter(|_| inner.infinite.is_empty()) {
            Some(root) => Self { whole, ..Self::below(inner, root, OUTLINE) },
            None => Self::of_box(whole),
        }
    }

    fn of_box(whole: Aabb) -> Self {
        Self { whole, boxes: Vec::new(), reach: DVec3::ZERO }
    }

    /// Of what is below a node, by one box more than this at most, or by those of its children where they are more; of a leaf, by none.
    pub(crate) fn below(inner: &Accel, reference: u32, count: usize) -> Self {
        let node = |reference: u32| {
            (reference >> tag::SHIFT == tag::INNER).then(|| &inner.tree.nodes[reference as usize])
        };
        let Some(root) = node(reference) else { return Self::of_box(Aabb::EMPTY) };
        let children = |node: &Node| -> Vec<(Aabb, u32)> {
            (0..node.len())
                .map(|lane| (box_in_space(&inner.units, node, lane), node.children[lane]))
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
        let whole = open.iter().fold(Aabb::EMPTY, |whole, (bounds, _)| whole.union(*bounds));
        let boxes: Vec<_> = open.iter().map(|(bounds, _)| center_and_half(bounds)).collect();
        let reach = boxes.iter().fold(DVec3::ZERO, |most, [center, half]| most.max(center.abs() + *half));
        Self { whole, boxes: EightBoxes::of(&boxes), reach }
    }

    /// A box around it at all times, whatever is the box around the whole tree; `None` where nothing is known but that.
    pub(crate) fn part_at(&self, placement: &Placement) -> Option<Aabb> {
        match placement {
            Placement::Still(map) => Level::best().run(Around { outline: self, placing: &Placing::of(map) }),
            Placement::Moving(motion) => (!self.boxes.is_empty()).then(|| self.swept(motion)),
        }
    }

    /// A box around it at all times.
    pub(crate) fn at(&self, placement: &Placement) -> Aabb {
        match placement {
            Placement::Still(map) => self.placed(map),
            Placement::Moving(motion) => self.swept(motion),
        }
    }

    fn placed(&self, map: &Transform) -> Aabb {
        let (whole, placing) = (placed_bounds(&self.whole, map), Placing::of(map));
        match Level::best().run(Around { outline: self, placing: &placing }) {
            // Each bounds it, so that their common part does.
            Some(parts) => Aabb { min: parts.min.max(whole.min), max: parts.max.min(whole.max) },
            None => whole,
        }
    }

    /// The box around the images of its boxes; `None` where there are none.
    #[inline(always)]
    pub(crate) fn around(&self, placing: &Placing) -> Option<Aabb> {
        if self.boxes.is_empty() {
            return None;
        }
        let [min, max] = images(&self.boxes, placing);
        let rounding = placing.rounding(self.reach);
        let (min, max) = (min + placing.translation, max + placing.translation);
        Some(Aabb { min: min - rounding, max: max + rounding })
    }
}

/// A map, and what else the images of boxes need of it.
pub(crate) struct Placing {
    linear: DMat3,
    /// The sizes of its numbers.
    sizes: DMat3,
    translation: DVec3,
}

impl Placing {
    #[inline(always)]
    pub(crate) fn of(map: &Transform) -> Self {
        Self { linear: map.linear(), sizes: sizes_of(map), translation: map.affine().translation }
    }

    /// By how much the image of a box with no larger coordinates than `reach` may be wrong.
    #[inline(always)]
    fn rounding(&self, reach: DVec3) -> DVec3 {
        8.0 * f64::EPSILON * (self.sizes * reach + self.translation.abs())
    }
}

impl Outline {
    /// The same of what moves.
    ///
    /// Every point of the outline goes, between two neighbours of a list of steps, along a curve that stays within a certain
    /// distance of its chord. The ends of the chord lie in the boxes at the two steps, so that all of the chord lies in the
    /// box around both: the curve lies in that box when it is widened by the distance. Before the first key and after the
    /// last, everything is as at these. What rounds in a map between two keys is a few 2⁻⁵³ of what the maps at the keys make
    /// of the outline, times their condition.
    fn swept(&self, motion: &AnimatedTransform) -> Aabb {
        let mut swept = Aabb::EMPTY;
        for (_, map) in motion.keys() {
            swept = swept.union(self.placed(map));
        }
        if self.whole.is_empty() {
            return swept;
        }
        let [center, half] = center_and_half(&self.whole);
        // An instance grows by a fiftieth of its size.
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

/// How many boxes are taken over at a time.
const EIGHT: usize = 8;

/// The middles of eight boxes and half their sizes, by axes.
pub(crate) struct EightBoxes {
    centers: [[f64; EIGHT]; 3],
    halves: [[f64; EIGHT]; 3],
}

impl EightBoxes {
    /// Of any number.
    pub(crate) fn of(boxes: &[[DVec3; 2]]) -> Vec<Self> {
        boxes.chunks(EIGHT).map(Self::new).collect()
    }

    /// Of some; where there are fewer, the first comes again.
    fn new(boxes: &[[DVec3; 2]]) -> Self {
        let component = |part: usize, axis: usize| {
            std::array::from_fn(|lane| boxes.get(lane).unwrap_or(&boxes[0])[part][axis])
        };
        let components = |part: usize| [0, 1, 2].map(|axis| component(part, axis));
        Self { centers: components(0), halves: components(1) }
    }
}

impl EightBoxes {
    /// Half the areas of the boxes around the images of `count` boxes, together.
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

impl Task for Around<'_> {
    type Output = Option<Aabb>;

    #[inline(always)]
    fn run<L: Lanes>(self) -> Option<Aabb> {
        self.outline.around(self.placing)
    }
}

/// The corners of the box around the images of boxes, the translation apart.
#[inline(always)]
fn images(boxes: &[EightBoxes], placing: &Placing) -> [DVec3; 2] {
    let mut low = [[f64::INFINITY; EIGHT]; 3];
    let mut high = [[f64::NEG_INFINITY; EIGHT]; 3];
    for EightBoxes { centers, halves } in boxes {
        for axis in 0..3 {
            let row = |m: &DMat3| [m.x_axis[axis], m.y_axis[axis], m.z_axis[axis]];
            let (m, s) = (row(&placing.linear), row(&placing.sizes));
            for lane in 0..EIGHT {
                let image = m[0] * centers[0][lane] + m[1] * centers[1][lane] + m[2] * centers[2][lane];
                let reach = s[0] * halves[0][lane] + s[1] * halves[1][lane] + s[2] * halves[2][lane];
                let (first, last) = (image - reach, image + reach);
                low[axis][lane] = if first < low[axis][lane] { first } else { low[axis][lane] };
                high[axis][lane] = if last > high[axis][lane] { last } else { high[axis][lane] };
            }
        }
    }
    let least = |lanes: [f64; EIGHT]| lanes.into_iter().fold(f64::INFINITY, |a, b| if b < a { b } else { a });
    let most =
        |lanes: [f64; EIGHT]| lanes.into_iter().fold(f64::NEG_INFINITY, |a, b| if b > a { b } else { a });
    [DVec3::from_array(low.map(least)), DVec3::from_array(high.map(most))]
}

/// A node's box, back from tree units.
pub(crate) fn box_in_space(units: &Units, node: &Node, lane: usize) -> Aabb {
    let plane = |side: usize| {
        let planes = [0, 2, 4].map(|axis| f64::from(node.planes[axis + side][lane]));
        DVec3::from_array(planes) / units.scale + units.origin
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
pub(crate) fn center_and_half(bounds: &Aabb) -> [DVec3; 2] {
    let center = bounds.center();
    [center, (bounds.max - center).max(center - bounds.min)]
}

/// The sizes of the numbers of a map's linear part.
#[inline(always)]
fn sizes_of(map: &Transform) -> DMat3 {
    let linear = map.linear();
    DMat3::from_cols(linear.x_axis.abs(), linear.y_axis.abs(), linear.z_axis.abs())
}
