//! The tree of lights and its emitters, laid out for gathers.

use lumbre_math::DVec3;
use lumbre_simd::{Double, Mask, Real, UInt, V3};

use crate::light::choice::LightChoice;
use crate::light::mesh::{Form, Piece};
use crate::light::tree::{LightTree, Node};
use crate::light::{Light, PointLight, SpotLight};
use crate::surface::SurfaceEntry;

/// How an emitter is sampled.
pub(super) mod kind {
    /// A triangle or a rectangle that emits the same everywhere.
    pub(crate) const PIECE: u32 = 0;
    /// A point or a spot light.
    pub(crate) const POINT: u32 = 1;
    /// By scalar code.
    pub(crate) const SCALAR: u32 = 2;
}

/// Numbers of a node. (Packed into seven words they save a sample among 10,000 lamps an eighth of its time, and cost
/// scalar code a third.)
pub(super) mod node {
    pub(crate) const CENTER: u32 = 0;
    pub(crate) const HALF: u32 = 3;
    pub(crate) const RADIUS: u32 = 6;
    pub(crate) const STRENGTH: u32 = 7;
    pub(crate) const AXIS: u32 = 8;
    pub(crate) const COS_NORMALS: u32 = 11;
    pub(crate) const COS_LIGHT: u32 = 12;
    pub(crate) const COUNT: u32 = 13;
}

/// Numbers of a piece.
pub(super) mod piece {
    pub(crate) const SIDE_A: u32 = 0;
    pub(crate) const SIDE_B: u32 = 3;
    /// On the side that shines.
    pub(crate) const NORMAL: u32 = 6;
    pub(crate) const AREA: u32 = 9;
    pub(crate) const REACH_SQUARED: u32 = 10;
    pub(crate) const RADIANCE: u32 = 11;
    /// 2 where the back shines, too.
    pub(crate) const SIDES: u32 = 14;
    pub(crate) const ERROR: u32 = 15;
    /// 1 for a rectangle, 0 for a triangle.
    pub(crate) const IS_RECTANGLE: u32 = 18;
    pub(crate) const COUNT: u32 = 19;
}

/// Numbers of a point or spot light, in the place of those of a piece.
pub(super) mod point {
    pub(crate) const AXIS: u32 = 0;
    /// The cosine at which the light is full; no more than that at which it ends where it has no edge.
    pub(crate) const COS_START: u32 = 3;
    pub(crate) const COS_END: u32 = 4;
    pub(crate) const INTENSITY: u32 = 5;
}

/// Of a node, that it is a leaf.
pub(super) const LEAF: u32 = crate::light::tree::LEAF;
/// What is no emitter.
pub(super) const NONE: u32 = u32::MAX;

/// The tree of lights and its emitters. A table is empty where there is no tree.
#[derive(Clone, Debug, Default)]
pub(super) struct Table {
    /// What the nodes are relative to.
    pub origin: [f64; 3],
    pub nodes: Vec<f32>,
    /// By node: the second child; of a leaf, [`LEAF`] and its emitter.
    pub next: Vec<u32>,
    /// The node of each emitter.
    pub leaves: Vec<u32>,
    /// By emitter.
    pub kinds: Vec<u32>,
    pub pieces: Vec<f32>,
    /// The first corner or the position, by emitter.
    pub corners: Vec<f64>,
    /// Of each entry, where its emitters begin, and how many there are for a primitive: 1, or 0 where all primitives
    /// share one.
    first: Vec<u32>,
    stride: Vec<u32>,
    emitter_of: Vec<u32>,
}

/// One row of a table in each lane.
pub(super) struct Rows<'t, R: Real> {
    table: &'t [f32],
    at: R::UInt,
    /// Where all lanes have the same row, it is read once.
    one: Option<usize>,
}

/// What differences of single precision, and the rounding of what they are of, may be off by, relative to the greatest
/// coordinate.
pub(super) const ROUNDING: f32 = 2.4e-7;

