//! How a tree is built.

/// How a tree is built. Answers never depend on it; the speed of queries does.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct BuildOptions {
    /// The effort of the build.
    pub preset: Preset,
}

/// The effort of a build.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Preset {
    /// The fastest build, for scenes that change with every frame: primitives are sorted along the Morton curve (C.
    /// Lauterbach and others, "Fast BVH Construction on GPUs", 2009), and only the bottom of the tree is chosen by the
    /// surface area heuristic.
    Fast,
    /// Binned by the surface area heuristic (I. Wald, "On fast Construction of SAH-based Bounding Volume Hierarchies",
    /// 2007), with the same tree for every instruction set. Upper nodes of meshes are reinserted, as in `Best`, if that
    /// makes the tree much better. Instances whose parts have much smaller boxes than the whole are entered part by
    /// part (after C. Benthin and others, "Improved Two-Level BVHs using Partial Re-Braiding", 2017).
    #[default]
    Balanced,
    /// The balanced tree, improved by reinserting subtrees of any size (D. Meister, J. Bittner, "Parallel Reinsertion
    /// for Bounding Volume Hierarchy Optimization", 2018): for trees that are built once and answer many queries.
    Best,
}

impl Preset {
    /// All presets, from the fastest build to the fastest queries.
    pub const ALL: [Self; 3] = [Self::Fast, Self::Balanced, Self::Best];
}
