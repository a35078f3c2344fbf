//! Curves against a search in small steps along them, and how little it matters how they are cut.

use std::f64::consts::PI;

use lumbre_geometry::{CurveBasis, CurveKind, Curves, Ray, Root, Roots, ShapeError, Strand};
use lumbre_math::random::RandomStream;
use lumbre_math::{DVec2, DVec3};

const CENTER: DVec3 = DVec3::new(3.0, -2.0, 0.5);

fn vector(random: &mut RandomStream) -> DVec3 {
    DVec3::from_array(std::array::from_fn(|_| 2.0 * random.next_f64() - 1.0))
}

/// A B-spline whose points wander.
fn wander(random: &mut RandomStream, points: usize, widths: [f64; 2]) -> Strand {
    let mut p = CENTER + vector(random);
    let step = vector(random).normalize();
    let points: Vec<DVec3> = (0..points)
        .map(|_| {
            p += 0.7 * step + 0.5 * vector(random);
            p
        })
        .collect();
    Strand::new(CurveBasis::BSpline, 3, &points, widths).expect("it is a curve")
}

fn of(kind: CurveKind, strands: &[Strand]) -> Curves {
    let mut curves = Curves::new(kind);
    strands.iter().for_each(|strand| curves.push(strand).expect("it is near"));
    // A segment is a primitive.
    curves.with_splits(0)
}

/// A ray past some place of a strand, about as near as it is wide.
fn ray_near(random: &mut RandomStream, strand: &Strand) -> Ray {
    let segment = (random.next_f64() * strand.segment_count() as f64) as usize;
    let p: [DVec3; 4] = std::array::from_fn(|i| strand.points()[3 * segment + i]);
    let target = bezier(&p, random.next_f64()).0 + 0.7 * strand.widths()[0] * vector(random);
    let direction = vector(random).normalize();
    let length = 0.2 + 2.0 * random.next_f64();
    Ray::new(target - (1.0 + 4.0 * random.next_f64()) * direction, length * direction)
}

fn bezier(p: &[DVec3; 4], u: f64) -> (DVec3, DVec3) {
    let v = 1.0 - u;
    let place = v * v * v * p[0] + 3.0 * v * v * u * p[1] + 3.0 * v * u * u * p[2] + u * u * u * p[3];
    let slope = 3.0 * (v * v * (p[1] - p[0]) + 2.0 * u * v * (p[2] - p[1]) + u * u * (p[3] - p[2]));
    (place, slope)
}

fn all_roots(curves: &Curves, ray: &Ray) -> Vec<(u32, Root)> {
    let mut found: Vec<(u32, Root)> = vec![];
    for primitive in 0..curves.primitive_count() {
        let mut roots = Roots::new();
        curves.roots(primitive, ray, &mut roots);
        assert!(roots.windows(2).all(|pair| pair[0].t <= pair[1].t));
        assert_eq!(curves.closest(primitive, ray).map(|root| root.t), roots.first().map(|root| root.t));
        found.extend(roots.into_iter().map(|root| (primitive, root)));
    }
    found.sort_by(|a, b| a.1.t.total_cmp(&b.1.t));
    found
}

/// Places where a strand is nearest to the ray's line, within half of its width: t, and the distance over half the
/// width.
fn by_steps(curves: &Curves, ray: &Ray, steps: usize) -> Vec<(f64, f64)> {
    let z = ray.direction.normalize();
    let segments = curves.primitive_count();
    let distance = |i: usize| {
        let (segment, u) = ((i / steps) as u32, (i % steps) as f64 / steps as f64);
        let p = bezier(&curves.control_points(segment.min(segments - 1)), u).0 - ray.origin;
        ((p - z * z.dot(p)).length(), z.dot(p), curves.width(segment, u))
    };
    let count = segments as usize * steps;
    let mut found = vec![];
    let all: Vec<_> = (0..count).map(distance).collect();
    for i in 1..count - 1 {
        let ((before, ..), (here, height, width), (after, ..)) = (all[i - 1], all[i], all[i + 1]);
        if here <= before && here < after {
            found.push((height / ray.direction.length(), here / (0.5 * width)));
        }
    }
    found.retain(|&(t, _)| ray.contains(t));
    found.sort_by(|a, b| a.0.total_cmp(&b.0));
    found
}

