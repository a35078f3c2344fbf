//! What the benchmark asks of a program that traces rays.

use crate::rays::Ray32;

/// What is asked of a ray.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Query {
    /// The nearest hit.
    Closest,
    /// Whether there is one.
    Any,
}

impl Query {
    /// Both.
    pub(crate) const ALL: [Self; 2] = [Self::Closest, Self::Any];

    /// Its name in tables and files.
    pub(crate) fn name(self) -> &'static str {
        match self {
            Self::Closest => "closest",
            Self::Any => "any",
        }
    }
}

/// A tree over a scene, ready for rays.
pub(crate) trait Tree: Send + Sync {
    /// Takes some rays in, in its own form.
    fn prepare<'a>(&'a self, query: Query, rays: &[Ray32]) -> Box<dyn Pass + 'a>;
}

/// Rays in the form that a program takes, and room for its answers. Only [`Pass::run`] is timed.
pub(crate) trait Pass: Send {
    /// Makes it ready to run, again.
    fn reset(&mut self);
    /// Traces every ray.
    fn run(&mut self);
    /// What the last run found for each ray: `t`, of any hit 0.
    fn answers(&self) -> Vec<Option<f64>>;
}

/// Bytes that a build allocated.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(crate) struct Bytes {
    /// That stay with the tree.
    pub kept: usize,
    /// That were held at once at most.
    pub peak: usize,
}

/// A program that takes part.
pub(crate) trait Program: Sync {
    /// Its name and version, and how it is set.
    fn name(&self) -> String;

    /// Why it cannot take part in a scene or in some of its work; `None` when it can.
    fn refuses(&self, scene: &crate::scene::Scene) -> Option<&'static str>;

    /// Whether it takes primary rays alone.
    fn takes_packets(&self) -> bool {
        false
    }

    /// Whether it takes primary rays in squares of four by four pixels.
    fn takes_squares(&self) -> bool {
        self.takes_packets()
    }

    /// Builds on this many threads. The scene's own arrays are shared where the program can read them, and copied
    /// beforehand where it cannot. Answers the tree, the seconds that it took and the bytes that it allocated.
    fn build<'a>(&'a self, scene: &'a crate::scene::Scene, threads: usize) -> anyhow::Result<Built<'a>>;
}

/// What a build gives.
pub(crate) struct Built<'a> {
    /// The tree.
    pub tree: Box<dyn Tree + 'a>,
    /// How long it took.
    pub seconds: f64,
    /// How much it allocated.
    pub bytes: Bytes,
}
