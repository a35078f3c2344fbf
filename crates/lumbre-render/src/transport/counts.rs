//! Counts of traced rays.

use std::ops::AddAssign;

/// Numbers of traced rays, by their purpose.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct RayCounts {
    /// From the camera.
    pub camera: u64,
    /// Continuing from a surface.
    pub bounce: u64,
    /// Towards a light, or testing ambient occlusion.
    pub shadow: u64,
}

impl RayCounts {
    /// The sum of all.
    pub fn total(&self) -> u64 {
        self.camera + self.bounce + self.shadow
    }
}

impl AddAssign for RayCounts {
    fn add_assign(&mut self, other: Self) {
        self.camera += other.camera;
        self.bounce += other.bounce;
        self.shadow += other.shadow;
    }
}
