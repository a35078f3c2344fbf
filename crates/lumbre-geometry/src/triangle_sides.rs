//! The triangle by its plane and the sides of its edges: the test that is drawn on a blackboard.

use lumbre_math::DVec3;

use crate::TriangleHit;

/// The intersection of a line with a triangle: first with its plane, then whether the point lies on the inner side of
/// each edge.
///
/// The plane through `p0` with the normal `n = (p1 - p0) × (p2 - p0)` is met at `t = (p0 - O)·n / D·n`; and the point
/// `P` is inside when `((p1 - p0) × (P - p0))·n ≥ 0`, and so for the other two edges in turn. These three numbers over
/// `n·n` are the barycentric coordinates. Edges belong to the triangle. A. Glassner (ed.), "An Introduction to Ray
/// Tracing", 1989, chapter 2.
///
/// It is the plainest test and not the best: `P` is rounded before the edges are asked, so that two triangles may both
/// miss a ray at the edge between them ([`WatertightRay`](crate::WatertightRay) does not), and a division is made for
/// every ray that meets the plane ([`moller_trumbore`](crate::moller_trumbore) needs less).
pub fn plane_and_sides(
    origin: DVec3,
    direction: DVec3,
    p0: DVec3,
    p1: DVec3,
    p2: DVec3,
) -> Option<TriangleHit> {
    let normal = (p1 - p0).cross(p2 - p0);
    let facing = direction.dot(normal);
    if facing == 0.0 {
        return None;
    }
    let t = (p0 - origin).dot(normal) / facing;
    let p = origin + t * direction;
    let side = |from: DVec3, to: DVec3| (to - from).cross(p - from).dot(normal);
    let [across_p2, across_p0, across_p1] = [side(p0, p1), side(p1, p2), side(p2, p0)];
    let area = normal.length_squared();
    (across_p0 >= 0.0 && across_p1 >= 0.0 && across_p2 >= 0.0 && area > 0.0).then(|| TriangleHit {
        t,
        b1: across_p1 / area,
        b2: across_p2 / area,
        determinant: -facing,
    })
}

#[cfg(test)]
mod tests {
    use lumbre_math::random::RandomStream;

    use super::*;
    use crate::moller_trumbore;

    #[test]
    fn it_agrees_with_cramer_s_rule_away_from_the_edges() {
        let mut random = RandomStream::new(47);
        let mut vector = || DVec3::from_array(std::array::from_fn(|_| 6.0 * random.next_f64() - 3.0));
        let mut hits = 0;
        for _ in 0..20_000 {
            let [p0, p1, p2, origin, direction] = [vector(), vector(), vector(), vector(), vector()];
            let expected = moller_trumbore(origin, direction, p0, p1, p2);
            let found = plane_and_sides(origin, direction, p0, p1, p2);
            match (found, expected) {
                (Some(found), Some(expected)) => {
                    let scale = 1e-9 * (1.0 + expected.t.abs()) / (expected.determinant.abs().min(1.0));
                    assert!((found.t - expected.t).abs() < scale);
                    assert!((found.b1 - expected.b1).abs() < scale && (found.b2 - expected.b2).abs() < scale);
                    assert_eq!(found.determinant > 0.0, expected.determinant > 0.0);
                    hits += 1;
                }
                (None, None) => {}
                (found, expected) => {
                    let hit = found.or(expected).expect("one of them");
                    let edge = hit.b1.min(hit.b2).min(1.0 - hit.b1 - hit.b2);
                    assert!(edge < 1e-9, "{found:?}, {expected:?}");
                }
            }
        }
        assert!(hits > 500, "{hits}");
    }

    #[test]
    fn edges_and_corners_belong_to_it_and_its_plane_does_not() {
        let [a, b, c] = [DVec3::new(1.0, 1.0, 4.0), DVec3::new(5.0, 1.0, 4.0), DVec3::new(1.0, 5.0, 4.0)];
        let at = |x: f64, y: f64| plane_and_sides(DVec3::new(x, y, 1.0), DVec3::Z, a, b, c);
        assert_eq!(at(3.0, 1.0).map(|hit| (hit.t, hit.b1, hit.b2)), Some((3.0, 0.5, 0.0)));
        assert_eq!(at(1.0, 5.0).map(|hit| (hit.b1, hit.b2)), Some((0.0, 1.0)));
        assert!(at(2.0, 2.0).is_some_and(|hit| hit.determinant < 0.0), "from the back");
        assert!(at(3.5, 3.5).is_none() && at(0.5, 2.0).is_none() && at(2.0, 0.5).is_none());
        assert!(plane_and_sides(DVec3::new(0.0, 2.0, 4.0), DVec3::X, a, b, c).is_none());
        assert!(plane_and_sides(DVec3::ZERO, DVec3::Z, a, b, 2.0 * b - a).is_none(), "no area");
    }
}
