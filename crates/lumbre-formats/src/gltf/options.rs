//! Options of reading.

/// Options of reading a glTF.
#[derive(Clone, Debug, Default, PartialEq)]
#[non_exhaustive]
pub struct GltfOptions {
    /// The time in seconds at which animations are evaluated; `None` ignores them.
    pub frame: Option<f64>,
    /// The animation to play, by its name or its index. `None` plays all simultaneously, except those that
    /// conflict with an earlier one.
    pub animation: Option<String>,
    /// The exposure in seconds, centred on `frame`; 0 for an instant. Animated nodes get motion blur.
    pub shutter: f64,
    /// The material variant (`KHR_materials_variants`).
    pub variant: Option<String>,
}
