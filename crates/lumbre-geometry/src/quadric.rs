//! General quadrics.

use lumbre_math::quadratic::{dop, quadratic};
use lumbre_math::{DAffine3, DMat3, DVec2, DVec3, Transform};

use crate::line::{Implicit, NearLine};
use crate::placed::into_world;
use crate::shape::check;
use crate::support::{bounds_from_support, gamma};
use crate::{
    Aabb, DirectionSample, PlacedShape, Ray, Root, Roots, Shape, ShapeError, Sphere, Surface, SurfaceSample,
};

/// The points where `A x² + B y² + C z² + D xy + E xz + F yz + G x + H y + I z + J` is 0, all of them or those in a box.
///
/// A closed quadric, an ellipsoid that no box cuts, is a solid with outward normals: it is bounded, can be sampled and can
/// be an operand of CSG. It is parametrised as the unit sphere is, of which it is the image under the lower-triangular map
/// of its Cholesky factor.
///
/// Every other quadric is a surface whose normal is the gradient: it points to where the polynomial is positive. A box
/// clips the surface and leaves it open. Such a quadric has no sampling and an infinite area, clipped or not: it cannot be
/// a light. It is parametrised like a box, by projection along the axis that its normal is nearest to: axis k of the
/// three, counted cyclically, gives u along axis k + 1 and v along axis k + 2, as fractions of the clipping box, or as
/// plain coordinates where there is none.
#[derive(Clone, Debug)]
pub struct Quadric {
    // p·matrix p + linear·p + constant; the largest coefficient is between 1 and 2.
    matrix: DMat3,
    linear: DVec3,
    constant: f64,
    clip: Option<Aabb>,
    // Where rays are moved close to.
    place: DVec3,
    // The unit sphere's image that it is, when it is closed.
    ellipsoid: Option<PlacedShape>,
}

impl Quadric {
    /// The quadric of ten coefficients A to J, within `clip` if that is given.
    ///
    /// # Errors
    /// [`ShapeError`] unless all numbers are finite, one of A to I is not 0, the quadric has more than one real point (as
    /// far as a definite quadratic form tells) and the box has a volume.
    pub fn new(coefficients: [f64; 10], clip: Option<Aabb>) -> Result<Self, ShapeError> {
        if let Some(&found) = coefficients.iter().find(|x| !x.is_finite()) {
            return Err(ShapeError::OutOfRange {
                parameter: "coefficients",
                found,
                expected: "ten finite numbers",
            });
        }
        if coefficients[..9].iter().all(|&x| x == 0.0) {
            return Err(ShapeError::Degenerate("the first nine coefficients of the quadric are all 0"));
        }
        if let Some(clip) = clip {
            check::finite("p0", clip.min)?;
            check::finite("p1", clip.max)?;
            if !clip.min.cmplt(clip.max).all() {
                return Err(ShapeError::Degenerate("the quadric's clipping box holds nothing"));
            }
        }
        // By a power of two, so that no digit changes and no product overflows.
        let largest = coefficients.iter().fold(0.0_f64, |m, x| m.max(x.abs()));
        let scale = (-largest.log2().floor()).clamp(-1000.0, 1000.0).exp2();
        let [a, b, c, d, e, f, g, h, i, j] = coefficients.map(|x| x * scale);
        let rows = [[a, 0.5 * d, 0.5 * e], [0.5 * d, b, 0.5 * f], [0.5 * e, 0.5 * f, c]];
        let mut quadric = Self {
            matrix: DMat3::from_cols_array_2d(&rows),
            linear: DVec3::new(g, h, i),
            constant: j,
            clip,
            place: DVec3::ZERO,
            ellipsoid: None,
        };
        let center = quadric.center();
        if let Some(sphere_from) = quadric.closed_form(center)? {
            let unit = Shape::from(Sphere::new(DVec3::ZERO, 1.0)?);
            let ellipsoid = PlacedShape::new(unit, sphere_from);
            let whole = match (clip, ellipsoid.bounds()) {
                (None, _) => true,
                (Some(clip), Some(bounds)) => clip.contains(bounds.min) && clip.contains(bounds.max),
                (Some(_), None) => false,
            };
            if whole {
                quadric.clip = None;
                quadric.ellipsoid = Some(ellipsoid);
            }
        }
        quadric.place = match (quadric.clip, center) {
            (Some(clip), _) => clip.center(),
            (None, Some(center)) => center,
            (None, None) => DVec3::ZERO,
        };
        Ok(quadric)
    }

