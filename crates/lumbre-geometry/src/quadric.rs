//! General quadrics.

use std::f64::consts::PI;
use std::sync::OnceLock;

use lumbre_math::quadratic::{dop, quadratic};
use lumbre_math::rounding::gamma;
use lumbre_math::{DAffine3, DMat3, DVec2, DVec3, Elementary, Transform};

use smallvec::SmallVec;

use crate::line::{Implicit, SecondDegree, accepted, crossings, point_at, sided_gradient};
use crate::placed::into_world;
use crate::shape::check;
use crate::support::{bounds_from_support, length};
use crate::twofold::{Number, components, dot};
use crate::{
    Aabb, BoundingVolume, DirectionSample, NearestPoint, NearestPointError, PlacedShape, Ray, Root, Roots,
    Shape, ShapeError, Sphere, Surface, SurfaceSample, density, measure,
};

/// The points where `A x² + B y² + C z² + D xy + E xz + F yz + G x + H y + I z + J` is 0, optionally clipped by
/// a box.
///
/// A closed quadric, which is an unclipped ellipsoid, is a solid with outward normals: it is bounded, can be
/// sampled and can be an operand of CSG. It is the image of the unit sphere under the lower-triangular map of
/// its Cholesky factor, and is parametrised like the sphere.
///
/// Every other quadric is a surface whose normal is along the gradient. A box clips the surface and leaves it
/// open; without a box it is infinite, cannot be a light, and is the boundary of the solid where the polynomial is
/// negative, which CSG can use. It is parametrised by projection along the axis k
/// nearest to its normal: u along axis k + 1 and v along axis k + 2, cyclically, as fractions of the clipping
/// box, or as coordinates where there is none.
#[derive(Clone, Debug)]
pub struct Quadric {
    // p·matrix p + linear·p + constant; the largest coefficient is between 1 and 2.
    pub(crate) matrix: DMat3,
    pub(crate) linear: DVec3,
    pub(crate) constant: f64,
    clip: Option<Aabb>,
    // A point about which the surface is: see `SecondDegree`.
    place: DVec3,
    // The placed unit sphere, of a closed quadric.
    ellipsoid: Option<PlacedShape>,
    // The area of a clipped quadric, computed on first use.
    clipped_area: OnceLock<f64>,
}

