//! The answer in double precision from a loop over everything, and who differs from it.

use lumbre_geometry::{Curves, Ray};
use lumbre_kernel::TriangleMesh;
use lumbre_math::DVec3;
use rayon::prelude::*;

use crate::program::Query;
use crate::scene::Scene;

/// What is certain about a ray.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Truth {
    /// Where it hits for certain, away from every edge.
    certain: Option<f64>,
    /// Where it hits, or passes an edge so near that rounding in double precision may decide.
    possible: Option<f64>,
}

/// How near to an edge a hit is uncertain, in barycentrics.
const EDGE: f64 = 1e-12;

/// How far two answers may lie apart: a hundred-thousandth of the way, and of the scene.
const APART: f64 = 1e-5;

/// The truth about a ray; `curves` are those of the scene. The exact shapes and curves answer for themselves.
pub(crate) fn truth(scene: &Scene, curves: &Curves, ray: &Ray) -> Truth {
    let mut truth = Truth { certain: None, possible: None };
    for mesh in &scene.meshes {
        truth.of_mesh(mesh, ray);
    }
    for placement in &scene.placements {
        truth.of_mesh(&scene.placed_meshes[placement.mesh], &ray.into_object(&placement.transform()));
    }
    for sphere in &scene.spheres.spheres {
        truth.take(sphere_root(sphere, ray), true);
    }
    for curve in 0..curves.primitive_count() {
        truth.take(curves.closest(curve, ray).map(|root| root.t), true);
    }
    for shape in scene.shapes.iter() {
        truth.take(shape.closest(ray).map(|root| root.t), true);
    }
    truth
}

impl Truth {
    fn take(&mut self, t: Option<f64>, is_certain: bool) {
        let Some(t) = t else { return };
        let nearer = |best: Option<f64>| Some(best.map_or(t, |best| best.min(t)));
        self.possible = nearer(self.possible);
        if is_certain {
            self.certain = nearer(self.certain);
        }
    }

    fn of_mesh(&mut self, mesh: &TriangleMesh, ray: &Ray) {
        for triangle in &mesh.indices {
            let [a, b, c] = triangle.map(|i| mesh.positions[i as usize].as_dvec3());
            let (ab, ac) = (b - a, c - a);
            let across = ray.direction.cross(ac);
            let det = ab.dot(across);
            if det == 0.0 {
                continue;
            }
            let from = ray.origin - a;
            let along = from.cross(ab);
            let (u, v, t) = (from.dot(across) / det, ray.direction.dot(along) / det, ac.dot(along) / det);
            let inside = u.min(v).min(1.0 - u - v);
            if inside >= -EDGE && ray.contains(t) {
                self.take(Some(t), inside > EDGE);
            }
        }
    }

    /// Whether an answer agrees. `length` is the length of the ray's direction, `extent` the size of the scene.
    pub(crate) fn agrees(&self, query: Query, answer: Option<f64>, length: f64, extent: f64) -> bool {
        match (query, answer) {
            (_, None) => self.certain.is_none(),
            (Query::Any, Some(_)) => self.possible.is_some(),
            (Query::Closest, Some(t)) => {
                let is_at = |truth: Option<f64>| truth.is_some_and(|truth| is_near(t, truth, length, extent));
                is_at(self.certain) || is_at(self.possible)
            }
        }
    }
}

/// Whether two `t` are one.
fn is_near(a: f64, b: f64, length: f64, extent: f64) -> bool {
    (a - b).abs() <= APART * (b.abs() + extent / length)
}

fn sphere_root(&[x, y, z, radius]: &[f32; 4], ray: &Ray) -> Option<f64> {
    let from = ray.origin - DVec3::new(x.into(), y.into(), z.into());
    let radius = f64::from(radius);
    let a = ray.direction.length_squared();
    let middle = -from.dot(ray.direction) / a;
    let rest = radius * radius - (from + middle * ray.direction).length_squared();
    let half = (rest / a).sqrt();
    // A NaN, from a ray that misses, is in no range.
    [middle - half, middle + half].into_iter().find(|&t| ray.contains(t))
}

/// A ray and what is true of it.
pub(crate) struct Sample {
    /// Which ray of the list.
    pub index: usize,
    /// What is true.
    pub truth: Truth,
}

/// The truth about some of the rays, evenly spread over the list; their number is limited by `tests` tests of
/// primitives, at most 1,000.
pub(crate) fn sample(scene: &Scene, rays: &[Ray], tests: usize) -> Vec<Sample> {
    let placed: usize = scene.placements.iter().map(|p| scene.placed_meshes[p.mesh].indices.len()).sum();
    let primitives = scene.primitive_count() + placed;
    let curves = scene.curves.curves();
    let count = (tests / primitives.max(1)).clamp(2, 1_000).min(rays.len());
    (0..count)
        .into_par_iter()
        .map(|i| {
            let index = (i * rays.len() + rays.len() / 2) / count;
            Sample { index, truth: truth(scene, &curves, &rays[index]) }
        })
        .collect()
}

/// On how many rays two programs differ: one hits and the other does not, or they hit far apart.
pub(crate) fn differences(
    query: Query,
    rays: &[Ray],
    one: &[Option<f64>],
    other: &[Option<f64>],
    extent: f64,
) -> usize {
    let differ = |((ray, one), other): ((&Ray, &Option<f64>), &Option<f64>)| match (one, other) {
        (None, None) => false,
        (Some(a), Some(b)) => query == Query::Closest && !is_near(*a, *b, ray.direction.length(), extent),
        _ => true,
    };
    rays.iter().zip(one).zip(other).filter(|pair| differ(*pair)).count()
}

