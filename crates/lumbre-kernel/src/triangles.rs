//! Triangles packed by eight, and the watertight test.
//!
//! After S. Woop, C. Benthin, I. Wald, "Watertight Ray/Triangle Intersection", JCGT 2(1), 2013. It differs from theirs in
//! three ways. Everything after the load is in f64. An edge function whose products are equal is redone exactly, so that
//! its sign is always the sign of the exact edge function of the sheared corners. And where that is exactly zero, the ray
//! is taken to be moved by (ε, ε²) in the sheared plane ("simulation of simplicity": H. Edelsbrunner, E. Mücke, ACM
//! Transactions on Graphics 9(1), 1990). The signs are then those of one ray in general position, the same for every
//! triangle: such a ray crosses a closed mesh an even number of times and meets no edge and no vertex, so that each
//! crossing has exactly one owner.

use lumbre_geometry::{Ray, Root};
use lumbre_math::{DVec2, DVec3};

use crate::touch::Feature;

/// Triangles in a block.
pub(crate) const BLOCK: usize = 8;

/// Up to eight triangles of one mesh. Unused lanes have NaN corners, which no ray hits.
#[derive(Clone, Debug)]
#[repr(C, align(32))]
pub(crate) struct TriangleBlock {
    /// `corners[corner][axis][lane]`, relative to the mesh's origin.
    pub(crate) corners: [[[f32; BLOCK]; 3]; 3],
}

const _: () = assert!(size_of::<TriangleBlock>() == 288);

/// What the triangles of a block are called: apart from their corners, for only the winner of a search is asked.
#[derive(Clone, Debug)]
pub(crate) struct BlockNames {
    /// Positions in the mesh's list.
    pub(crate) primitives: [u32; BLOCK],
    /// Position of the mesh in the tree's list.
    pub(crate) geometry: u32,
}

impl BlockNames {
    /// The names in a block without triangles.
    pub(crate) fn empty(geometry: u32) -> Self {
        Self { primitives: [u32::MAX; BLOCK], geometry }
    }
}

impl TriangleBlock {
    /// A block without triangles.
    pub(crate) const EMPTY: Self = Self { corners: [[[f32::NAN; BLOCK]; 3]; 3] };

    /// The corners in one lane.
    #[inline(always)]
    pub(crate) fn triangle(&self, lane: usize) -> [[f32; 3]; 3] {
        self.corners.map(|axes| axes.map(|lanes| lanes[lane]))
    }
}

/// The shear that turns a ray's direction into the last axis: once a ray.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Shear {
    /// The axes that become x, y and z; z is the direction's largest.
    pub(crate) axes: [usize; 3],
    pub(crate) x: f64,
    pub(crate) y: f64,
    /// The direction's largest component.
    pub(crate) direction_z: f64,
}

impl Shear {
    #[inline(always)]
    pub(crate) fn new(direction: DVec3) -> Self {
        let size = direction.abs();
        let z = if size.x >= size.y && size.x >= size.z {
            0
        } else if size.y >= size.z {
            1
        } else {
            2
        };
        let (x, y) = ([1, 2, 0][z], [2, 0, 1][z]);
        let direction_z = direction[z];
        // Keeps the winding.
        let (x, y) = if direction_z < 0.0 { (y, x) } else { (x, y) };
        Self { axes: [x, y, z], x: direction[x] / direction_z, y: direction[y] / direction_z, direction_z }
    }

    /// The ray's origin relative to a mesh's, in the order of the axes.
    #[inline(always)]
    pub(crate) fn local_origin(&self, ray_origin: DVec3, mesh_origin: &[f64; 3]) -> [f64; 3] {
        self.axes.map(|axis| ray_origin[axis] - mesh_origin[axis])
    }

    #[inline(always)]
    fn corner(&self, origin: &[f64; 3], corner: &[f32; 3]) -> Corner {
        let [x, y, z] = self.axes;
        let height = f64::from(corner[z]) - origin[2];
        Corner {
            x: (f64::from(corner[x]) - origin[0]) - self.x * height,
            y: (f64::from(corner[y]) - origin[1]) - self.y * height,
            z: height,
        }
    }
}

/// A sheared corner: the ray is the z axis.
#[derive(Clone, Copy)]
struct Corner {
    x: f64,
    y: f64,
    z: f64,
}

/// How a ray meets a triangle.
pub(crate) enum Meeting {
    /// Not at all, or out of the range.
    Miss,
    /// Within the range, away from its edges.
    Hit(Root),
    /// Exactly at an edge or a corner, in range or not.
    Touch {
        /// The crossing.
        root: Root,
        /// Whether this triangle owns the crossing.
        is_owned: bool,
        /// Where.
        feature: Feature,
    },
}