#[test]
fn crossings_are_where_small_steps_along_the_curve_find_them() {
    let mut random = RandomStream::new(71);
    let (mut hits, mut misses) = (0, 0);
    for _ in 0..60 {
        let strand = wander(&mut random, 7, [0.06, 0.02]);
        let curves = of(CurveKind::Flat, std::slice::from_ref(&strand));
        for _ in 0..40 {
            let ray = ray_near(&mut random, &strand);
            let expected = by_steps(&curves, &ray, 4000);
            // Too near to an end or to the rim for steps to decide.
            let is_clear = expected.iter().all(|&(_, share)| (share - 1.0).abs() > 0.02);
            let found = all_roots(&curves, &ray);
            let ends = |&(primitive, root): &(u32, Root)| {
                let last = curves.primitive_count() - 1;
                (primitive == 0 && root.local.x < 0.01) || (primitive == last && root.local.x > 0.99)
            };
            if !is_clear || found.iter().any(ends) {
                continue;
            }
            let expected: Vec<_> = expected.iter().filter(|(_, share)| *share < 1.0).collect();
            assert_eq!(found.len(), expected.len(), "{ray:?}: {found:?}, {expected:?}");
            for ((primitive, root), (t, share)) in found.iter().zip(expected) {
                assert!((root.t - t).abs() * ray.direction.length() < 2e-2, "{root:?}, {t}");
                assert!(((2.0 * root.local.y - 1.0).abs() - share).abs() < 1e-2, "{root:?}, {share}");
                // The foot of the perpendicular, to the last digits.
                let (p, slope) = bezier(&curves.control_points(*primitive), root.local.x);
                let away = p - ray.at(root.t);
                assert!(away.dot(ray.direction).abs() < 1e-12 * ray.direction.length(), "{root:?}");
                assert!(away.dot(slope).abs() < 1e-12 * slope.length(), "{root:?}: {}", away.dot(slope));
                hits += 1;
            }
            misses += usize::from(found.is_empty());
        }
    }
    assert!(hits > 700 && misses > 400, "{hits}, {misses}");
}

#[test]
fn it_does_not_matter_into_how_many_pieces_segments_are_cut() {
    let mut random = RandomStream::new(72);
    let mut hits = 0;
    for kind in [CurveKind::Flat, CurveKind::Cylinder, CurveKind::Ribbon] {
        for round in 0..40 {
            let width = [0.3, 0.05, 0.002][round % 3];
            let mut strand = wander(&mut random, 6, [width, 0.4 * width]);
            if kind == CurveKind::Ribbon {
                let normals: Vec<DVec3> = (0..=strand.segment_count()).map(|_| vector(&mut random)).collect();
                strand = strand.with_normals(&normals).unwrap();
            }
            let whole = of(kind, std::slice::from_ref(&strand));
            for _ in 0..40 {
                let ray = ray_near(&mut random, &strand);
                let expected = all_roots(&whole, &ray);
                for splits in 1..=5 {
                    let cut = whole.clone().with_splits(splits);
                    let found = all_roots(&cut, &ray);
                    assert_eq!(found.len(), expected.len(), "{splits}: {ray:?}\n{found:?}\n{expected:?}");
                    for ((primitive, root), (_, one)) in found.iter().zip(&expected) {
                        assert!((root.t - one.t).abs() < 1e-9 && (root.local - one.local).length() < 1e-6);
                        let point = cut.surface(*primitive, &ray, root).point;
                        assert!(cut.bounds(*primitive).contains(point), "{point:?}");
                        hits += 1;
                    }
                }
            }
        }
    }
    assert!(hits > 5000, "{hits}");
}