    /// The point about which it is symmetric, if there is just one.
    fn center(&self) -> Option<DVec3> {
        let map = Transform::from_affine(DAffine3::from_mat3(self.matrix)).ok()?;
        let center = map.inverse_vector(-0.5 * self.linear);
        center.is_finite().then_some(center)
    }

    /// The map from the unit sphere, when the quadratic form is definite; its signs are then turned so that inside is
    /// negative.
    fn closed_form(&mut self, center: Option<DVec3>) -> Result<Option<Transform>, ShapeError> {
        let Some(center) = center else {
            return Ok(None);
        };
        let sign = self.matrix.x_axis.x.signum();
        let m = sign * self.matrix;
        // Cholesky: m = G Gᵀ with G lower triangular.
        let g00 = m.x_axis.x.sqrt();
        let (g10, g20) = (m.x_axis.y / g00, m.x_axis.z / g00);
        let g11 = (m.y_axis.y - g10 * g10).sqrt();
        let g21 = (m.y_axis.z - g10 * g20) / g11;
        let g22 = (m.z_axis.z - g20 * g20 - g21 * g21).sqrt();
        let is_definite = g00 > 0.0 && g11 > 0.0 && g22 > 0.0;
        if !is_definite {
            return Ok(None);
        }
        // At the centre the polynomial is -depth.
        let depth = -sign * (0.5 * self.linear.dot(center) + self.constant);
        let depth_is_rounding = depth <= 8.0 * f64::EPSILON * (0.5 * self.linear.dot(center)).abs();
        if depth_is_rounding {
            return Err(ShapeError::Degenerate(
                "no real point, or a single one, satisfies the quadric's equation",
            ));
        }
        (self.matrix, self.linear, self.constant) = (m, sign * self.linear, sign * self.constant);
        // Gᵀ (p - centre)/√depth is on the unit sphere.
        let transposed =
            DMat3::from_cols(DVec3::new(g00, 0.0, 0.0), DVec3::new(g10, g11, 0.0), DVec3::new(g20, g21, g22));
        let sphere_from_object = transposed * (1.0 / depth.sqrt());
        let linear = Transform::from_affine(DAffine3::from_mat3(sphere_from_object));
        Ok(linear.ok().map(|map| Transform::translate(center) * map.inverse()))
    }

    /// The box that clips it.
    pub fn clip(&self) -> Option<Aabb> {
        self.clip
    }

    fn keeps(&self, p: DVec3) -> bool {
        self.clip.is_none_or(|clip| clip.contains(p))
    }

    fn crossings(&self, line: &NearLine) -> Option<(f64, f64)> {
        let (p, d) = (line.p, line.d);
        let (mp, md) = (self.matrix * p, self.matrix * d);
        let a = d.dot(md);
        let h = d.dot(mp) + 0.5 * self.linear.dot(d);
        let c = p.dot(mp) + self.linear.dot(p) + self.constant;
        quadratic(a, h, c, dop(h, h, a, c))
    }

    /// The first crossing in the ray's range.
    pub fn closest(&self, ray: &Ray) -> Option<Root> {
        if let Some(ellipsoid) = &self.ellipsoid {
            return ellipsoid.closest(ray);
        }
        let line = NearLine::new(ray, self.place);
        line.accepted(ray, self.crossings(&line), |p| self.keeps(p)).next()
    }

    /// Every crossing in the ray's range, appended in ascending order.
    pub fn roots(&self, ray: &Ray, out: &mut Roots) {
        if let Some(ellipsoid) = &self.ellipsoid {
            return ellipsoid.roots(ray, out);
        }
        let line = NearLine::new(ray, self.place);
        out.extend(line.accepted(ray, self.crossings(&line), |p| self.keeps(p)));
    }

    fn implicit(&self, p: DVec3) -> Implicit {
        let mp = self.matrix * p;
        let size = |m: DMat3| DMat3::from_cols(m.x_axis.abs(), m.y_axis.abs(), m.z_axis.abs());
        let (quadratic, linear) = (p.dot(mp), self.linear.dot(p));
        Implicit {
            value: quadratic + linear + self.constant,
            gradient: 2.0 * mp + self.linear,
            terms: p.abs().dot(size(self.matrix) * p.abs())
                + self.linear.abs().dot(p.abs())
                + self.constant.abs(),
        }
    }

    /// The surface at a crossing.
    pub fn surface(&self, ray: &Ray, root: &Root) -> Surface {
        if let Some(ellipsoid) = &self.ellipsoid {
            return ellipsoid.surface(ray, root);
        }
        let near = NearLine::new(ray, self.place).at_t(root.t);
        self.surface_on(near + self.implicit(near).to_surface())
    }

