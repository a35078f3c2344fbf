//! Fields of heights over the unit square, as POV-Ray divides and smooths them.

use lumbre_geometry::{Aabb, Ray, Root, Roots};
use lumbre_math::{DVec2, DVec3};

/// Heights are whole numbers below this, and 1 is this.
pub(super) const LEVELS: f64 = 65_536.0;
/// Normals of nodes are kept in whole parts of this.
const NORMAL_PARTS: f64 = 32_767.0;
/// By how much the boxes of flat cells are thicker than these.
const MARGIN: f64 = 1e-9;

/// A height at each node of a grid; each cell is two triangles, split where x + z is the same. Inside is below it.
#[derive(Clone, Debug)]
pub(super) struct Heights {
    /// Nodes along x and z.
    size: [u32; 2],
    /// Row by row, the first at z = 0.
    heights: Vec<f32>,
    /// Nothing below it is seen.
    water: f64,
    is_smooth: bool,
    /// The least and the greatest height of blocks of 1, 2, 4, … cells along each side.
    blocks: Vec<Blocks>,
}

#[derive(Clone, Debug)]
struct Blocks {
    size: [u32; 2],
    ranges: Vec<[f32; 2]>,
}

impl Heights {
    /// At least two nodes along each side; row by row, the first at z = 0.
    pub(super) fn new(size: [u32; 2], heights: Vec<f32>, water: f64, is_smooth: bool) -> Self {
        let cells = [size[0] - 1, size[1] - 1];
        let mut ranges = Vec::with_capacity((cells[0] * cells[1]) as usize);
        for z in 0..cells[1] {
            for x in 0..cells[0] {
                let at = |dx, dz| heights[((z + dz) * size[0] + x + dx) as usize];
                let corners = [at(0, 0), at(1, 0), at(0, 1), at(1, 1)];
                let least = corners.iter().copied().fold(f32::INFINITY, f32::min);
                ranges.push([least, corners.iter().copied().fold(f32::NEG_INFINITY, f32::max)]);
            }
        }
        let mut blocks = vec![Blocks { size: cells, ranges }];
        while let Some(last) = blocks.last()
            && last.size != [1, 1]
        {
            let wider = last.halved();
            blocks.push(wider);
        }
        Self { size, heights, water, is_smooth, blocks }
    }

    fn height(&self, x: u32, z: u32) -> f64 {
        f64::from(self.heights[(z * self.size[0] + x) as usize])
    }

    /// Cells along a side.
    fn cells(&self) -> DVec2 {
        DVec2::new(f64::from(self.size[0] - 1), f64::from(self.size[1] - 1))
    }

    pub(super) fn bounds(&self) -> Aabb {
        let [low, high] = self.blocks.last().map_or([0.0, 1.0], |all| all.ranges[0]);
        Aabb {
            min: DVec3::new(0.0, f64::from(low) - MARGIN, 0.0),
            max: DVec3::new(1.0, f64::from(high) + MARGIN, 1.0),
        }
    }

    /// The cell of a point of the unit square, and where in it that is.
    fn cell(&self, x: f64, z: f64) -> ([u32; 2], DVec2) {
        let at = DVec2::new(x, z).clamp(DVec2::ZERO, DVec2::ONE) * self.cells();
        let corner = at.floor().min(self.cells() - DVec2::ONE);
        ([corner.x as u32, corner.y as u32], at - corner)
    }

    /// The height in a cell.
    fn height_in(&self, [x, z]: [u32; 2], at: DVec2) -> f64 {
        let (a, b) = (self.height(x + 1, z), self.height(x, z + 1));
        if at.x + at.y <= 1.0 {
            let corner = self.height(x, z);
            corner + at.x * (a - corner) + at.y * (b - corner)
        } else {
            let corner = self.height(x + 1, z + 1);
            corner + (1.0 - at.x) * (b - corner) + (1.0 - at.y) * (a - corner)
        }
    }

