//! Combinations of solids.

use lumbre_kernel::GeometryKind;
use lumbre_math::Transform;

use crate::build::Builder;
use crate::surface::SurfaceEntry;
use crate::{BuildError, CsgDesc};

pub(crate) fn build(
    _: &mut Builder,
    shape: u32,
    _: CsgDesc,
    _: &Transform,
    _: bool,
) -> Result<(GeometryKind, Vec<SurfaceEntry>), BuildError> {
    Err(BuildError::Csg { shape, reason: "combinations of solids are not supported".to_owned() })
}