    /// `None`: the projections overlap, and a point cannot be told from its `uv`. Closed quadrics are run forwards.
    pub fn surface_at(&self, part: u32, uv: DVec2) -> Option<Surface> {
        let ellipsoid = self.ellipsoid.as_ref()?;
        let on_sphere = ellipsoid.shape().surface_at(part, uv)?;
        Some(into_world(&ellipsoid.world_from_object(), &on_sphere))
    }

    fn surface_on(&self, p: DVec3) -> Surface {
        let implicit = self.implicit(p);
        let normal = implicit.normal();
        let k = if normal.x.abs() >= normal.y.abs().max(normal.z.abs()) {
            0
        } else if normal.y.abs() >= normal.z.abs() {
            1
        } else {
            2
        };
        let (i, j) = ((k + 1) % 3, (k + 2) % 3);
        let (corner, size) = self.clip.map_or((DVec3::ZERO, DVec3::ONE), |clip| (clip.min, clip.size()));
        // Along axis i at a constant j, staying on the surface.
        let tangent = |axis: usize| {
            let mut tangent = DVec3::ZERO;
            tangent[axis] = size[axis];
            tangent[k] = -size[axis] * normal[axis] / normal[k];
            tangent
        };
        let (dpdu, dpdv) = (tangent(i), tangent(j));
        let place = (p - corner) / size;
        let extent = self.clip.map_or((p - self.place).length(), |clip| clip.size().max_element());
        let bend = |dp: DVec3| implicit.turning(2.0 * (self.matrix * dp));
        Surface {
            point: p,
            // The next ray's crossing is found to the rounding of the whole box.
            point_error: gamma(8) * (p.abs() + self.place.abs())
                + DVec3::splat(gamma(16) * extent + implicit.uncertainty()),
            normal,
            uv: DVec2::new(place[i], place[j]),
            dpdu,
            dpdv,
            dndu: bend(dpdu),
            dndv: bend(dpdv),
        }
    }

    /// The box under a transform: tight for a closed quadric, that of the clipping box for a clipped one.
    pub fn bounds(&self, world_from_object: &Transform) -> Option<Aabb> {
        if let Some(ellipsoid) = &self.ellipsoid {
            let placed = *world_from_object * ellipsoid.world_from_object();
            return ellipsoid.shape().bounds(&placed);
        }
        let clip = self.clip?;
        let support = |d: DVec3| (d * clip.min).max(d * clip.max).element_sum();
        Some(bounds_from_support(world_from_object, clip.min.abs().max(clip.max.abs()), support))
    }

    /// The area of a closed quadric; infinite for others.
    pub fn area(&self) -> f64 {
        self.ellipsoid.as_ref().map_or(f64::INFINITY, PlacedShape::area)
    }

    /// The area after a transform of a closed quadric; infinite for others.
    pub fn area_under(&self, world_from_object: &Transform) -> f64 {
        let Some(ellipsoid) = &self.ellipsoid else {
            return f64::INFINITY;
        };
        PlacedShape::new(ellipsoid.shape().clone(), *world_from_object * ellipsoid.world_from_object()).area()
    }

    /// Whether it is closed.
    pub fn is_solid(&self) -> bool {
        self.ellipsoid.is_some()
    }

    /// Whether a closed quadric holds `p`.
    pub fn contains(&self, p: DVec3) -> bool {
        self.is_solid() && self.implicit(p).value <= 0.0
    }

    /// "quadric".
    pub fn name(&self) -> &'static str {
        "quadric"
    }

    /// A point on a closed quadric: uniform on the sphere that it is the image of, with the exact density; `None` for
    /// others.
    pub fn sample_area(&self, u: DVec2) -> Option<SurfaceSample> {
        self.ellipsoid.as_ref()?.sample_area(u)
    }

    /// A point on a closed quadric, by the solid angle of its sphere; `None` for others.
    pub fn sample_direction(&self, from: DVec3, u: DVec2) -> Option<DirectionSample> {
        self.ellipsoid.as_ref()?.sample_direction(from, u)
    }

    /// The density of [`Quadric::sample_direction`].
    pub fn pdf_direction(&self, ray: &Ray, surface: &Surface) -> f64 {
        self.ellipsoid.as_ref().map_or(0.0, |ellipsoid| ellipsoid.pdf_direction(ray, surface))
    }
}
