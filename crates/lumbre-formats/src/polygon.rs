//! Triangulation of polygons.

use lumbre_math::{DVec2, DVec3, Vec3};

/// The number of point-in-triangle tests after which a polygon is given up, less than a second's worth.
const MAX_TESTS: u64 = 100_000_000;

/// Whether the corners, which need not be coplanar, turn the same way throughout as seen along their mean
/// normal.
pub(crate) fn is_convex(corners: &[Vec3]) -> bool {
    let flat = flattened(corners);
    turns_one_way(&flat)
}

/// `corners.len() - 2` triangles, by indices into `corners`, with the polygon's orientation; `None` when a
/// polygon of tens of thousands of corners is so winding that it takes too long.
///
/// Convex polygons become a fan about their first corner. Others are triangulated by ear clipping (G. H.
/// Meisters, "Polygons have ears", American Mathematical Monthly, 1975). A self-intersecting polygon has no
/// right answer: when there is no ear, its least bad corner is clipped, so that the number of triangles is the
/// same.
pub(crate) fn triangulate(corners: &[Vec3]) -> Option<Vec<[usize; 3]>> {
    let count = corners.len();
    if count < 3 {
        return Some(vec![]);
    }
    let flat = if count == 3 { vec![] } else { flattened(corners) };
    if count == 3 || turns_one_way(&flat) {
        return Some((1..count - 1).map(|i| [0, i, i + 1]).collect());
    }
    cut_ears(&flat)
}

/// The corners projected against their mean normal, counter-clockwise; a coordinate is dropped, so that the
/// others stay exact.
fn flattened(corners: &[Vec3]) -> Vec<DVec2> {
    // M. Newell's normal, as in I. Sutherland and others, "A characterization of ten hidden-surface
    // algorithms", 1974, relative to the first corner to avoid cancellation far from the origin.
    let origin = corners[0].as_dvec3();
    let mut normal = DVec3::ZERO;
    for (i, a) in corners.iter().enumerate() {
        let b = corners[(i + 1) % corners.len()];
        normal += (a.as_dvec3() - origin).cross(b.as_dvec3() - origin);
    }
    let size = normal.abs();
    let seen = |p: &Vec3| {
        let p = p.as_dvec3();
        if size.x >= size.y && size.x >= size.z {
            if normal.x > 0.0 { DVec2::new(p.y, p.z) } else { DVec2::new(p.z, p.y) }
        } else if size.y >= size.z {
            if normal.y > 0.0 { DVec2::new(p.z, p.x) } else { DVec2::new(p.x, p.z) }
        } else if normal.z > 0.0 {
            DVec2::new(p.x, p.y)
        } else {
            DVec2::new(p.y, p.x)
        }
    };
    corners.iter().map(seen).collect()
}

/// Twice the signed area of a triangle, positive counter-clockwise.
fn area(a: DVec2, b: DVec2, c: DVec2) -> f64 {
    (b - a).perp_dot(c - a)
}

/// No right turn, and a total turn of 360°: every fan triangle is then inside.
fn turns_one_way(flat: &[DVec2]) -> bool {
    let count = flat.len();
    let left = (0..count).all(|i| area(flat[i], flat[(i + 1) % count], flat[(i + 2) % count]) >= 0.0);
    left && (1..count - 1).all(|i| area(flat[0], flat[i], flat[i + 1]) >= 0.0)
}

/// The reflex corners in a square grid over the polygon, with about one cell per corner.
struct Reflex {
    least: DVec2,
    cells_per_length: DVec2,
    side: usize,
    /// Corners by cell, including ones that are no longer reflex.
    cells: Vec<Vec<u32>>,
    is_reflex: Vec<bool>,
}

impl Reflex {
    fn new(flat: &[DVec2], is_reflex: Vec<bool>) -> Self {
        let least = flat.iter().copied().reduce(DVec2::min).unwrap_or_default();
        let most = flat.iter().copied().reduce(DVec2::max).unwrap_or_default();
        let side = (is_reflex.iter().filter(|r| **r).count() as f64).sqrt().ceil().max(1.0) as usize;
        let cells_per_length = (side as f64 / (most - least)).map(|c| if c.is_finite() { c } else { 0.0 });
        let mut grid = Self { least, cells_per_length, side, cells: vec![vec![]; side * side], is_reflex };
        for (i, p) in flat.iter().enumerate() {
            if grid.is_reflex[i] {
                let [x, y] = grid.cell(*p);
                grid.cells[y * side + x].push(i as u32);
            }
        }
        grid
    }

    /// The cast saturates outside the grid, and maps NaN to 0.
    fn cell(&self, p: DVec2) -> [usize; 2] {
        let at = (p - self.least) * self.cells_per_length;
        [at.x, at.y].map(|c| (c as usize).min(self.side - 1))
    }