#[test]
fn no_ray_passes_where_segments_or_pieces_meet() {
    let mut random = RandomStream::new(73);
    for (round, width) in [0.2, 0.01, 1e-4].into_iter().enumerate() {
        let smooth = wander(&mut random, 9, [width; 2]);
        // Segments that meet at an angle.
        let bent: Vec<DVec3> =
            (0..13).map(|i| CENTER + DVec3::X * f64::from(i) + 0.4 * vector(&mut random)).collect();
        let bent = Strand::new(CurveBasis::Bezier, 3, &bent, [width; 2]).unwrap();
        for strand in [smooth, bent] {
            let curves = of(CurveKind::Flat, std::slice::from_ref(&strand)).with_splits(round as u32);
            for _ in 0..4000 {
                let joint = 1 + (random.next_f64() * (strand.segment_count() - 1) as f64) as usize;
                let z = vector(&mut random).normalize();
                let tangent = strand.points()[3 * joint + 1] - strand.points()[3 * joint - 1];
                let across = z.cross(tangent).normalize();
                let tiny = tangent * (random.next_f64() - 0.5) * [0.0, 1e-15, 1e-12, 1e-9][round];
                let sideways = 0.45 * width * (2.0 * random.next_f64() - 1.0);
                let target = strand.points()[3 * joint] + sideways * across + tiny;
                let ray = Ray::new(target - 3.0 * z, z);
                let found = all_roots(&curves, &ray);
                assert!(!found.is_empty(), "{width}: {ray:?}");
            }
        }
    }
}

#[test]
fn a_straight_curve_faces_every_ray_and_ends_flat() {
    let points: Vec<DVec3> = (0..4).map(|i| CENTER + DVec3::X * 2.0 * f64::from(i)).collect();
    let strand = Strand::new(CurveBasis::Bezier, 3, &points, [0.5, 0.25]).unwrap();
    for kind in [CurveKind::Flat, CurveKind::Cylinder] {
        let curves = of(kind, std::slice::from_ref(&strand));
        for (x, y, expected) in [
            (3.0, 0.18, Some(DVec2::new(0.5, 0.5 - 0.18 / 0.375))),
            (3.0, -0.18, Some(DVec2::new(0.5, 0.5 + 0.18 / 0.375))),
            (3.0, 0.19, None),
            (-0.001, 0.0, None),
            (0.001, 0.249, Some(DVec2::new(0.001 / 6.0, 0.0))),
            (5.999, 0.0, Some(DVec2::new(5.999 / 6.0, 0.5))),
            (6.001, 0.0, None),
        ] {
            // Two units of t to the axis.
            let ray = Ray::new(CENTER + DVec3::new(x, y, 6.0), DVec3::NEG_Z * 3.0);
            let root = curves.closest(0, &ray);
            assert_eq!(root.is_some(), expected.is_some(), "{x}, {y}");
            let (Some(root), Some(uv)) = (root, expected) else { continue };
            assert!((root.local - uv).abs().max_element() < 5e-3, "{root:?}, {uv}");
            assert!((root.t - 2.0).abs() < 1e-12);
            let surface = curves.surface(0, &ray, &root);
            let angle = if kind == CurveKind::Flat { 0.0 } else { (root.local.y - 0.5) * PI };
            let normal = DVec3::new(0.0, -angle.sin(), angle.cos());
            assert!((surface.normal - normal).length() < 1e-9, "{surface:?}");
            assert!((surface.dpdu - DVec3::X * 6.0).length() < 1e-6);
            assert!((surface.dpdv.length() - curves.width(0, root.local.x)).abs() < 1e-9);
            assert!(surface.dpdv.dot(surface.normal).abs() < 1e-9);
            // Rays leave by a width at least, and by two at most.
            let away = (surface.offset_origin(DVec3::Z) - surface.point).length();
            let width = curves.width(0, root.local.x);
            assert!(width < away && away < 2.0 * width, "{away}, {width}");
        }
        assert!(curves.closest(0, &Ray::new(CENTER + DVec3::Z, DVec3::Z)).is_none());
        assert!((curves.area() - 6.0 * 0.375).abs() < 1e-6);
    }
}