#[cfg(test)]
mod tests {
    use std::sync::Arc;

    use lumbre_kernel::Preset;

    use super::*;
    use crate::ours::{Asked, Precision};
    use crate::program::Program;
    use crate::rays::{self, PictureSize, Rays, Work};
    use crate::worlds::RECIPES;
    use crate::{crates, ours};

    fn check(program: &dyn Program, least: f64) {
        let mut hits = 0;
        for recipe in RECIPES.iter().filter(|recipe| ["scan-1k", "mixed"].contains(&recipe.name)) {
            let scene = recipe.make();
            if program.refuses(&scene).is_some() {
                continue;
            }
            let accel = ours::build(&scene, Preset::Balanced).expect("a sound scene");
            let extent = accel.bounds().size().max_element();
            let built = program.build(&scene, 2).expect("a sound scene");
            for work in Work::ALL {
                let size = PictureSize { width: 192, height: 128 };
                let Rays { list, by_squares } = rays::make(work, &scene, &accel, size);
                let mut places = by_squares;
                places.sort_unstable();
                assert_eq!(places, (0..list.len()).collect::<Vec<_>>());
                let wide: Vec<_> = list.iter().map(|ray| ray.to_f64()).collect();
                let truths = sample(&scene, &wide, 4_000_000);
                assert!(truths.len() > 100, "{}, {}: {} rays", recipe.name, work.name(), truths.len());
                for query in Query::ALL {
                    let mut pass = built.tree.prepare(query, &list);
                    pass.reset();
                    pass.run();
                    let answers = pass.answers();
                    let right = truths.iter().filter(|sample| {
                        let length = wide[sample.index].direction.length();
                        sample.truth.agrees(query, answers[sample.index], length, extent)
                    });
                    let (right, all) = (right.count() as f64, truths.len() as f64);
                    assert!(right >= least * all, "{} {work:?} {query:?}: {right} of {all}", scene.name);
                    hits += answers.iter().flatten().count();
                }
            }
        }
        assert!(hits > 4_000, "{hits}");
    }

    #[test]
    fn our_kernel_agrees_with_the_loop_over_everything() {
        let usual = ours::Lumbre {
            preset: Preset::Balanced,
            asked: Asked::Each,
            precision: Precision::Double,
            places_spheres: false,
        };
        check(&ours::Lumbre { preset: Preset::Best, ..usual }, 1.0);
        check(&ours::Lumbre { asked: Asked::ByBatches, places_spheres: true, ..usual }, 1.0);
        for asked in Asked::OTHERS {
            check(&ours::Lumbre { asked, ..usual }, 1.0);
        }
    }

    #[test]
    fn our_kernel_agrees_with_the_loop_in_single_precision_too() {
        for asked in [Asked::Each, Asked::ByBatches] {
            let (preset, precision) = (Preset::Balanced, Precision::Single);
            check(&ours::Lumbre { preset, asked, precision, places_spheres: false }, 0.999);
        }
    }

    #[test]
    fn obvhs_agrees_with_the_loop_over_everything() {
        check(&crates::Obvhs, 0.99);
    }

    #[test]
    fn bvh_agrees_with_the_loop_over_everything() {
        check(&crates::BinaryBvh, 0.99);
    }

    #[test]
    fn a_wrong_answer_is_noticed() {
        let recipe = &RECIPES[0];
        let scene = recipe.make();
        let ray = Ray::new(DVec3::new(0.02, 0.03, 5.0), DVec3::new(0.01, 0.0, -2.0));
        let truth = truth(&scene, &scene.curves.curves(), &ray);
        let t = truth.certain.expect("the middle of the ball");
        let says = |answer| truth.agrees(Query::Closest, answer, 2.0, 2.0);
        assert!(says(Some(t)) && says(Some(t * (1.0 + 1e-6))));
        assert!(!says(None) && !says(Some(1.01 * t)));
        assert!(!truth.agrees(Query::Any, None, 2.0, 2.0));
        let mut moved = Scene::empty("moved", scene.camera, scene.lamp);
        moved.meshes = vec![Arc::new(TriangleMesh::default())];
        assert!(!super::truth(&moved, &moved.curves.curves(), &ray).agrees(Query::Any, Some(t), 2.0, 2.0));
        assert_eq!(
            differences(Query::Closest, &[ray; 3], &[Some(t); 3], &[Some(t), None, Some(2.0 * t)], 2.0),
            2
        );
    }

    #[test]
    fn a_tree_answers_again_what_it_answered_before() {
        let scene = RECIPES[0].make();
        let accel = ours::build(&scene, Preset::Balanced).expect("a sound scene");
        let list = rays::make(Work::Random, &scene, &accel, PictureSize { width: 40, height: 20 }).list;
        let (preset, asked, precision) = (Preset::Balanced, Asked::Each, Precision::Single);
        let program = ours::Lumbre { preset, asked, precision, places_spheres: false };
        let built = program.build(&scene, 1).expect("a sound scene");
        let mut pass = built.tree.prepare(Query::Closest, &list);
        pass.run();
        let first = pass.answers();
        pass.reset();
        assert!(pass.answers().iter().all(Option::is_none));
        pass.run();
        assert_eq!(pass.answers(), first);
        assert!(first.iter().flatten().count() > 200);
    }
}