    /// Whether a reflex corner is in the closed triangle. A corner at the position of one of the triangle's
    /// does not count.
    fn any_in(&self, flat: &[DVec2], [a, b, c]: [DVec2; 3], tests: &mut u64) -> bool {
        let low = self.cell(a.min(b).min(c));
        let high = self.cell(a.max(b).max(c));
        for y in low[1]..=high[1] {
            for cell in &self.cells[y * self.side + low[0]..=y * self.side + high[0]] {
                *tests += 1 + cell.len() as u64;
                let holds = |&r: &u32| {
                    let p = flat[r as usize];
                    self.is_reflex[r as usize]
                        && area(a, b, p) >= 0.0
                        && area(b, c, p) >= 0.0
                        && area(c, a, p) >= 0.0
                        && p != a
                        && p != b
                        && p != c
                };
                if cell.iter().any(holds) {
                    return true;
                }
            }
        }
        false
    }
}

fn cut_ears(flat: &[DVec2]) -> Option<Vec<[usize; 3]>> {
    let count = flat.len();
    let mut next: Vec<usize> = (0..count).map(|i| (i + 1) % count).collect();
    let mut before: Vec<usize> = (0..count).map(|i| (i + count - 1) % count).collect();
    let turn = |before: &[usize], next: &[usize], i: usize| area(flat[before[i]], flat[i], flat[next[i]]);
    // Only a reflex corner can be in an ear. Clipping never makes a corner reflex.
    let mut reflex = Reflex::new(flat, (0..count).map(|i| turn(&before, &next, i) <= 0.0).collect());
    let mut triangles = Vec::with_capacity(count - 2);
    let mut at = 0;
    let mut left = count;
    let mut tried = 0;
    let mut tests = 0;
    let mut least_bad: Option<(f64, usize)> = None;
    while left > 3 {
        let corners = [flat[before[at]], flat[at], flat[next[at]]];
        let [a, b, c] = corners;
        let bulge = area(a, b, c);
        let is_ear = bulge > 0.0 && !reflex.any_in(flat, corners, &mut tests);
        // A corner that returns to its neighbour's position encloses no area.
        let is_flat = bulge == 0.0 && (a == b || b == c || a == c);
        if least_bad.is_none_or(|(most, _)| bulge > most) {
            least_bad = Some((bulge, at));
        }
        let cut = match least_bad {
            _ if is_ear || is_flat => at,
            Some((_, worst)) if tried + 1 >= left => worst,
            _ => {
                tried += 1;
                at = next[at];
                if tests > MAX_TESTS {
                    return None;
                }
                continue;
            }
        };
        let [a, c] = [before[cut], next[cut]];
        triangles.push([a, cut, c]);
        next[a] = c;
        before[c] = a;
        left -= 1;
        tried = 0;
        least_bad = None;
        reflex.is_reflex[cut] = false;
        for neighbour in [a, c] {
            reflex.is_reflex[neighbour] &= turn(&before, &next, neighbour) <= 0.0;
        }
        tests += 1;
        if tests > MAX_TESTS {
            return None;
        }
        // Continuing past the cut avoids a fan of slivers in long polygons.
        at = next[c];
    }
    triangles.push([before[at], at, next[at]]);
    Some(triangles)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn total(corners: &[Vec3], triangles: &[[usize; 3]]) -> (DVec3, f64) {
        let mut sum = DVec3::ZERO;
        let mut size = 0.0;
        for t in triangles {
            let [a, b, c] = t.map(|i| corners[i].as_dvec3());
            let n = (b - a).cross(c - a) / 2.0;
            sum += n;
            size += n.length();
        }
        (sum, size)
    }

    /// Triangles of a plane polygon cover it without overlap when their areas add up to its own, all one way.
    fn covers(corners: &[Vec3]) {
        let triangles = triangulate(corners).unwrap();
        assert_eq!(triangles.len(), corners.len() - 2);
        let (sum, size) = total(corners, &triangles);
        let fan: Vec<_> = (1..corners.len() - 1).map(|i| [0, i, i + 1]).collect();
        let (exact, _) = total(corners, &fan);
        assert!((sum - exact).length() < 1e-6 * exact.length(), "{sum} {exact}");
        assert!((size - exact.length()).abs() < 1e-6 * size, "{size} {}", exact.length());
    }

    /// The same polygon in several planes, and with each corner first.
    fn everywhere(flat: &[[f32; 2]]) {
        let planes: [fn(f32, f32) -> Vec3; 5] = [
            |x, y| Vec3::new(x, y, 7.0),
            |x, y| Vec3::new(y, x, -3.0),
            |x, y| Vec3::new(2.0, x, y),
            |x, y| Vec3::new(y, 5.0, x),
            |x, y| Vec3::new(x, y, x + 2.0 * y + 11.0),
        ];
        for plane in planes {
            let mut corners: Vec<Vec3> = flat.iter().map(|&[x, y]| plane(x, y)).collect();
            for _ in 0..corners.len() {
                covers(&corners);
                corners.rotate_left(1);
            }
            corners.reverse();
            covers(&corners);
        }
    }

    #[test]
    fn concave_polygons_are_covered_once_in_every_plane() {
        everywhere(&[[0.0, 0.0], [4.0, 0.0], [1.0, 1.0], [0.0, 4.0]]);
        everywhere(&[
            [0., 0.],
            [6., 0.],
            [6., 4.],
            [5., 4.],
            [5., 1.],
            [3., 1.],
            [3., 3.],
            [1., 3.],
            [1., 5.],
            [0., 5.],
        ]);
        let star: Vec<[f32; 2]> = (0..14)
            .map(|i| {
                let r = if i % 2 == 0 { 3.0 } else { 1.25 };
                let a = i as f32 * std::f32::consts::TAU / 14.0;
                [r * a.cos(), r * a.sin()]
            })
            .collect();
        everywhere(&star);
        let comb: Vec<[f32; 2]> = (0..40)
            .map(|i| [i as f32, if i % 2 == 0 { 0.5 } else { 9.0 }])
            .chain([[39., -2.], [0., -2.]])
            .collect();
        everywhere(&comb);
    }

    #[test]
    fn corners_on_a_line_and_a_hole_by_a_bridge_are_covered() {
        everywhere(&[[0., 0.], [1., 0.], [2., 0.], [5., 0.], [5., 5.], [2., 1.], [0., 5.]]);
        // A square with a square hole, joined by an edge that goes in and out.
        everywhere(&[
            [0., 0.],
            [9., 0.],
            [9., 9.],
            [0., 9.],
            [0., 0.],
            [3., 3.],
            [3., 6.],
            [6., 6.],
            [6., 3.],
            [3., 3.],
        ]);
    }

    #[test]
    fn convex_polygons_become_a_fan() {
        let corners: Vec<Vec3> = (0..7)
            .map(|i| {
                let a = i as f32 * std::f32::consts::TAU / 7.0;
                Vec3::new(2.0 + a.cos(), 5.0, a.sin())
            })
            .collect();
        assert!(is_convex(&corners));
        assert_eq!(triangulate(&corners).unwrap()[4], [0, 5, 6]);
        covers(&corners);
    }

    #[test]
    fn nonsense_still_has_its_number_of_triangles() {
        let crossing = [[0., 0.], [4., 4.], [4., 0.], [0., 4.], [2., 9.]].map(|[x, y]| Vec3::new(x, y, 1.0));
        let point = [Vec3::splat(3.5); 6];
        let line: Vec<Vec3> = (0..9).map(|i| Vec3::splat((i * i % 7) as f32)).collect();
        let infinite = [Vec3::INFINITY, Vec3::NAN, Vec3::ONE, Vec3::NEG_INFINITY, Vec3::ZERO];
        for corners in [&crossing[..], &point, &line, &infinite] {
            let triangles = triangulate(corners).unwrap();
            assert_eq!(triangles.len(), corners.len() - 2);
            assert!(triangles.iter().flatten().all(|&i| i < corners.len()));
        }
    }

    #[test]
    fn long_polygons_are_covered_and_endless_ones_given_up() {
        let comb = |count: usize| -> Vec<Vec3> {
            let tooth = |i: usize| Vec3::new(i as f32, if i.is_multiple_of(2) { 0.5 } else { 9.0 }, 4.0);
            (0..count - 2)
                .map(tooth)
                .chain([Vec3::new(count as f32, -2., 4.), Vec3::new(0., -2., 4.)])
                .collect()
        };
        covers(&comb(3000));
        // Round, but not convex once its corners are rounded.
        let wheel: Vec<Vec3> = (0..100_000)
            .map(|i| {
                let a = f64::from(i) * std::f64::consts::TAU / 1e5;
                Vec3::new((9.0 * a.cos()) as f32, 4.0, (9.0 * a.sin()) as f32)
            })
            .collect();
        assert!(!is_convex(&wheel));
        assert_eq!(triangulate(&wheel).unwrap().len(), 99_998);
        let mut random = 1u64;
        let tangle: Vec<Vec3> = (0..200_000)
            .map(|_| {
                random = random.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1);
                Vec3::new((random >> 40) as f32, (random >> 20 & 0xFF_FFFF) as f32, 1.0)
            })
            .collect();
        assert!(triangulate(&tangle).is_none());
    }
}