#[test]
fn a_ribbon_is_as_wide_as_its_normal_lets_it_look() {
    let points: Vec<DVec3> = (0..4).map(|i| CENTER + DVec3::X * 2.0 * f64::from(i)).collect();
    let strand = Strand::new(CurveBasis::Bezier, 3, &points, [0.5; 2]).unwrap();
    // A quarter turn from +z to +y.
    let strand = strand.with_normals(&[DVec3::Z * 3.0, DVec3::Y * 0.2]).unwrap();
    let curves = of(CurveKind::Ribbon, &[strand]);
    for i in 1..20 {
        let u = f64::from(i) / 20.0;
        let angle = 0.5 * PI * u;
        let half = 0.25 * angle.cos();
        for (share, hits) in [(0.99, true), (-0.99, true), (1.01, false), (-1.01, false)] {
            let from = CENTER + DVec3::new(6.0 * u, share * half, 5.0);
            let ray = Ray::new(from, DVec3::NEG_Z);
            let root = curves.closest(0, &ray);
            assert_eq!(root.is_some(), hits, "{u}, {share}");
            let Some(root) = root else { continue };
            let normal = curves.surface(0, &ray, &root).normal;
            assert!((normal - DVec3::new(0.0, angle.sin(), angle.cos())).length() < 1e-6, "{normal:?}");
        }
    }
}

#[test]
fn an_arc_covers_its_length_times_its_width() {
    let p = [(-0.9, -0.6), (-0.9, 0.5), (0.9, 0.5), (0.9, -0.6)].map(|(x, y)| DVec3::new(x, y, 0.0) + CENTER);
    let strand = Strand::new(CurveBasis::Bezier, 3, &p, [0.2; 2]).unwrap();
    let curves = of(CurveKind::Flat, &[strand]);
    let length: f64 = (0..10_000).map(|i| bezier(&p, (f64::from(i) + 0.5) / 1e4).1.length() / 1e4).sum();
    assert!((curves.area() - 0.2 * length).abs() < 1e-4, "{} {length}", curves.area());
    let side = 600;
    let mut hits = 0;
    for y in 0..side {
        for x in 0..side {
            let at = |i: i32| 2.5 * ((f64::from(i) + 0.5) / f64::from(side) - 0.5);
            let ray = Ray::new(CENTER + DVec3::new(at(x), at(y), -4.0), DVec3::Z);
            hits += usize::from(curves.closest(0, &ray).is_some());
        }
    }
    let covered = 6.25 * hits as f64 / f64::from(side * side);
    assert!((covered - 0.2 * length).abs() < 2e-3 * length * 0.2, "{covered}, {}", 0.2 * length);
}