    pub(super) fn contains(&self, p: DVec3) -> bool {
        let is_over = (0.0..=1.0).contains(&p.x) && (0.0..=1.0).contains(&p.z);
        let (cell, at) = self.cell(p.x, p.z);
        is_over && p.y < self.height_in(cell, at).max(self.water)
    }

    pub(super) fn normal(&self, p: DVec3) -> DVec3 {
        let ([x, z], at) = self.cell(p.x, p.z);
        if self.is_smooth {
            let (s, t) = (at.x, at.y);
            return self.node_normal(x, z) * ((1.0 - s) * (1.0 - t))
                + self.node_normal(x + 1, z) * (s * (1.0 - t))
                + self.node_normal(x, z + 1) * ((1.0 - s) * t)
                + self.node_normal(x + 1, z + 1) * (s * t);
        }
        let (a, b) = (self.height(x + 1, z), self.height(x, z + 1));
        let slope = if at.x + at.y <= 1.0 {
            let corner = self.height(x, z);
            DVec2::new(a - corner, b - corner)
        } else {
            let corner = self.height(x + 1, z + 1);
            DVec2::new(corner - b, corner - a)
        } * self.cells();
        DVec3::new(-slope.x, 1.0, -slope.y)
    }

    /// The mean of the normals of a node with two of its neighbours, where the height is measured in its levels and the
    /// sides in cells: so steep that flat parts outweigh steep ones by far. POV-Ray keeps it in 16 bits.
    fn node_normal(&self, x: u32, z: u32) -> DVec3 {
        let here = self.height(x, z);
        let steps = |at: u32, count: u32| {
            let before = (at > 0).then(|| at - 1);
            let after = (at + 1 < count).then(|| at + 1);
            [(before, -1.0), (after, 1.0)]
        };
        let mut sum = DVec3::ZERO;
        for (beside, dx) in steps(x, self.size[0]) {
            let Some(beside) = beside else { continue };
            let across = (self.height(beside, z) - here) * dx * LEVELS;
            for (behind, dz) in steps(z, self.size[1]) {
                let Some(behind) = behind else { continue };
                let along = (self.height(x, behind) - here) * dz * LEVELS;
                sum += DVec3::new(-across, 1.0, -along).normalize();
            }
        }
        let kept = (sum.normalize_or(DVec3::Y) * NORMAL_PARTS).trunc();
        let cells = self.cells();
        (kept * DVec3::new(cells.x, LEVELS, cells.y)).normalize_or(DVec3::Y)
    }

    pub(super) fn roots(&self, ray: &Ray, out: &mut Roots) {
        let mut open = vec![(self.blocks.len() - 1, [0, 0])];
        while let Some((level, [x, z])) = open.pop() {
            let blocks = &self.blocks[level];
            let [low, high] = blocks.ranges[(z * blocks.size[0] + x) as usize];
            let Some(range) = self.range_in(ray, level, [x, z], [low, high]) else { continue };
            if level == 0 {
                self.roots_in(ray, [x, z], range, out);
                continue;
            }
            let below = self.blocks[level - 1].size;
            for dz in 0..2 {
                for dx in 0..2 {
                    let part = [2 * x + dx, 2 * z + dz];
                    if part[0] < below[0] && part[1] < below[1] {
                        open.push((level - 1, part));
                    }
                }
            }
        }
        out.sort_by(|a, b| a.t.total_cmp(&b.t));
    }

