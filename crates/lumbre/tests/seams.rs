//! Closed meshes with a vertex within the edge of a triangle, stitched by a triangle without area.

#![allow(clippy::unwrap_used, reason = "tests may panic")]

use lumbre::description::MeshDesc;
use lumbre::math::random::RandomStream;
use lumbre::math::{Vec2, Vec3};
use lumbre::{DVec3, Ray, Scene, SceneBuilder, ShapeBuilder};

const A: Vec3 = Vec3::new(0.5, 1.25, -0.75);
const STEP: Vec3 = Vec3::new(0.25, 0.125, 0.375);
const INSIDE: DVec3 = DVec3::new(1.375, 0.6875, 1.125);

/// A tetrahedron of the corners A, B, C and D. On one side of the edge from A to B is the triangle 0; on the other
/// there is a vertex within it for each number of steps from A, of eight, and the faces are stitched to the edge by the
/// triangles from 3 on.
fn stitched(stops: &[f32]) -> MeshDesc {
    let mut positions = vec![A, A + 8.0 * STEP, Vec3::new(3.0, -1.0, 0.5), Vec3::new(-0.5, 0.25, 2.5)];
    let mut triangles = vec![[0, 1, 2], [2, 1, 3], [0, 2, 3]];
    let mut last = 0;
    for &stop in stops {
        positions.push(A + stop * STEP);
        let next = positions.len() as u32 - 1;
        triangles.extend([[last, next, 1], [next, last, 3]]);
        last = next;
    }
    triangles.push([1, last, 3]);
    // Those of the vertices within the edge are not on a line with those of its ends.
    let uvs = (0..positions.len()).map(|i| Vec2::new(0.3 * i as f32, (7 * i % 5) as f32)).collect();
    MeshDesc { positions, triangles, uvs: Some(uvs), ..MeshDesc::default() }
}

fn scene(mesh: MeshDesc) -> Scene {
    SceneBuilder::new().shape(ShapeBuilder::mesh(mesh)).build().unwrap()
}

/// A point of the edge, and a direction from it.
fn aim(random: &mut RandomStream) -> (DVec3, DVec3) {
    let (from, to) = (A.as_dvec3(), (A + 8.0 * STEP).as_dvec3());
    let mut number = || random.next_f64() - 0.5;
    let direction = DVec3::new(number(), number(), number());
    (from.lerp(to, 0.5 + number()), direction)
}

#[test]
fn rays_through_a_stitched_edge_cross_it_once() {
    // Three tenths of a step are rounded: there, the triangles have an area, and the surface may fold.
    for (stops, is_exact) in [(&[3.0][..], true), (&[1.0, 2.0, 7.0], true), (&[2.5, 3.3], false)] {
        let scene = scene(stitched(stops));
        let mut random = RandomStream::new(7);
        assert!(scene.is_inside(INSIDE));
        let mut counts = [0; 4];
        for _ in 0..100_000 {
            let (target, offset) = aim(&mut random);
            let from = INSIDE + 0.1 * offset;
            let ray = Ray::new(from, target - from);
            counts[scene.count(&ray).min(3)] += 1;
            assert!(scene.closest(&ray).is_some(), "{stops:?} {ray:?}");
        }
        assert_eq!((counts[0], counts[2]), (0, 0), "{stops:?} {counts:?}");
        assert_eq!(counts[1] == 100_000, is_exact, "{stops:?} {counts:?}");
        // And from outside an even number.
        for _ in 0..100_000 {
            let (target, direction) = aim(&mut random);
            let from = target - 40.0 * direction.normalize();
            let count = scene.count(&Ray::new(from, target - from));
            assert!(count == 0 || count == 2 || (count == 4 && !is_exact), "{stops:?} {count}");
        }
    }
}

#[test]
fn a_split_triangle_answers_as_the_whole_one() {
    let mesh = stitched(&[1.0, 2.0, 7.0]);
    let [a, b, c] = [0, 1, 2].map(|i| mesh.positions[i].as_dvec3());
    let [uv_a, uv_b, uv_c] = [0, 1, 2].map(|i| mesh.uvs.as_ref().unwrap()[i].as_dvec2());
    let normal = (b - a).cross(c - a).normalize();
    let outside = if normal.dot(INSIDE - a) < 0.0 { normal } else { -normal };
    let scene = scene(mesh);
    let mut random = RandomStream::new(8);
    let mut met = 0;
    for _ in 0..10_000 {
        let mut weights = [random.next_f64(), random.next_f64()];
        if weights[0] + weights[1] > 1.0 {
            weights = weights.map(|weight| 1.0 - weight);
        }
        let [v, w] = weights;
        let point = a + v * (b - a) + w * (c - a);
        let ray = Ray::new(point + outside, -outside);
        let hit = scene.closest(&ray).unwrap();
        met += usize::from(hit.primitive == 0);
        if v.min(w).min(1.0 - v - w) > 1e-9 {
            assert_eq!((hit.shape, hit.primitive), (0, 0));
            let uv = uv_a + v * (uv_b - uv_a) + w * (uv_c - uv_a);
            assert!((hit.uv - uv).length() < 1e-6, "{hit:?} {uv}");
            assert!((hit.point - point).length() < 1e-6 && hit.normal.dot(normal).abs() > 1.0 - 1e-6);
            let nearest = scene.closest_point(point + 0.25 * outside, 1.0).unwrap().unwrap();
            assert_eq!((nearest.shape, nearest.primitive), (0, 0));
        }
    }
    assert!(met > 9_990, "{met}");
}