#[test]
fn bases_and_degrees_give_the_curves_of_their_definitions() {
    let mut random = RandomStream::new(74);
    let p: [DVec3; 5] = std::array::from_fn(|_| CENTER + vector(&mut random));
    let segment =
        |strand: &Strand, i: usize| -> [DVec3; 4] { std::array::from_fn(|k| strand.points()[3 * i + k]) };
    let quadratic = Strand::new(CurveBasis::Bezier, 2, &p, [0.3, 0.1]).unwrap();
    let cubic_spline = Strand::new(CurveBasis::BSpline, 3, &p, [0.3, 0.1]).unwrap();
    let spline = Strand::new(CurveBasis::BSpline, 2, &p, [0.3, 0.1]).unwrap();
    assert_eq!([&quadratic, &cubic_spline, &spline].map(Strand::segment_count), [2, 2, 3]);
    assert!((spline.widths()[1] - (0.3 - 0.2 / 3.0)).abs() < 1e-12);
    for i in 0..2 {
        for u in [0.0, 0.25, 0.6, 1.0] {
            let v = 1.0 - u;
            let expected = v * v * p[2 * i] + 2.0 * u * v * p[2 * i + 1] + u * u * p[2 * i + 2];
            assert!((bezier(&segment(&quadratic, i), u).0 - expected).length() < 1e-12);
            let weights = [
                v * v * v,
                3.0 * u * u * u - 6.0 * u * u + 4.0,
                -3.0 * u * u * u + 3.0 * u * u + 3.0 * u + 1.0,
                u * u * u,
            ];
            let expected: DVec3 = weights.iter().zip(&p[i..]).map(|(w, p)| *w * *p).sum::<DVec3>() / 6.0;
            assert!((bezier(&segment(&cubic_spline, i), u).0 - expected).length() < 1e-12);
            let weights = [v * v, -2.0 * u * u + 2.0 * u + 1.0, u * u];
            let expected: DVec3 = weights.iter().zip(&p[i..]).map(|(w, p)| *w * *p).sum::<DVec3>() / 2.0;
            assert!((bezier(&segment(&spline, i), u).0 - expected).length() < 1e-12);
        }
    }
    let through = Strand::through(&p, &[0.1, 0.2, 0.3, 0.4, 0.5]).unwrap();
    for (i, p) in p.iter().enumerate() {
        assert!((through.points()[3 * i] - *p).length() < 1e-12);
        let neighbours =
            [(3 * i).checked_sub(1), Some(3 * i + 1)].map(|k| k.and_then(|k| through.points().get(k)));
        if let [Some(a), Some(b)] = neighbours {
            assert!((0.5 * (*a + *b) - *p).length() < 1e-12, "smooth");
        }
    }
}

#[test]
fn what_is_no_curve_is_refused() {
    let line: Vec<DVec3> = (0..4).map(|i| CENTER + DVec3::X * f64::from(i)).collect();
    let of =
        |basis, degree, points: &[DVec3], widths| Strand::new(basis, degree, points, widths).unwrap_err();
    let width = |found| ShapeError::OutOfRange {
        parameter: "width",
        found,
        expected: "a number greater than 0, of single precision",
    };
    assert_eq!(of(CurveBasis::Bezier, 3, &line, [-0.5, 0.5]), width(-0.5));
    assert_eq!(of(CurveBasis::Bezier, 3, &line, [0.5, 0.0]), width(0.0));
    assert!(matches!(of(CurveBasis::Bezier, 3, &line, [f64::NAN, 0.5]), ShapeError::OutOfRange { .. }));
    assert!(matches!(
        of(CurveBasis::Bezier, 4, &line, [1.0; 2]),
        ShapeError::OutOfRange { parameter: "degree", .. }
    ));
    for (basis, degree, count) in [
        (CurveBasis::Bezier, 3, 3),
        (CurveBasis::Bezier, 2, 4),
        (CurveBasis::Bezier, 2, 2),
        (CurveBasis::BSpline, 3, 3),
        (CurveBasis::BSpline, 2, 2),
        (CurveBasis::BSpline, 2, 0),
    ] {
        assert!(matches!(of(basis, degree, &line[..count], [1.0; 2]), ShapeError::Degenerate(_)));
    }
    let mut far = line.clone();
    far[2].y = f64::INFINITY;
    assert!(matches!(
        of(CurveBasis::BSpline, 3, &far, [1.0; 2]),
        ShapeError::OutOfRange { parameter: "P", .. }
    ));
    let strand = Strand::new(CurveBasis::Bezier, 3, &line, [1.0; 2]).unwrap();
    assert!(strand.clone().with_normals(&[DVec3::Z]).is_err());
    assert!(strand.clone().with_normals(&[DVec3::Z, DVec3::ZERO]).is_err());
    assert!(Curves::new(CurveKind::Ribbon).push(&strand).is_err());
    far[2].y = 1e39;
    let strand = Strand::new(CurveBasis::Bezier, 3, &far, [1.0; 2]).unwrap();
    assert!(Curves::new(CurveKind::Flat).push(&strand).is_err());
    assert!(Strand::through(&line[..1], &[1.0]).is_err() && Strand::through(&line, &[1.0]).is_err());
}