impl Quadric {
    /// The quadric of ten coefficients A to J, clipped to `clip` if given.
    ///
    /// # Errors
    /// [`ShapeError`] unless all numbers are finite, one of A to I is not 0, the quadric has more than one real
    /// point (as a definite quadratic form shows) and the box has a volume.
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
        // A power of two, so that no digit changes and no product overflows.
        let largest = coefficients.iter().fold(0.0_f64, |m, x| m.max(x.abs()));
        let scale = (-largest.logarithm_2().floor()).clamp(-1000.0, 1000.0).exponential_2();
        let [a, b, c, d, e, f, g, h, i, j] = coefficients.map(|x| x * scale);
        let rows = [[a, 0.5 * d, 0.5 * e], [0.5 * d, b, 0.5 * f], [0.5 * e, 0.5 * f, c]];
        let mut quadric = Self {
            matrix: DMat3::from_cols_array_2d(&rows),
            linear: DVec3::new(g, h, i),
            constant: j,
            clip,
            place: DVec3::ZERO,
            ellipsoid: None,
            clipped_area: OnceLock::new(),
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

    /// The centre of symmetry, if it is unique.
    fn center(&self) -> Option<DVec3> {
        let map = Transform::from_affine(DAffine3::from_mat3(self.matrix)).ok()?;
        let center = map.inverse_vector(-0.5 * self.linear);
        center.is_finite().then_some(center)
    }

    /// The map from the unit sphere, when the quadratic form is definite; flips the signs so that the inside is
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

    /// The clipping box.
    pub fn clip(&self) -> Option<Aabb> {
        self.clip
    }

    pub(crate) fn keeps(&self, p: DVec3) -> bool {
        self.clip.is_none_or(|clip| clip.contains(p))
    }

    /// The first crossing in the ray's range.
    pub fn closest(&self, ray: &Ray) -> Option<Root> {
        accepted(ray, DVec3::ZERO, crossings(self, ray), |p| self.keeps(p)).next()
    }

    /// Every crossing in the ray's range, appended in ascending order.
    pub fn roots(&self, ray: &Ray, out: &mut Roots) {
        out.extend(accepted(ray, DVec3::ZERO, crossings(self, ray), |p| self.keeps(p)));
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
        let [x, y, z] = [self.matrix.x_axis, self.matrix.y_axis, self.matrix.z_axis].map(DVec3::abs);
        let bend = 2.0 * x.max(y).max(z).max_element();
        let near = point_at(self, ray, root.t, |p| length(self.implicit(p).gradient) / bend);
        let surface = self.surface_on(near + self.implicit(near).to_surface());
        Surface { normal: sided_gradient(self, surface.normal, ray, root.t), ..surface }
    }

    /// `None`: the projections overlap, so `uv` does not determine a point. A closed quadric has one.
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
            // The next ray's crossing has an error relative to the whole box.
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

    /// The bounding box under a transform: tight for a closed quadric, that of the clipping box for a clipped
    /// one.
    pub fn bounds(&self, world_from_object: &Transform) -> Option<Aabb> {
        if let Some(ellipsoid) = &self.ellipsoid {
            let placed = *world_from_object * ellipsoid.world_from_object();
            return ellipsoid.shape().bounds(&placed);
        }
        let clip = self.clip?;
        let support = |d: DVec3| (d * clip.min).max(d * clip.max).element_sum();
        Some(bounds_from_support(world_from_object, clip.min.abs().max(clip.max.abs()), support))
    }

    /// A bounding volume: the ellipsoid or the clipping box.
    pub fn bounding_volume(&self) -> Option<BoundingVolume> {
        match &self.ellipsoid {
            Some(ellipsoid) => ellipsoid
                .bounding_volume()
                .map(|bounding_volume| BoundingVolume { is_solid: false, ..bounding_volume }),
            None => BoundingVolume::of_box(&self.clip?),
        }
    }

    /// The area of a closed or clipped quadric; infinite for others. A clipped one's is accurate to about five
    /// digits.
    pub fn area(&self) -> f64 {
        match (&self.ellipsoid, self.clip) {
            (Some(ellipsoid), _) => ellipsoid.area(),
            (None, Some(clip)) => *self.clipped_area.get_or_init(|| self.sum_over(&clip, |_| 1.0)),
            (None, None) => f64::INFINITY,
        }
    }

    /// The area after a transform, as [`Quadric::area`].
    pub fn area_under(&self, world_from_object: &Transform) -> f64 {
        match (&self.ellipsoid, self.clip) {
            (Some(ellipsoid), _) => {
                let placed = *world_from_object * ellipsoid.world_from_object();
                PlacedShape::new(ellipsoid.shape().clone(), placed).area()
            }
            (None, Some(clip)) => {
                let stretch = measure::area_stretch(world_from_object);
                self.sum_over(&clip, |normal| (stretch * normal).length())
            }
            (None, None) => f64::INFINITY,
        }
    }

    /// The nearer or farther of the two points of the surface on the line through `p`, a point of the box,
    /// along axis `k`.
    fn above(&self, clip: &Aabb, k: usize, mut p: DVec3, is_far: bool) -> Option<DVec3> {
        p[k] = clip.center()[k];
        let line = Ray::new(p, DVec3::AXES[k]);
        let (near, far) = crossings(self, &line)?;
        let q = line.at(if is_far { far } else { near });
        (clip.min[k] <= q[k] && q[k] <= clip.max[k]).then_some(q)
    }

    /// The integral of a function of the normal n over the clipped surface.
    ///
    /// The surface is projected along all three axes, each point weighted by n_k², which sum to 1. A projected
    /// area element is |n_k| times the element, so the integrand has a factor |n_k|, which is smooth and
    /// vanishes at the silhouette.
    fn sum_over(&self, clip: &Aabb, f: impl Fn(DVec3) -> f64) -> f64 {
        let rule = measure::gauss_legendre();
        let row = |k: usize, x: f64| {
            let (i, j) = ((k + 1) % 3, (k + 2) % 3);
            let mut p = clip.min;
            p[i] = x;
            let mut sum = 0.0;
            for ends in self.breaks(clip, k, j, p).windows(2) {
                let (middle, half) = (0.5 * (ends[0] + ends[1]), 0.5 * (ends[1] - ends[0]));
                for (y, weight) in rule {
                    // At its ends the surface may become vertical like a square root, which the sine smooths.
                    let (sin, cos) = (PI * (y - 0.5)).sine_cosine();
                    p[j] = middle + half * sin;
                    for q in [false, true].into_iter().filter_map(|far| self.above(clip, k, p, far)) {
                        let normal = self.implicit(q).normal();
                        sum += weight * half * PI * cos * f(normal) * normal[k].abs();
                    }
                }
            }
            sum
        };
        // The number of pieces of a row, and the number of points above the middle of each.
        let structure = |k: usize, x: f64| {
            let (i, j) = ((k + 1) % 3, (k + 2) % 3);
            let mut p = clip.min;
            p[i] = x;
            let mut counts: SmallVec<[usize; 8]> = SmallVec::new();
            for ends in self.breaks(clip, k, j, p).windows(2) {
                p[j] = 0.5 * (ends[0] + ends[1]);
                counts.push([false, true].into_iter().filter_map(|far| self.above(clip, k, p, far)).count());
            }
            counts
        };
        let mut total = 0.0;
        for k in 0..3 {
            let i = (k + 1) % 3;
            let rows = |from: f64, to: f64| {
                rule.iter()
                    .map(|&(x, weight)| weight * (to - from) * row(k, from + x * (to - from)))
                    .sum::<f64>()
            };
            // Rows jump where they begin or end to intersect the surface: halve the strips that have not
            // converged.
            let mut strips = vec![(clip.min[i], clip.max[i], rows(clip.min[i], clip.max[i]), 0)];
            // Bounds the work for absurd coefficients.
            let mut budget = 256;
            while let Some((from, to, coarse, depth)) = strips.pop() {
                budget -= 1;
                let middle = 0.5 * (from + to);
                let (first, second) = (rows(from, middle), rows(middle, to));
                let alike =
                    structure(k, from) == structure(k, middle) && structure(k, middle) == structure(k, to);
                let settled = alike && (first + second - coarse).abs() <= 1e-6 * (first + second).abs();
                if settled || depth == 16 || budget <= 0 {
                    total += first + second;
                } else {
                    strips.push((middle, to, second, depth + 1));
                    strips.push((from, middle, first, depth + 1));
                }
            }
        }
        total
    }

    /// The places along axis `j` from `p` where the points above the row along axis `k` appear and disappear;
    /// and the row's ends.
    fn breaks(&self, clip: &Aabb, k: usize, j: usize, p: DVec3) -> SmallVec<[f64; 8]> {
        let along_j = |height: f64| {
            let mut at = p;
            (at[j], at[k]) = (0.0, height);
            crossings(self, &Ray::new(at, DVec3::AXES[j]))
        };
        // The two points above coincide where their discriminant, a quadratic along the row, vanishes.
        let meeting = {
            let mut at = p;
            (at[j], at[k]) = (0.0, 0.0);
            let gradient = 2.0 * (self.matrix * at) + self.linear;
            let value = at.dot(self.matrix * at) + self.linear.dot(at) + self.constant;
            let (m_kk, m_jk, m_jj) = (self.matrix.col(k)[k], self.matrix.col(k)[j], self.matrix.col(j)[j]);
            let (g_k, g_j) = (0.5 * gradient[k], 0.5 * gradient[j]);
            let (a, h, c) =
                (dop(m_jk, m_jk, m_kk, m_jj), dop(g_k, m_jk, m_kk, g_j), dop(g_k, g_k, m_kk, value));
            quadratic(a, h, c, dop(h, h, a, c))
        };
        let (low, high) = (clip.min[j], clip.max[j]);
        let mut breaks: SmallVec<[f64; 8]> = SmallVec::new();
        breaks.extend([low, high]);
        for pair in [along_j(clip.min[k]), along_j(clip.max[k]), meeting].into_iter().flatten() {
            breaks.extend([pair.0, pair.1].into_iter().filter(|y| low < *y && *y < high));
        }
        breaks.sort_by(f64::total_cmp);
        breaks
    }

    /// The density of sampling a point of the clipped surface, given the normal there.
    fn clipped_pdf(clip: &Aabb, normal: DVec3) -> f64 {
        normal.abs().element_sum() / (2.0 * clip.half_area())
    }

    /// Whether it separates an inside from an outside, bounded or not: unless it is clipped.
    pub fn is_solid(&self) -> bool {
        self.clip.is_none()
    }

    /// Whether `p` is inside, where the polynomial is not positive; false for a clipped quadric.
    pub fn contains(&self, p: DVec3) -> bool {
        self.is_solid() && self.implicit(p).value <= 0.0
    }

    /// The nearest point of a closed quadric to `p`, under any map.
    ///
    /// # Errors
    /// [`NearestPointError::OpenQuadric`] for others.
    pub fn closest_point(
        &self,
        world_from_object: &Transform,
        p: DVec3,
    ) -> Result<NearestPoint, NearestPointError> {
        let ellipsoid = self.ellipsoid.as_ref().ok_or(NearestPointError::OpenQuadric)?;
        ellipsoid.shape().closest_point(&(*world_from_object * ellipsoid.world_from_object()), p)
    }

    /// "quadric".
    pub fn name(&self) -> &'static str {
        "quadric"
    }

