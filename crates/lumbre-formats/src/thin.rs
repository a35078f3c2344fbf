//! Points and lines, which have no width in a file, as spheres and cylinders.

use lumbre_geometry::{Cylinder, Shape, Sphere};
use lumbre_image::Rgb;
use lumbre_math::{DVec3, Vec3};
use lumbre_scene::{ColouredShape, GeometryDesc};

use crate::budget::{Budget, LimitError};

/// The radius of points and of lines, relative to the diagonal of the model's bounding box; and the maximal
/// radius, relative to the diagonal over the square root of their number, so that clouds stay clouds.
const POINT_RADIUS: f64 = 0.004;
const LINE_RADIUS: f64 = 0.002;
const MAX_RADIUS_OF_MANY: f64 = 0.5;

/// The colour of points and lines without material and colours: visible on white and on black.
pub(crate) const INK: Rgb = Rgb::new(0.02, 0.08, 0.3);

/// Points and lines of a file.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Thin {
    /// The positions of their vertices.
    pub positions: Vec<Vec3>,
    /// Linear colours of the vertices, if they have any.
    pub colours: Option<Vec<Rgb>>,
    /// Points, by vertex.
    pub points: Vec<u32>,
    /// Segments of lines: their two vertices, and whether the line goes on from the second.
    pub segments: Vec<([u32; 2], bool)>,
}

impl Thin {
    /// Whether there are none.
    pub fn is_empty(&self) -> bool {
        self.points.is_empty() && self.segments.is_empty()
    }

    /// Spheres and cylinders, for a model whose bounding box has a diagonal of `size`; charged to the budget.
    pub(crate) fn shapes(
        &self,
        size: f64,
        budget: &Budget,
    ) -> impl Iterator<Item = Result<GeometryDesc, LimitError>> {
        let at = move |i: u32| self.positions[i as usize].as_dvec3();
        let shapes = points(at, &self.points, size).chain(segments(at, &self.segments, size));
        let colour = move |i: u32| self.colours.as_ref().map_or(Rgb::WHITE, |colours| colours[i as usize]);
        let each = if self.colours.is_some() { size_of::<ColouredShape>() } else { size_of::<Shape>() };
        shapes.map(move |(shape, ends)| {
            budget.bytes(each as u64, "points and lines")?;
            Ok(match &self.colours {
                None => GeometryDesc::Exact(shape),
                Some(_) => GeometryDesc::Coloured(Box::new(ColouredShape {
                    shape,
                    ends: ends.map(at),
                    colours: ends.map(colour),
                    coverages: [1.0; 2],
                })),
            })
        })
    }
}

/// Points as spheres, each with its vertex, twice.
pub(crate) fn points(
    at: impl Fn(u32) -> DVec3,
    points: &[u32],
    size: f64,
) -> impl Iterator<Item = (Shape, [u32; 2])> {
    let radius = radius(POINT_RADIUS, points.len(), size);
    points.iter().filter_map(move |&i| Some((Sphere::new(at(i), radius).ok()?.into(), [i, i])))
}

/// Lines as capped cylinders, with spheres where one continues as the next; each with its two vertices. A
/// segment of length zero is dropped.
pub(crate) fn segments(
    at: impl Fn(u32) -> DVec3,
    segments: &[([u32; 2], bool)],
    size: f64,
) -> impl Iterator<Item = (Shape, [u32; 2])> {
    let radius = radius(LINE_RADIUS, segments.len(), size);
    segments.iter().flat_map(move |&([a, b], goes_on)| {
        let cylinder = Cylinder::new(at(a), at(b), radius, true).ok().map(|shape| (shape.into(), [a, b]));
        let joint = Sphere::new(at(b), radius).ok().filter(|_| goes_on).map(|shape| (shape.into(), [b, b]));
        [cylinder, joint].into_iter().flatten()
    })
}

fn radius(share: f64, count: usize, size: f64) -> f64 {
    let size = if size > 0.0 && size.is_finite() { size } else { 1.0 };
    share.min(MAX_RADIUS_OF_MANY / (count.max(1) as f64).sqrt()) * size
}
