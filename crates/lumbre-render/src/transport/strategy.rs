//! How paths find light.

/// How a path finds light. All give the same picture in the mean, but [`Strategy::Bsdf`] does not find lights that no ray
/// can hit by chance, for which it samples the lights all the same.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Strategy {
    /// Both ways, weighed.
    #[default]
    Both,
    /// By sampling lights, where they can be sampled.
    Lights,
    /// By sampling the BSDF.
    Bsdf,
}