impl Table {
    pub(super) fn new(lights: &[Light], entries: &[SurfaceEntry], choice: &LightChoice) -> Self {
        let Some(tree) = &choice.tree else { return Self::without_tree(entries.len()) };
        let mut table = Self::of_tree(tree, entries.len());
        for &(light, piece) in &choice.emitters {
            let (kind, row, corner) = emitter_row(&lights[light as usize], piece, entries);
            table.kinds.push(kind);
            table.pieces.extend(row);
            table.corners.extend(corner.to_array());
        }
        for (id, entry) in entries.iter().enumerate() {
            let Some(light) = entry.light else { continue };
            let Some(first) = choice.firsts[light.0 as usize] else { continue };
            table.first[id] = table.emitter_of.len() as u32;
            match &lights[light.0 as usize] {
                Light::Mesh(mesh) => {
                    table.stride[id] = 1;
                    let pieces = (0..).map_while(|triangle| mesh.piece_of(triangle));
                    table.emitter_of.extend(pieces.map(|piece| first + piece));
                }
                _ => table.emitter_of.push(first),
            }
        }
        table
    }

    pub(super) fn of_tree(tree: &LightTree, entries: usize) -> Self {
        let root = &tree.nodes[0];
        let mut table = Self { origin: root.center.to_array(), ..Self::without_tree(entries) };
        for node in &tree.nodes {
            table.nodes.extend(node_row(node, root));
            table.next.push(node.next);
        }
        table.leaves.clone_from(&tree.leaves);
        table
    }

    fn without_tree(entries: usize) -> Self {
        let none = vec![0; entries.max(1)];
        Self { first: none.clone(), stride: none, emitter_of: vec![NONE], ..Self::default() }
    }

    /// The emitter of a primitive of an entry; [`NONE`] where there is none.
    #[inline(always)]
    pub(super) fn emitter<R: Real>(&self, active: R::Mask, entry: R::UInt, primitive: R::UInt) -> R::UInt {
        let zero = R::UInt::splat(0);
        let entry = R::UInt::select(active, entry, zero);
        let first = R::UInt::gather(&self.first, entry);
        let stride = R::UInt::gather(&self.stride, entry);
        let at = first + R::UInt::select(active, primitive, zero) * stride;
        let emitter = R::UInt::gather(&self.emitter_of, at);
        R::UInt::select(active, emitter, R::UInt::splat(NONE))
    }

    #[inline(always)]
    pub(super) fn node_rows<R: Real>(&self, at: R::UInt, active: R::Mask) -> Rows<'_, R> {
        Rows::new(&self.nodes, node::COUNT, at, active)
    }

    #[inline(always)]
    pub(super) fn piece_rows<R: Real>(&self, emitter: R::UInt, active: R::Mask) -> Rows<'_, R> {
        Rows::new(&self.pieces, piece::COUNT, emitter, active)
    }

    #[inline(always)]
    pub(super) fn corner<R: Real>(&self, emitter: R::UInt) -> V3<R::Double> {
        let at = emitter * R::UInt::splat(3);
        V3::new(
            R::Double::gather(&self.corners, at),
            R::Double::gather(&self.corners, at + R::UInt::splat(1)),
            R::Double::gather(&self.corners, at + R::UInt::splat(2)),
        )
    }
}

impl<'t, R: Real> Rows<'t, R> {
    #[inline(always)]
    fn new(table: &'t [f32], count: u32, at: R::UInt, active: R::Mask) -> Self {
        let bits = active.to_bitmask();
        let first = if bits == 0 { 0 } else { at.to_lanes()[bits.trailing_zeros() as usize] };
        let is_same = (at.simd_eq(R::UInt::splat(first)) | !active).all();
        let at = R::UInt::select(active, at, R::UInt::splat(first));
        Self {
            table,
            at: at * R::UInt::splat(count),
            one: if is_same { Some(first as usize * count as usize) } else { None },
        }
    }

    #[inline(always)]
    pub(super) fn number(&self, k: u32) -> R {
        match self.one {
            Some(row) => R::splat(self.table[row + k as usize]),
            None => R::gather(self.table, self.at + R::UInt::splat(k)),
        }
    }

    #[inline(always)]
    pub(super) fn vector(&self, k: u32) -> V3<R> {
        V3::new(self.number(k), self.number(k + 1), self.number(k + 2))
    }
}

