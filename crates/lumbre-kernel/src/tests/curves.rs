//! Curves among everything else.

use std::sync::Arc;

use lumbre_geometry::{CurveBasis, CurveKind, Curves, Strand};
use lumbre_math::DVec3;

use super::oracle::{check, check_batches};
use super::scenes::{Random, build, ray, repeats, soup, with_every_preset};
use crate::GeometryKind;

const CENTER: DVec3 = DVec3::new(1.5, -2.25, 4.0);

#[test]
fn a_tree_of_curves_and_triangles_finds_what_a_loop_finds() {
    with_every_preset(|| {
        let mut random = Random(733);
        let mut kinds: Vec<_> = [(CurveKind::Flat, 0), (CurveKind::Cylinder, 3)]
            .into_iter()
            .map(|(kind, splits)| {
                let mut curves = Curves::new(kind);
                for _ in 0..30 {
                    let start = CENTER + 3.0 * random.vector();
                    let points: Vec<_> = (0..7).map(|_| start + random.vector()).collect();
                    let widths = [random.between(0.05, 0.4), random.between(0.01, 0.2)];
                    let strand = Strand::new(CurveBasis::BSpline, 3, &points, widths);
                    curves.push(&strand.expect("it is a curve")).expect("it is near");
                }
                GeometryKind::Custom(Arc::new(curves.with_splits(splits)) as _)
            })
            .collect();
        kinds.push(GeometryKind::Mesh(Arc::new(soup(&mut random, 60, CENTER, 3.0))));
        let accel = build(kinds);
        let rays: Vec<_> = (0..repeats(800)).map(|_| ray(&mut random, CENTER, 3.0)).collect();
        let hits: usize = rays.iter().map(|ray| check(&accel, ray)).sum();
        assert!(hits > rays.len() / 3, "{hits} of {}", rays.len());
        check_batches(&accel, &rays);
    });
}
