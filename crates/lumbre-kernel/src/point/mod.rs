//! Queries of points: the closest point, inside or not, and winding numbers.

pub(crate) mod closest_point;
pub(crate) mod flats;
pub(crate) mod inside;
pub(crate) mod winding;
