//! From the binary tree to eight-wide nodes and packed leaves.

use crate::build::{BinaryNode, Bounds, Kind, Primitive, Traits};
use crate::node::{Node, WIDTH, tag};
use crate::triangles::{BLOCK, BlockNames, TriangleBlock};
use crate::{BuildError, Geometry, GeometryKind, TriangleMesh};

/// A primitive in a leaf that is no triangle, or outside the tree.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Entry {
    /// Position in the tree's list.
    pub(crate) geometry: u32,
    /// Which primitive of a custom geometry; else 0, except that the top bit marks the last of its leaf.
    primitive_and_last: u32,
}

const LAST: u32 = 1 << 31;

impl Entry {
    pub(crate) fn new(geometry: u32, primitive: u32, is_last: bool) -> Self {
        Self { geometry, primitive_and_last: primitive | if is_last { LAST } else { 0 } }
    }

    #[inline(always)]
    pub(crate) fn primitive(&self) -> u32 {
        self.primitive_and_last & !LAST
    }

    #[inline(always)]
    pub(crate) fn is_last(&self) -> bool {
        self.primitive_and_last & LAST != 0
    }
}

/// The packed tree.
#[derive(Debug, Default)]
pub(crate) struct Packed {
    pub(crate) nodes: Vec<Node>,
    pub(crate) blocks: Vec<TriangleBlock>,
    /// As many as there are blocks.
    pub(crate) names: Vec<BlockNames>,
    pub(crate) entries: Vec<Entry>,
    /// The reference to the root; `None` when there is nothing finite.
    pub(crate) root: Option<u32>,
}

/// Packs a binary tree. The depth of its recursion is that of the tree, which is bounded.
///
/// # Errors
/// [`BuildError::TooMany`] when there are more triangle blocks than references can name.
pub(crate) fn pack(
    geometries: &[Geometry],
    traits: &[Traits],
    primitives: &[Primitive],
    binary: &[BinaryNode],
) -> Result<Packed, BuildError> {
    let mut packer = Packer { geometries, traits, primitives, binary, packed: Packed::default() };
    let root = if binary[0].count > 0 { packer.leaf(0) } else { packer.inner(0) };
    if packer.packed.blocks.len() > tag::BLOCK_PLACES as usize {
        return Err(BuildError::TooMany);
    }
    packer.packed.root = Some(root);
    packer.packed.nodes.shrink_to_fit();
    packer.packed.blocks.shrink_to_fit();
    packer.packed.names.shrink_to_fit();
    packer.packed.entries.shrink_to_fit();
    Ok(packer.packed)
}

struct Packer<'a> {
    geometries: &'a [Geometry],
    traits: &'a [Traits],
    primitives: &'a [Primitive],
    binary: &'a [BinaryNode],
    packed: Packed,
}

impl<'a> Packer<'a> {
    fn inner(&mut self, root: usize) -> u32 {
        // Open the largest child until there are eight.
        let mut children = [root; WIDTH];
        let mut len = 1;
        while len < WIDTH {
            let mut largest: Option<(usize, f32)> = None;
            for (lane, &child) in children[..len].iter().enumerate() {
                let node = &self.binary[child];
                let area = node.bounds.half_area();
                if node.count == 0 && largest.is_none_or(|(_, most)| area > most) {
                    largest = Some((lane, area));
                }
            }
            let Some((lane, _)) = largest else { break };
            let opened = children[lane];
            children[lane] = opened + 1;
            children[len] = opened + self.binary[opened].place as usize;
            len += 1;
        }

        // The largest first: where any hit will do, it is the likeliest to have one.
        children[..len].sort_by(|&a, &b| {
            let area = |child: usize| self.binary[child].bounds.half_area();
            area(b).total_cmp(&area(a))
        });

        let place = self.packed.nodes.len();
        let mut node = Node { len: len as u32, ..Node::EMPTY };
        for (lane, &child) in children[..len].iter().enumerate() {
            let Bounds { min, max } = self.binary[child].bounds;
            for axis in 0..3 {
                node.planes[2 * axis][lane] = min[axis];
                node.planes[2 * axis + 1][lane] = max[axis];
            }
        }
        self.packed.nodes.push(node);
        for (lane, &child) in children[..len].iter().enumerate() {
            let reference = if self.binary[child].count > 0 { self.leaf(child) } else { self.inner(child) };
            self.packed.nodes[place].children[lane] = reference;
        }
        tag::reference(tag::INNER, place as u32)
    }

    fn leaf(&mut self, leaf: usize) -> u32 {
        let BinaryNode { place, count, .. } = self.binary[leaf];
        let primitives = &self.primitives[place as usize..][..count as usize];
        let tag = match self.traits[primitives[0].geometry as usize].kind {
            Kind::Triangle => return self.triangles(primitives),
            Kind::Shape => tag::SHAPES,
            Kind::Instance => tag::INSTANCE,
            Kind::Custom => tag::CUSTOM,
        };
        let first = self.packed.entries.len() as u32;
        for (i, primitive) in primitives.iter().enumerate() {
            let is_last = i + 1 == primitives.len();
            self.packed.entries.push(Entry::new(primitive.geometry, primitive.primitive, is_last));
        }
        tag::reference(tag, first)
    }

    fn triangles(&mut self, primitives: &[Primitive]) -> u32 {
        let geometry = primitives[0].geometry;
        let mesh = self.mesh(geometry);
        let first = self.packed.blocks.len() as u32;
        for chunk in primitives.chunks(BLOCK) {
            let (mut block, mut names) = (TriangleBlock::EMPTY, BlockNames::empty(geometry));
            for (lane, primitive) in chunk.iter().enumerate() {
                names.primitives[lane] = primitive.primitive;
                for (corner, &vertex) in mesh.indices[primitive.primitive as usize].iter().enumerate() {
                    let position = mesh.positions[vertex as usize];
                    for axis in 0..3 {
                        block.corners[corner][axis][lane] = position[axis];
                    }
                }
            }
            self.packed.blocks.push(block);
            self.packed.names.push(names);
        }
        // Past the last place the tree is given up, so that it does not matter what this names.
        let first = first.min(tag::BLOCK_PLACES - 1);
        tag::triangles(first, primitives.len().div_ceil(BLOCK) as u32)
    }

    fn mesh(&self, geometry: u32) -> &'a TriangleMesh {
        match &self.geometries[geometry as usize].kind {
            GeometryKind::Mesh(mesh) => mesh,
            _ => unreachable!("triangles come from meshes"),
        }
    }
}