    /// A point on a closed or clipped quadric, with its exact density; `None` for others.
    ///
    /// A closed quadric is sampled as the image of its sphere. A clipped one is sampled along a random axis
    /// from a random point of the box's face: the density is proportional to |n_x| + |n_y| + |n_z|, uniform up
    /// to a factor of √3. Where that line misses the surface the result is `None`, a sample that counts as
    /// zero.
    pub fn sample_area(&self, u: DVec2) -> Option<SurfaceSample> {
        let clip = match (&self.ellipsoid, self.clip) {
            (Some(ellipsoid), _) => return ellipsoid.sample_area(u),
            (None, clip) => clip?,
        };
        let size = clip.size();
        let mut x = u.x * 2.0 * clip.half_area();
        for k in 0..3 {
            let (i, j) = ((k + 1) % 3, (k + 2) % 3);
            let face = size[i] * size[j];
            for is_far in [false, true] {
                if x >= face {
                    x -= face;
                    continue;
                }
                let mut p = clip.min;
                p[i] += x / face * size[i];
                p[j] += u.y * size[j];
                let q = self.above(&clip, k, p, is_far)?;
                let surface = self.surface_on(q + self.implicit(q).to_surface());
                return Some(SurfaceSample { surface, pdf: Self::clipped_pdf(&clip, surface.normal) });
            }
        }
        None
    }