    /// Where a ray is within the box around a block.
    fn range_in(&self, ray: &Ray, level: usize, block: [u32; 2], [low, high]: [f32; 2]) -> Option<[f64; 2]> {
        if f64::from(high) < self.water {
            return None;
        }
        let side = 1_u32 << level;
        let cells = self.cells();
        let edge = |i: u32, axis: usize| (f64::from(i) * f64::from(side) / cells[axis]).min(1.0);
        let min = DVec3::new(edge(block[0], 0), f64::from(low) - MARGIN, edge(block[1], 1));
        let max = DVec3::new(edge(block[0] + 1, 0), f64::from(high) + MARGIN, edge(block[1] + 1, 1));
        let (mut near, mut far) = (f64::NEG_INFINITY, f64::INFINITY);
        for axis in 0..3 {
            let (o, d) = (ray.origin[axis], ray.direction[axis]);
            if d == 0.0 {
                // A border belongs to the cell behind it, or a ray along it would cross twice.
                let is_inside = o < max[axis] || o == max[axis] && (level > 0 || axis == 1 || o == 1.0);
                if o < min[axis] || !is_inside {
                    return None;
                }
                continue;
            }
            let (a, b) = ((min[axis] - o) / d, (max[axis] - o) / d);
            near = near.max(a.min(b));
            far = far.min(a.max(b));
        }
        let is_met = near <= far && near <= ray.t_max && ray.t_min <= far;
        is_met.then_some([near, far])
    }

    /// Where a ray crosses the triangles of a cell.
    fn roots_in(&self, ray: &Ray, cell: [u32; 2], [near, far]: [f64; 2], out: &mut Roots) {
        let cells = self.cells();
        let corner = DVec2::new(f64::from(cell[0]), f64::from(cell[1]));
        let place = |t: f64| {
            let p = ray.at(t);
            (p.y, DVec2::new(p.x, p.z) * cells - corner)
        };
        // The two triangles are halves of the plane, on either side of where s + t is 1.
        let (start, end) = (place(near).1, place(far).1);
        let (first, last) = (start.x + start.y - 1.0, end.x + end.y - 1.0);
        let middle =
            if (first > 0.0) == (last > 0.0) { far } else { near + (far - near) * first / (first - last) };
        let above = |t: f64, is_upper: bool| {
            let (y, at) = place(t);
            let (a, b) = (self.height(cell[0] + 1, cell[1]), self.height(cell[0], cell[1] + 1));
            let plane = if is_upper {
                let corner = self.height(cell[0] + 1, cell[1] + 1);
                corner + (1.0 - at.x) * (b - corner) + (1.0 - at.y) * (a - corner)
            } else {
                let corner = self.height(cell[0], cell[1]);
                corner + at.x * (a - corner) + at.y * (b - corner)
            };
            y - plane
        };
        for (from, to, is_upper) in [(near, middle, first > 0.0), (middle, far, last > 0.0)] {
            if from == to {
                continue;
            }
            let (a, b) = (above(from, is_upper), above(to, is_upper));
            if (a >= 0.0) == (b >= 0.0) {
                continue;
            }
            let t = from + (to - from) * a / (a - b);
            if ray.contains(t) && ray.at(t).y >= self.water {
                out.push(Root::at(t));
            }
        }
    }
}

