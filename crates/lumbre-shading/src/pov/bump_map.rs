//! Bump maps: the tilt of normals by the slope of an image.

use lumbre_math::DVec3;

use super::pigment::ImageMap;

impl ImageMap {
    /// What is added to a unit normal at a point where the grey of the image is a height. The unit of heights and of
    /// lengths is a pixel.
    pub(super) fn tilt(&self, p: DVec3, normal: DVec3) -> DVec3 {
        let Some([u, v]) = self.place(p) else { return DVec3::ZERO };
        let [column, row] = [f64::from(self.width), f64::from(self.height)].map(f64::recip);
        let height = |x: f64, y: f64| {
            let [u, v] = [u + x * column, v + y * row].map(|x| x - x.floor());
            f64::from(self.at(u, v).gray())
        };
        // The plane through the heights of a triangle, as POV-Ray places it.
        let (top, right, left) = (height(0.0, 0.0), height(1.0, -1.0), height(-1.0, -1.0));
        let (across, upwards) = (0.5 * (right - left), top - 0.5 * (right + left));
        let side = normal.cross(DVec3::Y).normalize_or(DVec3::X);
        -(across * side + upwards * side.cross(normal))
    }
}