    /// A point on a closed quadric by the solid angle of its sphere, on a clipped one as in
    /// [`Quadric::sample_area`]; `None` for others.
    pub fn sample_direction(&self, from: DVec3, u: DVec2) -> Option<DirectionSample> {
        match &self.ellipsoid {
            Some(ellipsoid) => ellipsoid.sample_direction(from, u),
            None => density::seen_from(from, self.sample_area(u)?),
        }
    }

    /// The density of [`Quadric::sample_direction`].
    pub fn pdf_direction(&self, ray: &Ray, surface: &Surface) -> f64 {
        match (&self.ellipsoid, self.clip) {
            (Some(ellipsoid), _) => ellipsoid.pdf_direction(ray, surface),
            (None, Some(clip)) => {
                density::pdf_seen_from(ray, surface, Self::clipped_pdf(&clip, surface.normal))
            }
            (None, None) => 0.0,
        }
    }
}

impl SecondDegree for Quadric {
    fn base(&self) -> DVec3 {
        DVec3::ZERO
    }

    fn center(&self) -> DVec3 {
        self.place
    }

    #[inline]
    fn along<N: Number>(&self, p: [N; 3], d: [N; 3]) -> [N; 3] {
        let [x, y, z] = [self.matrix.x_axis, self.matrix.y_axis, self.matrix.z_axis].map(components::<N>);
        let image = |v: [N; 3]| [dot(x, v), dot(y, v), dot(z, v)];
        let half_linear: [N; 3] = components(0.5 * self.linear);
        let half_gradient: [N; 3] = {
            let image = image(p);
            std::array::from_fn(|i| image[i] + half_linear[i])
        };
        let c = dot(p, half_gradient) + dot(p, half_linear) + N::from(self.constant);
        [dot(d, image(d)), dot(d, half_gradient), c]
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[track_caller]
    fn assert_area(coefficients: [f64; 10], clip: Aabb, expected: f64) {
        let quadric = Quadric::new(coefficients, Some(clip)).unwrap();
        assert!(!quadric.is_solid());
        assert!((quadric.area() / expected - 1.0).abs() < 2e-5, "{} {expected}", quadric.area());
        // The whole measured again under a transform, a similarity.
        let twice = Transform::scale(DVec3::new(2.0, -2.0, 2.0)).unwrap();
        assert!((quadric.area_under(&twice) / expected / 4.0 - 1.0).abs() < 2e-5);
    }

    #[test]
    fn clipped_quadrics_have_the_areas_of_the_shapes_that_they_are() {
        let clip = Aabb { min: DVec3::new(-2.0, -2.5, 0.25), max: DVec3::new(2.25, 2.0, 1.5) };
        // A cylinder of radius 1.5, a sphere's zone of radius 2, a cone, a slanted plane, two planes.
        assert_area([1.0, 1.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, -2.25], clip, 3.0 * PI * 1.25);
        let zone = Aabb { min: DVec3::new(-2.5, -2.5, 0.25), max: DVec3::new(2.5, 2.5, 1.5) };
        assert_area([1.0, 1.0, 1.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, -4.0], zone, 4.0 * PI * 1.25);
        let cone = PI * 2f64.sqrt() * (1.5 * 1.5 - 0.25 * 0.25);
        assert_area([1.0, 1.0, -1.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0], clip, cone);
        let slanted = 4.25 * 1.25 * 1.25f64.sqrt();
        assert_area([0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 2.0, 1.0, -0.5], clip, slanted);
        assert_area([1.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, -1.0], clip, 2.0 * 4.5 * 1.25);
    }

    #[test]
    fn equations_without_a_surface_are_refused() {
        let refused = |c: [f64; 10]| Quadric::new(c, None).is_err();
        assert!(refused([1.0, 2.0, 3.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 4.0]));
        assert!(refused([1.0, 2.0, 3.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0]));
        assert!(refused([0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 4.0]));
        assert!(refused([1.0, f64::NAN, 3.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, -4.0]));
        assert!(!refused([-1.0, -2.0, -3.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 4.0]));
        let flat = Aabb { min: DVec3::ZERO, max: DVec3::new(1.0, 2.0, 0.0) };
        assert!(Quadric::new([1.0; 10], Some(flat)).is_err());
    }

    #[test]
    fn a_box_that_cuts_nothing_leaves_a_quadric_closed() {
        let c = [1.0, 2.0, 3.0, 0.0, 0.0, 0.0, -2.0, 0.0, 0.0, -4.0];
        let wide = Aabb { min: DVec3::splat(-4.0), max: DVec3::splat(4.0) };
        let quadric = Quadric::new(c, Some(wide)).unwrap();
        assert!(quadric.is_solid() && quadric.clip().is_none());
    }
}
