//! One curve on its way into many: control points of several bases become cubic Bézier segments.

use lumbre_math::DVec3;

use crate::ShapeError;
use crate::shape::check;

/// What control points mean.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum CurveBasis {
    /// Bézier segments; each begins at the last point of the previous one.
    #[default]
    Bezier,
    /// A uniform B-spline, which does not reach its first and last points.
    BSpline,
}

/// A curve of one or more cubic Bézier segments, with a width at each of their ends.
#[derive(Clone, Debug, PartialEq)]
pub struct Strand {
    // 3 n + 1, finite.
    points: Vec<DVec3>,
    // n + 1, finite and positive in single precision, too.
    widths: Vec<f64>,
    // None, or n + 1 unit vectors.
    normals: Vec<DVec3>,
}

impl Strand {
    /// A curve by control points of a basis and a degree, 2 or 3. Its width goes linearly from the first segment's
    /// start to the last one's end.
    ///
    /// Bézier segments of degree d are of d n + 1 points; a B-spline of m points has m - d segments. Quadratic segments
    /// are made cubic, which changes nothing about them.
    ///
    /// # Errors
    /// [`ShapeError`] for another degree, another number of points, points that are not finite, and widths that are not
    /// greater than 0.
    pub fn new(
        basis: CurveBasis,
        degree: u32,
        points: &[DVec3],
        [width0, width1]: [f64; 2],
    ) -> Result<Self, ShapeError> {
        if degree != 2 && degree != 3 {
            return Err(ShapeError::OutOfRange {
                parameter: "degree",
                found: degree.into(),
                expected: "2 or 3",
            });
        }
        let degree = degree as usize;
        let fits = match basis {
            CurveBasis::Bezier => points.len() > degree && (points.len() - 1).is_multiple_of(degree),
            CurveBasis::BSpline => points.len() > degree,
        };
        if !fits {
            return Err(ShapeError::Degenerate(match (basis, degree) {
                (CurveBasis::Bezier, 2) => {
                    "a quadratic Bézier curve of n segments has 2 n + 1 control points"
                }
                (CurveBasis::Bezier, _) => "a cubic Bézier curve of n segments has 3 n + 1 control points",
                (CurveBasis::BSpline, 2) => "a quadratic B-spline has 3 control points or more",
                (CurveBasis::BSpline, _) => "a cubic B-spline has 4 control points or more",
            }));
        }
        for &point in points {
            check::finite("P", point)?;
        }
        let raised = |[a, b, c]: [DVec3; 3]| [a, a + 2.0 / 3.0 * (b - a), c + 2.0 / 3.0 * (b - c), c];
        let mut all = vec![];
        let mut add = |segment: [DVec3; 4]| {
            let known = usize::from(!all.is_empty());
            all.extend(&segment[known..]);
        };
        match (basis, degree) {
            (CurveBasis::Bezier, 3) => all.extend(points),
            (CurveBasis::Bezier, _) => {
                points.windows(3).step_by(2).for_each(|p| add(raised([p[0], p[1], p[2]])));
            }
            (CurveBasis::BSpline, 3) => points.windows(4).for_each(|p| {
                let (inner, outer) = (p[1] + (p[2] - p[1]) / 3.0, p[1] + (p[2] - p[1]) * (2.0 / 3.0));
                let start = (p[0] + 4.0 * p[1] + p[2]) / 6.0;
                add([start, inner, outer, (p[1] + 4.0 * p[2] + p[3]) / 6.0]);
            }),
            (CurveBasis::BSpline, _) => points.windows(3).for_each(|p| {
                add(raised([0.5 * (p[0] + p[1]), p[1], 0.5 * (p[1] + p[2])]));
            }),
        }
        let segments = (all.len() - 1) / 3;
        let width = |i: usize| width0 + (width1 - width0) * (i as f64 / segments as f64);
        Self { points: all, widths: (0..=segments).map(width).collect(), normals: vec![] }.checked()
    }

    /// A smooth curve through two points or more, each with its width: a Catmull–Rom spline. Its ends are straight.
    ///
    /// # Errors
    /// [`ShapeError`] for fewer points, another number of widths, points that are not finite, and widths that are not
    /// greater than 0.
    pub fn through(points: &[DVec3], widths: &[f64]) -> Result<Self, ShapeError> {
        if points.len() < 2 {
            return Err(ShapeError::Degenerate("a curve goes through two points or more"));
        }
        if widths.len() != points.len() {
            return Err(ShapeError::Degenerate("a curve has a width for each of its points"));
        }
        for &point in points {
            check::finite("P", point)?;
        }
        let last = points.len() - 1;
        let tangent = |i: usize| match (i.checked_sub(1), i < last) {
            (Some(before), true) => (points[i + 1] - points[before]) / 6.0,
            (None, _) => (points[1] - points[0]) / 3.0,
            (Some(before), false) => (points[last] - points[before]) / 3.0,
        };
        let mut all = vec![points[0]];
        for i in 0..last {
            all.extend([points[i] + tangent(i), points[i + 1] - tangent(i + 1), points[i + 1]]);
        }
        Self { points: all, widths: widths.to_vec(), normals: vec![] }.checked()
    }

    /// The same curve with normals of a ribbon, of any length: one at each end of a segment.
    ///
    /// # Errors
    /// [`ShapeError`] for another number of normals, and for normals that are no directions.
    pub fn with_normals(mut self, normals: &[DVec3]) -> Result<Self, ShapeError> {
        if normals.len() != self.widths.len() {
            return Err(ShapeError::Degenerate("a ribbon has a normal at each end of each segment"));
        }
        self.normals = normals.iter().map(|&n| check::direction("N", n)).collect::<Result<_, _>>()?;
        Ok(self)
    }

    /// The control points of its cubic Bézier segments: 3 n + 1, since each begins where the one before ends.
    pub fn points(&self) -> &[DVec3] {
        &self.points
    }

    /// The widths at the ends of segments.
    pub fn widths(&self) -> &[f64] {
        &self.widths
    }

    /// The normals at the ends of segments; none unless it is a ribbon.
    pub fn normals(&self) -> &[DVec3] {
        &self.normals
    }

    /// The number of segments.
    pub fn segment_count(&self) -> usize {
        self.widths.len() - 1
    }

    fn checked(self) -> Result<Self, ShapeError> {
        for &width in &self.widths {
            let accepted = width as f32 > 0.0 && (width as f32).is_finite();
            check::within("width", width, accepted, "a number greater than 0, of single precision")?;
        }
        Ok(self)
    }
}