impl Blocks {
    /// Blocks of twice the side.
    fn halved(&self) -> Self {
        let size = self.size.map(|n| n.div_ceil(2));
        let mut ranges = Vec::with_capacity((size[0] * size[1]) as usize);
        for z in 0..size[1] {
            for x in 0..size[0] {
                let mut range = [f32::INFINITY, f32::NEG_INFINITY];
                for dz in 0..2 {
                    for dx in 0..2 {
                        let (x, z) = (2 * x + dx, 2 * z + dz);
                        if x < self.size[0] && z < self.size[1] {
                            let [low, high] = self.ranges[(z * self.size[0] + x) as usize];
                            range = [range[0].min(low), range[1].max(high)];
                        }
                    }
                }
                ranges.push(range);
            }
        }
        Self { size, ranges }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn hills(is_smooth: bool, water: f64) -> Heights {
        let size = [9, 6];
        let at = |i: u32| 0.5 + 0.3 * (f64::from(i * 37 % 54) / 54.0).sin();
        let heights = (0..size[0] * size[1]).map(|i| at(i) as f32).collect();
        Heights::new(size, heights, water, is_smooth)
    }

    #[test]
    fn a_ray_crosses_where_it_comes_to_the_other_side() {
        let field = hills(false, 0.0);
        let mut crossings = 0;
        for i in 0..400_u32 {
            let spread = |k: u32| f64::from((i * k) % 97) / 97.0;
            let origin = DVec3::new(spread(13) * 2.0 - 0.5, 0.2 + spread(29), -0.3);
            let ray =
                Ray::new(origin, DVec3::new(spread(5) - 0.5, 0.7 * (spread(3) - 0.5), 1.0 + spread(17)));
            let mut roots = Roots::new();
            field.roots(&ray, &mut roots);
            // Between crossings a ray stays on its side, and at each it changes it.
            for root in &roots {
                let (before, after) = (ray.at(root.t - 1e-7), ray.at(root.t + 1e-7));
                if field.contains(before) == field.contains(after) {
                    // It came in or went out by the edge of the field there.
                    let p = ray.at(root.t);
                    assert!(p.x.min(p.z) < 1e-6 || p.x.max(p.z) > 1.0 - 1e-6, "{i}: {p}");
                }
                crossings += 1;
            }
            for pair in roots.windows(2) {
                let side = |share: f64| field.contains(ray.at(pair[0].t + share * (pair[1].t - pair[0].t)));
                assert!([0.2, 0.4, 0.6, 0.8].iter().all(|share| side(*share) == side(0.1)), "{i}");
            }
        }
        assert!(crossings > 50, "{crossings}");
    }

    #[test]
    fn rays_straight_down_meet_the_height_or_the_water() {
        let (field, wet) = (hills(false, 0.0), hills(false, 0.6));
        let mut drowned = 0;
        for i in 0..200_u32 {
            let (x, z) = (f64::from(i * 37 % 201) / 200.5, f64::from(i * 53 % 203) / 202.5);
            let ray = Ray::new(DVec3::new(x, 3.0, z), -DVec3::Y);
            let (cell, at) = field.cell(x, z);
            let expected = field.height_in(cell, at);
            let mut roots = Roots::new();
            field.roots(&ray, &mut roots);
            assert_eq!(roots.len(), 1);
            assert!((ray.at(roots[0].t).y - expected).abs() < 1e-12);
            roots.clear();
            wet.roots(&ray, &mut roots);
            assert_eq!(roots.is_empty(), expected < 0.6);
            drowned += u32::from(roots.is_empty());
        }
        assert!(0 < drowned && drowned < 200, "{drowned}");
    }

    #[test]
    fn a_smooth_field_has_the_normals_that_povray_prints() {
        // height_field { function 5,5 {0.5+0.4*sin(7*x+1.3)*cos(5*y+0.4)+0.05*sin(31*x*y)} smooth }, by trace() from
        // above.
        let size = [5_u32, 5];
        let mut heights = Vec::new();
        for j in 0..5 {
            for i in 0..5 {
                let (x, y) = (f64::from(i) / 4.0, 1.0 - f64::from(j) / 4.0);
                let value =
                    0.5 + 0.4 * (7.0 * x + 1.3).sin() * (5.0 * y + 0.4).cos() + 0.05 * (31.0 * x * y).sin();
                heights.push(((value * 65_535.0).floor() / 65_536.0) as f32);
            }
        }
        let field = Heights::new(size, heights, 0.0, true);
        for (t, normal) in [
            (0.01, DVec3::new(-0.70691, 0.69864, -0.11037)),
            (0.5, DVec3::new(-0.36487, 0.90672, 0.21150)),
            (0.99, DVec3::new(0.05130, 0.88281, 0.46692)),
        ] {
            let found = field.normal(DVec3::new(0.25 + 0.25 * t, 0.0, 0.575)).normalize();
            assert!((found - normal).length() < 1e-4, "{t}: {found}");
        }
    }
}
