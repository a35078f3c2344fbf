//! The interface of every shape, and the errors of constructors. The list of shapes is in `lib.rs`.

/// Makes the enum from a list of `module::Type in Stored`: re-exports each type, makes it a variant of the same
/// name, and forwards every method to the variant's. To add a shape, write its file with these methods and add
/// one line to the list; `in Box<Type>` keeps a large shape out of line.
macro_rules! shapes {
    ($($(#[$doc:meta])* $module:ident::$shape:ident in $stored:ty,)+) => {
        $(pub use $module::$shape;)+

        /// An exact shape in object space.
        #[derive(Clone, Debug)]
        pub enum Shape {
            $($(#[$doc])* $shape($stored),)+
        }

        $(impl From<$shape> for Shape {
            fn from(shape: $shape) -> Self {
                Self::$shape(shape.into())
            }
        })+

        impl Shape {
            /// The first crossing in the ray's range.
            #[inline]
            pub fn closest(&self, ray: &Ray) -> Option<Root> {
                if !ray.has_ordinary_direction() {
                    return crate::scaled::closest(ray, |ray, out| self.roots(ray, out));
                }
                match self { $(Self::$shape(shape) => shape.closest(ray),)+ }
            }

            /// Whether there is any crossing in the ray's range.
            pub fn any(&self, ray: &Ray) -> bool {
                self.closest(ray).is_some()
            }

            /// Every crossing in the ray's range, appended in ascending order.
            pub fn roots(&self, ray: &Ray, out: &mut Roots) {
                if !ray.has_ordinary_direction() {
                    return crate::scaled::roots(ray, out, |ray, out| self.roots(ray, out));
                }
                match self { $(Self::$shape(shape) => shape.roots(ray, out),)+ }
            }

            /// The surface where `root` was found along `ray`.
            pub fn surface(&self, ray: &Ray, root: &Root) -> Surface {
                if !ray.has_ordinary_direction() {
                    return crate::scaled::surface(ray, root, |ray, root| self.surface(ray, root));
                }
                match self { $(Self::$shape(shape) => shape.surface(ray, root),)+ }
            }

            /// How the crossings with `ray` are found, step by step, and what became of each: the hits are those of
            /// [`Shape::roots`], to the bit.
            ///
            /// A ray whose direction is too long or too short to be squared is explained with another length, as the
            /// search takes it.
            ///
            /// ```
            /// use lumbre_geometry::{Fate, Ray, Shape, Sphere, Topic, Value};
            /// use lumbre_math::DVec3;
            ///
            /// let ball = Shape::from(Sphere::new(DVec3::ZERO, 1.0)?);
            /// let explanation = ball.explain(&Ray::new(DVec3::new(0.0, 0.0, 0.5), DVec3::Z));
            /// let equation = explanation.steps.iter().find(|step| step.topic == Topic::Quadratic).expect("told");
            /// let c = &equation.quantities[2];
            /// assert_eq!((c.symbol.as_ref(), &c.value), ("c", &Value::Number(-0.75)));
            /// let fates: Vec<(f64, Fate)> = explanation.candidates.iter().map(|one| (one.t, one.fate)).collect();
            /// assert_eq!(fates, [(-1.5, Fate::Behind), (0.5, Fate::Hit)]);
            /// # Ok::<(), lumbre_geometry::ShapeError>(())
            /// ```
            pub fn explain(&self, ray: &Ray) -> crate::Explanation {
                let mut notes = crate::explain::Notes::new(ray);
                if let Some(line) = notes.line() {
                    match self { $(Self::$shape(shape) => shape.explained(&line, &mut notes),)+ }
                }
                let mut roots = Roots::new();
                self.roots(ray, &mut roots);
                notes.finished(ray, &roots, |root| self.surface(ray, root))
            }

            /// The surface at `uv` of a part (see [`Root::part`]); `None` for a part that the shape does not
            /// have, and for shapes whose `uv` does not determine a point.
            pub fn surface_at(&self, part: u32, uv: DVec2) -> Option<Surface> {
                match self { $(Self::$shape(shape) => shape.surface_at(part, uv),)+ }
            }

            /// The tightest box around the shape under `world_from_object`, rounded outward; `None` for infinite
            /// shapes.
            pub fn bounds(&self, world_from_object: &Transform) -> Option<Aabb> {
                match self { $(Self::$shape(shape) => shape.bounds(world_from_object),)+ }
            }

            /// A bounding volume for quick rejection; `None` for infinite shapes, and for those so small or
            /// thin that it underflows.
            pub fn bounding_volume(&self) -> Option<BoundingVolume> {
                match self { $(Self::$shape(shape) => shape.bounding_volume(),)+ }
            }

            /// Area before any transform; infinite for infinite shapes.
            pub fn area(&self) -> f64 {
                match self { $(Self::$shape(shape) => shape.area(),)+ }
            }

            /// Area after `world_from_object`; infinite for infinite shapes.
            pub fn area_under(&self, world_from_object: &Transform) -> f64 {
                match self { $(Self::$shape(shape) => shape.area_under(world_from_object),)+ }
            }

            /// Whether the surface encloses a solid, so that CSG can use it.
            pub fn is_solid(&self) -> bool {
                match self { $(Self::$shape(shape) => shape.is_solid(),)+ }
            }

            /// Whether the closed solid contains `p`; false for shapes that are not solid.
            pub fn contains(&self, p: DVec3) -> bool {
                match self { $(Self::$shape(shape) => shape.contains(p),)+ }
            }

            /// The point of the surface, under `world_from_object`, that is nearest to `p`; deterministic when
            /// there are several.
            ///
            /// Triangles, boxes, planes, bilinear patches and whole spheres and ellipsoids have a method under
            /// every map, the other shapes under similarities; general quadrics have none. The result is the
            /// nearest point up to rounding.
            ///
            /// # Errors
            /// [`NearestPointError`] where there is no method; the result is never merely approximate.
            pub fn closest_point(
                &self,
                world_from_object: &Transform,
                p: DVec3,
            ) -> Result<NearestPoint, NearestPointError> {
                if !p.is_finite() {
                    return Err(NearestPointError::NotFinite);
                }
                match self { $(Self::$shape(shape) => shape.closest_point(world_from_object, p),)+ }
            }

            /// The name in the scene language.
            pub fn name(&self) -> &'static str {
                match self { $(Self::$shape(shape) => shape.name(),)+ }
            }

            /// A point uniform by area from two uniform numbers; `None` for infinite shapes.
            pub fn sample_area(&self, u: DVec2) -> Option<SurfaceSample> {
                match self { $(Self::$shape(shape) => shape.sample_area(u),)+ }
            }

            /// A point as seen from `from`, by solid angle where the shape has a method, else by area; `None`
            /// where the point is seen edge-on, and for infinite shapes.
            pub fn sample_direction(&self, from: DVec3, u: DVec2) -> Option<DirectionSample> {
                match self { $(Self::$shape(shape) => shape.sample_direction(from, u),)+ }
            }

            /// The density, per unit solid angle at `ray.origin`, with which [`Shape::sample_direction`]
            /// samples the point `surface` on the ray; 0 for points that it never samples.
            pub fn pdf_direction(&self, ray: &Ray, surface: &Surface) -> f64 {
                if !ray.has_ordinary_direction() {
                    return crate::scaled::pdf_direction(ray, |ray| self.pdf_direction(ray, surface));
                }
                match self { $(Self::$shape(shape) => shape.pdf_direction(ray, surface),)+ }
            }
        }
    };
}
pub(crate) use shapes;

/// `closest` and `roots` of a shape that a line crosses at most twice, from its `crossings`.
macro_rules! two_crossings {
    ($visibility:vis) => {
        /// The first crossing in the ray's range.
        #[inline]
        $visibility fn closest(&self, ray: &crate::Ray) -> Option<crate::Root> {
            let [near, far] = self.crossings(ray);
            near.or(far)
        }

        /// Every crossing in the ray's range, appended in ascending order.
        $visibility fn roots(&self, ray: &crate::Ray, out: &mut crate::Roots) {
            out.extend(self.crossings(ray).into_iter().flatten());
        }
    };
}
pub(crate) use two_crossings;

/// `is_solid` and `contains` of a surface that encloses nothing.
macro_rules! open_surface {
    () => {
        /// False: the surface encloses nothing.
        pub fn is_solid(&self) -> bool {
            false
        }

        /// False: the surface encloses nothing.
        pub fn contains(&self, _p: lumbre_math::DVec3) -> bool {
            false
        }
    };
}
pub(crate) use open_surface;

/// `sample_direction` and its density for a shape that is sampled uniformly by area, from its `sample_area` and `area`.
macro_rules! sampled_by_area {
    ($visibility:vis) => {
        /// A point uniform by area, as seen from `from`; `None` when it is seen edge-on.
        $visibility fn sample_direction(
            &self,
            from: lumbre_math::DVec3,
            u: lumbre_math::DVec2,
        ) -> Option<crate::DirectionSample> {
            crate::density::seen_from(from, self.sample_area(u)?)
        }

        /// The density of `sample_direction`, per unit solid angle.
        $visibility fn pdf_direction(&self, ray: &crate::Ray, surface: &crate::Surface) -> f64 {
            crate::density::pdf_seen_from(ray, surface, 1.0 / self.area())
        }
    };
}
pub(crate) use sampled_by_area;

/// Area and sampling of a shape that is infinite, or whose area has no closed form.
macro_rules! unsampled {
    () => {
        /// Infinite.
        pub fn area(&self) -> f64 {
            f64::INFINITY
        }

        /// Infinite.
        pub fn area_under(&self, _world_from_object: &lumbre_math::Transform) -> f64 {
            f64::INFINITY
        }

        /// `None`: nothing is sampled.
        pub fn sample_area(&self, _u: lumbre_math::DVec2) -> Option<crate::SurfaceSample> {
            None
        }

        /// `None`: nothing is sampled.
        pub fn sample_direction(
            &self,
            _from: lumbre_math::DVec3,
            _u: lumbre_math::DVec2,
        ) -> Option<crate::DirectionSample> {
            None
        }

        /// 0: nothing is sampled.
        pub fn pdf_direction(&self, _ray: &crate::Ray, _surface: &crate::Surface) -> f64 {
            0.0
        }
    };
}
pub(crate) use unsampled;

/// Why a shape's parameters are refused.
#[derive(Clone, Debug, PartialEq)]
#[non_exhaustive]
pub enum ShapeError {
    /// A parameter is not finite, or out of range.
    OutOfRange {
        /// The parameter's name, as in the scene language.
        parameter: &'static str,
        /// The given value.
        found: f64,
        /// The accepted range, in words.
        expected: &'static str,
    },
    /// The parameters together are degenerate: why.
    Degenerate(&'static str),
}

impl std::fmt::Display for ShapeError {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match self {
            Self::OutOfRange { parameter, found, expected } => {
                write!(f, "{parameter} out of range (found {found}; expected {expected})")
            }
            Self::Degenerate(why) => f.write_str(why),
        }
    }
}

impl std::error::Error for ShapeError {}

/// The checks that constructors share.
pub(crate) mod check {
    use super::ShapeError;
    use lumbre_math::{DVec3, Elementary};

    /// A finite length greater than zero.
    pub(crate) fn positive(parameter: &'static str, found: f64) -> Result<f64, ShapeError> {
        within(parameter, found, found > 0.0 && found.is_finite(), "a finite number greater than 0")
    }

    /// A point without NaNs and infinities.
    pub(crate) fn finite(parameter: &'static str, found: DVec3) -> Result<DVec3, ShapeError> {
        match found.to_array().into_iter().find(|x| !x.is_finite()) {
            None => Ok(found),
            Some(found) => Err(ShapeError::OutOfRange { parameter, found, expected: "finite coordinates" }),
        }
    }

    /// A direction of any non-zero length, as a unit vector.
    pub(crate) fn direction(parameter: &'static str, found: DVec3) -> Result<DVec3, ShapeError> {
        let found = finite(parameter, found)?;
        let largest = found.abs().max_element();
        if largest == 0.0 {
            let expected = "a direction of a length other than 0";
            return Err(ShapeError::OutOfRange { parameter, found: 0.0, expected });
        }
        // Scaled first, so that no length over- or underflows.
        let scaled = found / largest;
        Ok(scaled / scaled.length())
    }

    /// A direction of any non-zero length, times the power of two that brings its length near 1.
    pub(crate) fn scaled_direction(parameter: &'static str, found: DVec3) -> Result<DVec3, ShapeError> {
        direction(parameter, found)?;
        let exponent = found.abs().max_element().logarithm_2().floor();
        // In two steps, since 2^1074 overflows and its square root does not.
        let half = (-0.5 * exponent).floor();
        Ok(found * half.exponential_2() * (-exponent - half).exponential_2())
    }

    /// A sweep about the axis in (0°, 360°], in radians.
    pub(crate) fn sweep(degrees: f64) -> Result<f64, ShapeError> {
        within("phimax", degrees, 0.0 < degrees && degrees <= 360.0, "degrees in (0, 360]")
            .map(f64::to_radians)
    }

    /// `found`, if `accepted`.
    pub(crate) fn within(
        parameter: &'static str,
        found: f64,
        accepted: bool,
        expected: &'static str,
    ) -> Result<f64, ShapeError> {
        if accepted { Ok(found) } else { Err(ShapeError::OutOfRange { parameter, found, expected }) }
    }
}

#[cfg(test)]
mod tests {
    #[test]
    fn a_shape_fits_in_two_cache_lines_and_a_word() {
        assert!(size_of::<crate::Shape>() <= 136, "{}", size_of::<crate::Shape>());
    }
}
