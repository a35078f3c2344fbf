//! How paths find light.

/// How a path finds light. All strategies have the same mean, except for lights that no ray can hit by chance:
/// [`Strategy::Bsdf`] samples those lights too.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Strategy {
    /// Both strategies, weighted.
    #[default]
    Both,
    /// By sampling lights, if they can be sampled.
    Lights,
    /// By sampling the BSDF.
    Bsdf,
}
