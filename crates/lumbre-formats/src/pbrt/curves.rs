//! Curves. Scenes have very many, so consecutive ones with the same state form one shape.

use std::sync::Arc;

use lumbre_geometry::{CurveBasis, CurveKind, Curves, ShapeError, Strand};
use lumbre_math::DVec3;
use lumbre_scene::{GeometryDesc, ShapeDesc};

use super::convert::Converter;
use super::params::{AT_MOST_F32, Params, Type};
use super::source::{AtSpot, Result};
use crate::Diagnostic;

/// Bytes that a scene keeps for a segment of a curve, but for its control points and normals.
const SEGMENT_BYTES: usize = 16;

impl Converter<'_, '_> {
    pub fn curve(&mut self, params: &Params) -> Result<GeometryDesc> {
        let kinds =
            [("flat", CurveKind::Flat), ("cylinder", CurveKind::Cylinder), ("ribbon", CurveKind::Ribbon)];
        let kind = params.choice("type", &kinds, CurveKind::Flat)?;
        let bases = [("bezier", CurveBasis::Bezier), ("bspline", CurveBasis::BSpline)];
        let basis = params.choice("basis", &bases, CurveBasis::Bezier)?;
        let degree = params.integer("degree", 3)?;
        let degree = match degree {
            2 | 3 => degree.unsigned_abs(),
            _ => return params.out_of_range("degree", degree.into(), "2 or 3"),
        };
        let width = params.float("width", 1.0)?;
        let widths = [self.curve_width(params, "width0", width)?, self.curve_width(params, "width1", width)?];
        // The tree is cut as suits it.
        params.count("splitdepth", 3, 0)?;
        let Some(points) = self.curve_triples(params, "P", Type::Point3)? else {
            return Err(params.spot.error("a curve has no \"point3 P\""));
        };
        let normals = match (kind, params.has("N")) {
            (CurveKind::Ribbon, _) => self.curve_triples(params, "N", Type::Normal)?,
            (_, true) => {
                self.note(params.spot_of("N"), "normals are of use to curves of type \"ribbon\" only");
                params.ignore(&["N"]);
                None
            }
            (_, false) => None,
        };
        let segments = match basis {
            CurveBasis::Bezier => points.len().div_ceil(degree as usize),
            CurveBasis::BSpline => points.len(),
        };
        self.budget.elements(segments as u64, "segments of curves").at(params.spot)?;
        let each = 3 * size_of::<[f32; 3]>() + SEGMENT_BYTES + normals.as_ref().map_or(0, |_| 24);
        self.keep(segments * each, "segments of curves", params.spot)?;
        let strand = match Strand::new(basis, degree, &points, widths) {
            Ok(strand) => strand,
            Err(ShapeError::Degenerate(rule)) => {
                let wrong = Diagnostic::error(format!("wrong number of control points: {rule}"));
                return Err(params.spot_of("P").wrong(wrong.found(points.len())));
            }
            Err(wrong) => return self.no_curve(params, wrong),
        };
        let strand = match (kind, normals) {
            (CurveKind::Ribbon, None) => return Err(params.spot.error("a ribbon has no \"normal N\"")),
            (CurveKind::Ribbon, Some(normals)) => {
                let ends = strand.segment_count() + 1;
                if normals.len() != ends {
                    let wrong = Diagnostic::error("wrong number of normals").found(normals.len());
                    let expected = format!("{ends}, one at each end of each segment");
                    return Err(params.spot_of("N").wrong(wrong.expected(expected)));
                }
                strand.with_normals(&normals)
            }
            _ => Ok(strand),
        };
        let mut curves = Curves::new(kind);
        match strand.and_then(|strand| curves.push(&strand)) {
            Ok(()) => Ok(GeometryDesc::Curves(Arc::new(curves))),
            Err(wrong) => self.no_curve(params, wrong),
        }
    }

    fn no_curve<T>(&self, params: &Params, wrong: ShapeError) -> Result<T> {
        match wrong {
            ShapeError::OutOfRange { parameter, found, expected } => {
                params.out_of_range(parameter, found, expected)
            }
            other => Err(params.spot.error(format!("this curve cannot be made: {other}"))),
        }
    }

    fn curve_width(&self, params: &Params, name: &'static str, default: f64) -> Result<f64> {
        let width = params.float(name, default)?;
        let name = if params.has(name) { name } else { "width" };
        if width as f32 > 0.0 && (width as f32).is_finite() {
            return Ok(width);
        }
        params.out_of_range(name, width, if width > 1.0 { AT_MOST_F32 } else { "more than 0" })
    }

    fn curve_triples(&self, params: &Params, name: &'static str, ty: Type) -> Result<Option<Vec<DVec3>>> {
        let Some(param) = params.typed(name, &[ty])? else { return Ok(None) };
        let numbers = param.numbers()?;
        if !numbers.len().is_multiple_of(3) {
            return Err(param.refuse("three numbers each"));
        }
        Ok(Some(numbers.chunks_exact(3).map(DVec3::from_slice).collect()))
    }
}

/// Adds a curve to the shape before it, where that is of curves which differ in their points alone; else gives it back.
pub(super) fn joined(before: Option<&mut ShapeDesc>, shape: ShapeDesc) -> Option<ShapeDesc> {
    let Some(before) = before else { return Some(shape) };
    let is_same = before.world_from_object == shape.world_from_object
        && before.reverse_orientation == shape.reverse_orientation
        && before.material == shape.material
        && before.boundary == shape.boundary
        && [&*before, &shape].iter().all(|one| one.area_light.is_none() && one.alpha.is_none());
    let (GeometryDesc::Curves(many), GeometryDesc::Curves(one)) = (&mut before.geometry, &shape.geometry)
    else {
        return Some(shape);
    };
    let is_joined = is_same
        && many.kind() == one.kind()
        && Arc::get_mut(many).is_some_and(|many| many.append(one).is_ok());
    (!is_joined).then_some(shape)
}
