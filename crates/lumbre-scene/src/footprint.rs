//! Ray footprints, for filtering textures.

use lumbre_math::{DVec3, Vec2, Vec3};

/// The spread of a ray.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub enum Footprint {
    /// Unknown: textures are not filtered.
    #[default]
    Point,
    /// The rays through neighbouring points of the film (Igehy, "Tracing Ray Differentials", SIGGRAPH 1999).
    Neighbours {
        /// Origin of the ray to the right.
        x_origin: DVec3,
        /// Its direction.
        x_direction: DVec3,
        /// Origin of the ray below.
        y_origin: DVec3,
        /// Its direction.
        y_direction: DVec3,
    },
    /// A cone (Amanatides, "Ray Tracing with Cones", SIGGRAPH 1984).
    Cone {
        /// Width at the ray's origin.
        width: f64,
        /// Growth of the width for each unit of distance.
        spread: f64,
    },
}

/// A footprint on a surface.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(crate) struct SurfaceFootprint {
    pub dpdx: Vec3,
    pub dpdy: Vec3,
    pub duv_dx: Vec2,
    pub duv_dy: Vec2,
    /// The width across the ray, and its growth with distance, for rays that leave.
    pub width: f64,
    pub spread: f64,
}

impl Footprint {
    /// The sides of the footprint, and its width and spread; `None` if unknown.
    #[inline]
    fn sides(
        &self,
        point: DVec3,
        normal: DVec3,
        direction: DVec3,
        distance: f64,
    ) -> Option<(DVec3, DVec3, f64, f64)> {
        let (dpdx, dpdy, width, spread) = match *self {
            Self::Point => return None,
            Self::Neighbours { x_origin, x_direction, y_origin, y_direction } => {
                let meet = |origin: DVec3, towards: DVec3| {
                    origin + towards * (normal.dot(point - origin) / normal.dot(towards)) - point
                };
                let (dpdx, dpdy) = (meet(x_origin, x_direction), meet(y_origin, y_direction));
                // The width across the ray is not stretched at grazing angles.
                let across = |d: DVec3| (d - direction * d.dot(direction)).length();
                let width = 0.5 * (across(dpdx) + across(dpdy));
                (dpdx, dpdy, width, if distance > 0.0 { width / distance } else { 0.0 })
            }
            Self::Cone { width, spread } => {
                let width = width + spread * distance;
                let cosine = normal.dot(direction);
                let along = direction - normal * cosine;
                let along = along.try_normalize().unwrap_or_else(|| normal.any_orthonormal_vector());
                (along * (width / cosine.abs().max(0.02)), normal.cross(along) * width, width, spread)
            }
        };
        (dpdx.is_finite() && dpdy.is_finite() && width.is_finite()).then_some((dpdx, dpdy, width, spread))
    }

    /// The footprint for untextured surfaces: only the width and spread for the rays that leave.
    #[inline]
    pub(crate) fn across(
        &self,
        point: DVec3,
        normal: DVec3,
        direction: DVec3,
        distance: f64,
    ) -> SurfaceFootprint {
        if let Self::Cone { width, spread } = *self {
            let width = width + spread * distance;
            return if width.is_finite() {
                SurfaceFootprint { width, spread, ..SurfaceFootprint::default() }
            } else {
                SurfaceFootprint::default()
            };
        }
        self.sides(point, normal, direction, distance).map_or_else(
            SurfaceFootprint::default,
            |(_, _, width, spread)| SurfaceFootprint { width, spread, ..SurfaceFootprint::default() },
        )
    }

    /// The footprint at `point` at a distance along the unit `direction`, on the plane with this normal, in
    /// surface parameters.
    pub(crate) fn on_plane(
        &self,
        point: DVec3,
        normal: DVec3,
        dpdu: DVec3,
        dpdv: DVec3,
        direction: DVec3,
        distance: f64,
    ) -> SurfaceFootprint {
        let Some((dpdx, dpdy, width, spread)) = self.sides(point, normal, direction, distance) else {
            return SurfaceFootprint::default();
        };
        // Least squares for the change of (u, v) that corresponds to each offset.
        let (uu, uv, vv) = (dpdu.dot(dpdu), dpdu.dot(dpdv), dpdv.dot(dpdv));
        let inverse = 1.0 / (uu * vv - uv * uv);
        let parameters = |d: DVec3| {
            let (a, b) = (dpdu.dot(d), dpdv.dot(d));
            let uv = Vec2::new(((vv * a - uv * b) * inverse) as f32, ((uu * b - uv * a) * inverse) as f32);
            if uv.is_finite() { uv.clamp(Vec2::splat(-1e8), Vec2::splat(1e8)) } else { Vec2::ZERO }
        };
        SurfaceFootprint {
            dpdx: dpdx.as_vec3(),
            dpdy: dpdy.as_vec3(),
            duv_dx: parameters(dpdx),
            duv_dy: parameters(dpdy),
            width,
            spread,
        }
    }
}
