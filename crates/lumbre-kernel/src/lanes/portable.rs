//! Plain loops over arrays, for any machine.

use std::mem::MaybeUninit;

use lumbre_geometry::Ray;

use super::{LANE_BITS, Lanes, Slots};
use crate::node::{BoxRay, Node, Units, WIDTH};
use crate::stack::stack_entry;
use crate::triangles::{BLOCK, BlockRay, Inside, Passage, Shear, TriangleBlock, passage};

pub(crate) struct Portable;

impl Lanes for Portable {
    type Keys = [i32; WIDTH];

    #[inline(always)]
    fn start_nearby(units: &Units, ray: &Ray, t_min: f64, t_max: f64, boxes: &mut BoxRay) -> bool {
        boxes.start_nearby(units, ray, t_min, t_max)
    }

    #[inline(always)]
    fn meet_boxes(node: &Node, ray: &BoxRay) -> (u32, [i32; WIDTH]) {
        let mut enter = [ray.s_min; WIDTH];
        let mut leave = [ray.s_max; WIDTH];
        let planes = node.planes.as_flattened();
        for axis in 0..3 {
            let near = ray.sides.near[axis];
            let (near_planes, far_planes) = (&planes[near..][..WIDTH], &planes[near ^ WIDTH..][..WIDTH]);
            for lane in 0..WIDTH {
                let first = near_planes[lane] * ray.inverse[axis] + ray.near_offset[axis];
                let last = far_planes[lane] * ray.inverse[axis] + ray.far_offset[axis];
                enter[lane] = if first > enter[lane] { first } else { enter[lane] };
                leave[lane] = if last < leave[lane] { last } else { leave[lane] };
            }
        }
        let mut mask = 0;
        let mut keys = [0; WIDTH];
        for lane in 0..WIDTH {
            mask |= u32::from(enter[lane] <= leave[lane]) << lane;
            // Never negative, so that the bits have the order of the numbers.
            keys[lane] = enter[lane].to_bits() as i32 & !LANE_BITS | lane as i32;
        }
        (mask, keys)
    }

    #[inline(always)]
    fn only_child(node: &Node, mask: u32) -> u32 {
        node.children[mask.trailing_zeros() as usize % WIDTH]
    }

    #[inline(always)]
    fn push_by_distance(node: &Node, mask: u32, keys: [i32; WIDTH], slots: &mut Slots<i64>) -> u32 {
        let window = slots.next_eight();
        let mut nearest = 0;
        // Where each goes is how many are farther: no two have one key, so that the first places are all written.
        for lane in (0..WIDTH).filter(|lane| mask >> lane & 1 != 0) {
            let is_farther = |other: &usize| mask >> other & 1 != 0 && keys[*other] > keys[lane];
            let place = (0..WIDTH).filter(is_farther).count();
            window[place % WIDTH] = MaybeUninit::new(stack_entry(keys[lane], node.children[lane]));
            if place + 1 == mask.count_ones() as usize {
                nearest = node.children[lane];
            }
        }
        slots.len += (mask & 0xff).count_ones() as usize - 1;
        nearest
    }

    #[inline(always)]
    fn push_as_built(node: &Node, mask: u32, slots: &mut Slots<u32>) -> u32 {
        let mut rest = mask;
        while rest & (rest - 1) != 0 {
            slots.push(node.children[rest.trailing_zeros() as usize % WIDTH]);
            rest &= rest - 1;
        }
        node.children[rest.trailing_zeros() as usize % WIDTH]
    }

    #[inline(always)]
    fn meet_triangles<const SURE: bool>(block: &TriangleBlock, ray: &BlockRay) -> (u32, u32) {
        if !ray.is_sharp {
            return ((1 << BLOCK) - 1, 0);
        }
        let mut x = [[0.0; BLOCK]; 3];
        let mut y = [[0.0; BLOCK]; 3];
        let mut z = [[0.0; BLOCK]; 3];
        let [kx, ky, kz] = ray.axes.order;
        for corner in 0..3 {
            let axes = &block.corners[corner];
            for lane in 0..BLOCK {
                let height = axes[kz][lane] - ray.origin[2];
                x[corner][lane] = (axes[kx][lane] - ray.origin[0]) - ray.shear_x * height;
                y[corner][lane] = (axes[ky][lane] - ray.origin[1]) - ray.shear_y * height;
                z[corner][lane] = height;
            }
        }
        let (mut mask, mut sure) = (0, 0);
        for lane in 0..BLOCK {
            let edge = |p: usize, q: usize| x[p][lane] * y[q][lane] - y[p][lane] * x[q][lane];
            let (u, v, w) = (edge(2, 1), edge(0, 2), edge(1, 0));
            let size = (0..3).fold(0.0f32, |size, i| size.max(x[i][lane].abs()).max(y[i][lane].abs()));
            let error = size * ray.error_slope + ray.error_least;
            let (least, most) = (u.min(v).min(w), u.max(v).max(w));
            let [a, b, c] = [z[0][lane], z[1][lane], z[2][lane]];
            let (low, high) = (a.min(b).min(c), a.max(b).max(c));
            // Comparisons with a NaN, which unused lanes have, are false.
            let may_be_inside = least >= -error || most <= error;
            if !(may_be_inside && high >= ray.z_low && low <= ray.z_high) {
                continue;
            }
            mask |= 1 << lane;
            if SURE && (least > 2.0 * error || most < -2.0 * error) {
                let inverse = 1.0 / (u + v + w);
                // Shares first: their products with lengths do not underflow.
                let height = (u * inverse) * a + (v * inverse) * b + (w * inverse) * c;
                let ahead = if ray.is_backward { -height } else { height };
                let spread = ((error * 12.5) * inverse.abs()) * (high - low) + ray.z_error;
                let (from, to) = (ahead - spread, ahead + spread);
                if ray.surely_in[0] <= from && to <= ray.surely_in[1] {
                    sure |= 1 << lane;
                }
            }
        }
        (mask, sure)
    }

    #[inline(always)]
    fn pass(block: &TriangleBlock, lane: usize, shear: &Shear, origin: &[f64; 3]) -> (Passage, Inside) {
        passage(shear, origin, &shear.axes.gather(block, lane))
    }
}