#[test]
fn curves_of_all_sizes_give_finite_hits_or_none() {
    let mut random = RandomStream::new(75);
    let mut hits = 0;
    for size in [1e-30, 1e-6, 1.0, 1e6, 1e30] {
        let points: Vec<DVec3> = (0..7).map(|_| size * vector(&mut random)).collect();
        let strand = Strand::new(CurveBasis::Bezier, 3, &points, [0.2 * size; 2]).unwrap();
        let curves = of(CurveKind::Cylinder, &[strand]);
        for length in [1e-200, 1e-20, 1.0, 1e20, 1e200] {
            for _ in 0..50 {
                let z = vector(&mut random);
                let ray = Ray::new(0.4 * size * vector(&mut random) - size * z, z * length);
                for (primitive, root) in all_roots(&curves, &ray) {
                    let surface = curves.surface(primitive, &ray, &root);
                    assert!(surface.point.is_finite() && surface.normal.is_normalized(), "{surface:?}");
                    hits += 1;
                }
            }
        }
        for z in [DVec3::ZERO, DVec3::NAN, DVec3::INFINITY] {
            assert!(all_roots(&curves, &Ray::new(DVec3::ZERO, z)).is_empty());
        }
        assert!(all_roots(&curves, &Ray::new(DVec3::NAN, DVec3::Z)).is_empty());
    }
    assert!(hits > 300, "{hits}");
}

#[test]
fn points_that_coincide_and_rays_along_a_curve_do_no_harm() {
    for points in [[CENTER; 4], [CENTER, CENTER, CENTER + DVec3::X, CENTER + DVec3::X]] {
        let strand = Strand::new(CurveBasis::Bezier, 3, &points, [0.5; 2]).unwrap();
        let curves = of(CurveKind::Flat, &[strand]);
        for direction in [DVec3::X, DVec3::Z, DVec3::ONE] {
            for (primitive, root) in all_roots(&curves, &Ray::new(CENTER - 2.0 * direction, direction)) {
                let surface = curves.surface(primitive, &Ray::new(CENTER - direction, direction), &root);
                assert!(surface.normal.is_normalized() && surface.dpdu.is_finite(), "{surface:?}");
            }
        }
    }
}

#[test]
fn curves_that_join_others_far_away_are_met_where_they_are() {
    let mut random = RandomStream::new(31);
    let straight = |from: DVec3, to: DVec3| {
        let points = [0.0, 0.31, 0.64, 1.0].map(|s| from.lerp(to, s));
        Strand::new(CurveBasis::Bezier, 3, &points, [1e-3; 2]).unwrap()
    };
    // Single precision moves the points by about as much as the curves are wide.
    let mut all = of(CurveKind::Flat, &[straight(DVec3::ZERO, DVec3::X)]);
    for i in 1..200 {
        let from = DVec3::splat(2e4) + vector(&mut random);
        let near = of(CurveKind::Flat, &[straight(from, from + vector(&mut random))]);
        all.append(&near).unwrap();
        let p = all.control_points(i);
        let u = random.next_f64();
        let v = 1.0 - u;
        let on = v * v * v * p[0] + 3.0 * u * v * v * p[1] + 3.0 * u * u * v * p[2] + u * u * u * p[3];
        // Across the curve: along it, a ray passes nearest at another place.
        let way = (p[3] - p[0]).cross(vector(&mut random)).normalize();
        let root = all.closest(i, &Ray::new(on - 2.0 * way, way));
        assert!(root.is_some_and(|root| (root.t - 2.0).abs() < 1e-3), "{i}: {root:?}");
    }
}
