//! How a tree is built.

/// How a tree is built. Answers do not depend on it; how soon they come does.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct BuildOptions {
    /// How much care is taken.
    pub preset: Preset,
}

/// How much care is taken over a tree.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Preset {
    /// Built soonest, for what changes from picture to picture: primitives are sorted along a curve (C. Lauterbach and
    /// others, "Fast BVH Construction on GPUs", 2009), and only the ends of the tree are chosen by the surface area
    /// heuristic.
    Fast,
    /// Binned by the surface area heuristic at every instruction set (I. Wald, "On fast Construction of SAH-based Bounding Volume
    /// Hierarchies", 2007). Among the upper nodes of meshes, subtrees are put elsewhere where that makes the tree much better, as in
    /// `Best`. Instances whose parts have much smaller boxes than the whole are entered part by part (after C. Benthin
    /// and others, "Improved Two-Level BVHs using Partial Re-Braiding", 2017): at most eight parts for each on average, and 64.
    #[default]
    Balanced,
    /// The balanced tree, then made better by putting subtrees of any size elsewhere (D. Meister, J. Bittner, "Parallel Reinsertion for
    /// Bounding Volume Hierarchy Optimization", 2018): for what is built once and asked often.
    Best,
}

impl Preset {
    /// All of them, from the soonest to the best.
    pub const ALL: [Self; 3] = [Self::Fast, Self::Balanced, Self::Best];
}