/// How the ray meets a triangle. `corners` are relative to the mesh, as is `origin`, which has the order of the shear's
/// axes.
#[inline(always)]
pub(crate) fn intersect(ray: &Ray, shear: &Shear, origin: &[f64; 3], corners: &[[f32; 3]; 3]) -> Meeting {
    let [a, b, c] = [
        shear.corner(origin, &corners[0]),
        shear.corner(origin, &corners[1]),
        shear.corner(origin, &corners[2]),
    ];
    let (bc, ca, ab) = (edge(c, b), edge(a, c), edge(b, a));
    let [u, v, w] = [bc, ca, ab].map(|edge| edge.value);
    let is_inside = (u > 0.0 && v > 0.0 && w > 0.0) || (u < 0.0 && v < 0.0 && w < 0.0);
    if !is_inside {
        return touch(shear, [a, b, c], [bc, ca, ab]);
    }
    let det = u + v + w;
    let largest_product = bc.product.max(ca.product).max(ab.product);
    // Seen on edge, a triangle's edge functions cancel; left so, t would be anywhere within the triangle.
    let root = if det.abs() < largest_product * (1.0 / 64.0) {
        root_of(
            shear,
            [a, b, c],
            [difference_of_products(c, b), difference_of_products(a, c), difference_of_products(b, a)],
        )
    } else {
        root_of(shear, [a, b, c], [u, v, w])
    };
    // A NaN is not in the range; an infinity is no place.
    if ray.contains(root.t) && root.t.is_finite() { Meeting::Hit(root) } else { Meeting::Miss }
}

#[inline(always)]
fn root_of(shear: &Shear, [a, b, c]: [Corner; 3], [u, v, w]: [f64; 3]) -> Root {
    let det = u + v + w;
    let t = (u * a.z + v * b.z + w * c.z) / det / shear.direction_z;
    Root { t, part: 0, multiplicity: 1, local: DVec2::new(v / det, w / det) }
}

/// A triangle whose edge functions are not all of one sign.
#[inline(always)]
fn touch(shear: &Shear, corners: [Corner; 3], edges: [Edge; 3]) -> Meeting {
    let values = edges.map(|edge| edge.value);
    let is_weakly_inside =
        values.iter().all(|&value| value >= 0.0) || values.iter().all(|&value| value <= 0.0);
    if is_weakly_inside { touch_at_zero(shear, corners, edges) } else { Meeting::Miss }
}

#[cold]
#[inline(never)]
fn touch_at_zero(shear: &Shear, corners: [Corner; 3], edges: [Edge; 3]) -> Meeting {
    let [a, b, c] = corners;
    let values = [difference_of_products(c, b), difference_of_products(a, c), difference_of_products(b, a)];
    let feature = match values.map(|value| value == 0.0) {
        [true, false, false] => Feature::Edge(0),
        [false, true, false] => Feature::Edge(1),
        [false, false, true] => Feature::Edge(2),
        [false, true, true] => Feature::Vertex(0),
        [true, false, true] => Feature::Vertex(1),
        [true, true, false] => Feature::Vertex(2),
        [true, true, true] => Feature::EdgeOn,
        [false, false, false] => return Meeting::Miss,
    };
    let root = root_of(shear, corners, values);
    if feature != Feature::EdgeOn && !root.t.is_finite() {
        return Meeting::Miss;
    }
    let is_sided = edges.iter().all(|edge| edge.is_sided);
    let is_one_sign = edges.iter().all(|edge| edge.is_positive == edges[0].is_positive);
    Meeting::Touch { root, is_owned: feature != Feature::EdgeOn && is_sided && is_one_sign, feature }
}

#[derive(Clone, Copy)]
struct Edge {
    value: f64,
    product: f64,
    // With `is_sided`, the sign for the ray moved by (ε, ε²). Without it the edge is a point: no side.
    is_positive: bool,
    is_sided: bool,
}

/// The edge function px qy - py qx. Its two products are rounded apart: the opposite edge of the neighbour then gives
/// exactly the opposite value, and their difference has the right sign unless they are equal.
#[inline(always)]
fn edge(p: Corner, q: Corner) -> Edge {
    let (first, second) = (p.x * q.y, p.y * q.x);
    let value = first - second;
    if value != 0.0 {
        return Edge { value, product: first.abs(), is_positive: value > 0.0, is_sided: true };
    }
    edge_at_zero(p, q, first)
}

#[cold]
fn edge_at_zero(p: Corner, q: Corner, product: f64) -> Edge {
    let value = p.x.mul_add(q.y, -product) - p.y.mul_add(q.x, -product);
    // (p - m) × (q - m) with m = (ε, ε²) is value + ε (p.y - q.y) + ε² (q.x - p.x).
    let side = [value, p.y - q.y, q.x - p.x].into_iter().find(|&term| term != 0.0).unwrap_or(0.0);
    Edge { value, product: product.abs(), is_positive: side > 0.0, is_sided: side != 0.0 }
}

/// px qy - py qx within 1.5 ulp (W. Kahan; C.-P. Jeannerod, N. Louvet, J.-M. Muller, Mathematics of Computation 82, 2013).
fn difference_of_products(p: Corner, q: Corner) -> f64 {
    let second = p.y * q.x;
    let error = (-p.y).mul_add(q.x, second);
    p.x.mul_add(q.y, -second) + error
}