fn node_row(node: &Node, root: &Node) -> [f32; node::COUNT as usize] {
    let center = (node.center - root.center).as_vec3();
    let rounding = ROUNDING * center.abs().max_element();
    let half = node.half.as_vec3() * (1.0 + ROUNDING) + rounding;
    let radius = node.radius_squared.sqrt() as f32 * (1.0 + ROUNDING) + rounding;
    // Relative to all, and never 0 for what shines.
    let relative = node.strength / root.strength;
    let strength = if relative.is_nan() { 1.0 } else { relative.min(1.0) as f32 };
    let strength = if node.strength > 0.0 { strength.max(1e-30) } else { 0.0 };
    let axis = node.facing.axis.as_vec3();
    let (cos_normals, cos_light) = (node.facing.cos_normals as f32, node.facing.cos_light as f32);
    [
        center.x,
        center.y,
        center.z,
        half.x,
        half.y,
        half.z,
        radius,
        strength,
        axis.x,
        axis.y,
        axis.z,
        cos_normals,
        cos_light,
    ]
}

type EmitterRow = (u32, [f32; piece::COUNT as usize], DVec3);

fn emitter_row(light: &Light, piece: Option<u32>, entries: &[SurfaceEntry]) -> EmitterRow {
    match (light, piece) {
        (Light::Point(light), _) => point_row(light, DVec3::ZERO, [-2.0; 2]),
        (Light::Spot(SpotLight { from, axis, intensity, cos_start, cos_end }), _) => {
            let light = PointLight { from: *from, intensity: *intensity };
            point_row(&light, *axis, [*cos_start, *cos_end])
        }
        (Light::Mesh(light), Some(piece)) => {
            let entry = &entries[light.entry as usize];
            piece_row(&light.pieces[piece as usize], entry)
        }
        _ => None,
    }
    .unwrap_or((kind::SCALAR, [0.0; piece::COUNT as usize], DVec3::ZERO))
}

fn point_row(light: &PointLight, axis: DVec3, cosines: [f64; 2]) -> Option<EmitterRow> {
    let mut row = [0.0; piece::COUNT as usize];
    let mut set = |at: u32, numbers: &[f32]| row[at as usize..][..numbers.len()].copy_from_slice(numbers);
    set(point::AXIS, &axis.as_vec3().to_array());
    set(point::COS_START, &cosines.map(|cosine| cosine as f32));
    set(point::INTENSITY, &light.intensity.to_array());
    Some((kind::POINT, row, light.from))
}

/// `None` for what does not emit the same everywhere.
fn piece_row(piece: &Piece, entry: &SurfaceEntry) -> Option<EmitterRow> {
    let (emission, outward) = (entry.uniform_emission()?, piece.outward?);
    let is_rectangle = match piece.form {
        Form::Nothing => return None,
        Form::Triangle(..) => 0.0,
        Form::Rectangle(_) => 1.0,
    };
    let [a, b] = piece.sides.map(|side| side.as_vec3());
    let rounded = |single: lumbre_math::Vec3, double: DVec3| (single.as_dvec3() - double).abs();
    let error = piece.error + rounded(a, piece.sides[0]) + rounded(b, piece.sides[1]);
    // Up, so that it stays a bound.
    let error = error.as_vec3() * (1.0 + f32::EPSILON) + f32::MIN_POSITIVE;
    let mut row = [0.0; piece::COUNT as usize];
    let mut set = |at: u32, numbers: &[f32]| row[at as usize..][..numbers.len()].copy_from_slice(numbers);
    set(piece::SIDE_A, &a.to_array());
    set(piece::SIDE_B, &b.to_array());
    set(piece::NORMAL, &(outward * piece.normal).as_vec3().to_array());
    set(piece::AREA, &[piece.area as f32]);
    set(piece::REACH_SQUARED, &[piece.reach_squared as f32]);
    set(piece::RADIANCE, &emission.radiance.to_array());
    set(piece::SIDES, &[emission.sides()]);
    set(piece::ERROR, &error.to_array());
    set(piece::IS_RECTANGLE, &[is_rectangle]);
    Some((kind::PIECE, row, piece.corner))
}
