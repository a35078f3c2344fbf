//! No number makes anything here panic or run for ever, and what must be in range stays there.

use lumbre_math::distribution::{AliasTable, PiecewiseConstant1D, PiecewiseConstant2D};
use lumbre_math::glam::{DAffine3, DMat3, DMat4, DQuat, DVec2, DVec3, Vec2, Vec3};
use lumbre_math::quaternion::{self, Euler};
use lumbre_math::view::{Handedness, View};
use lumbre_math::{Frame, Transform, matrix, optics, projection, random, rounding, vector, warp, warp64};

const AWKWARD: [f64; 16] = [
    0.0,
    -0.0,
    1.0,
    -1.0,
    0.5,
    f64::NAN,
    f64::INFINITY,
    f64::NEG_INFINITY,
    f64::MAX,
    f64::MIN,
    f64::MIN_POSITIVE,
    5e-324,
    -5e-324,
    1.0 - f64::EPSILON / 2.0,
    1e17,
    -90.0,
];

fn triples() -> impl Iterator<Item = DVec3> {
    AWKWARD.into_iter().flat_map(|x| {
        AWKWARD.into_iter().flat_map(move |y| AWKWARD.into_iter().map(move |z| DVec3::new(x, y, z)))
    })
}

#[test]
fn vectors_and_maps_take_anything() {
    let mut count = 0;
    for (k, v) in triples().enumerate() {
        let other = DVec3::new(AWKWARD[k % 7], AWKWARD[k % 13], AWKWARD[k % 16]);
        if let Some(unit) = vector::unit(v) {
            assert!((unit.length() - 1.0).abs() < 1e-15, "{v}");
        }
        assert_eq!(vector::unit(v).is_some(), v.is_finite() && v != DVec3::ZERO, "{v}");
        let angle = vector::angle(v, other);
        assert!(angle.is_nan() || (0.0..=std::f64::consts::PI).contains(&angle));
        let _ = (vector::project(v, other), vector::reject(v, other), vector::perpendicular(v));
        if let Some(frame) = Frame::from_two(v, other) {
            assert!((frame.x.cross(frame.y) - frame.z).length() < 1e-12);
        }
        let _ = (optics::reflect(v, other), optics::refract(v, other, AWKWARD[k % 11]));
        for map in [
            Transform::rotate(v, other.x),
            Transform::scale(v),
            Transform::shear(v.x, v.y, v.z, other.x, other.y, other.z),
            Transform::look_at_left(v, other, DVec3::Y),
            Transform::look_at_right(v, other, DVec3::Y),
            Transform::from_matrix(DMat4::from_cols(
                v.extend(0.0),
                other.extend(0.0),
                DVec3::new(v.y, other.x, v.x).extend(0.0),
                v.extend(AWKWARD[k % 5]),
            )),
            Transform::from_affine(DAffine3::from_mat3(DMat3::from_cols(v, other, DVec3::X))),
            Transform::from_scale_rotation_translation(v, DQuat::from_xyzw(v.x, 1.0, v.z, other.x), other),
        ]
        .into_iter()
        .flatten()
        {
            // A map that was accepted has an inverse of numbers, unless the products of its parts overflow.
            assert!(!map.linear().is_nan() && !map.inverse_affine().matrix3.is_nan(), "{v} {other}");
            let _ = (map.point(v), map.normal(other), map.point_error(v, other), map.is_mirror());
            count += 1;
        }
        let _ = Euler::from_quaternion(DQuat::from_xyzw(v.x, v.y, v.z, other.x));
        let _ = Euler { heading: v.x, attitude: v.y, bank: v.z }.to_quaternion();
        let _ = quaternion::from_matrix(&DMat3::from_cols(v, other, v));
        let _ = (matrix::solve(&DMat3::from_cols(v, other, DVec3::Z), v), matrix::rotation_x(v.x));
        let _ = projection::perspective(v.x, v.y, v.z, other.x);
        let _ = projection::orthographic(v.x, v.y, v.z, other.x, other.y, other.z);
        let _ = rounding::offset_point(v, other, other, v);
        if let Some(view) = View::look_at(v, other, DVec3::Z, Handedness::Left) {
            let _ = view.perspective_direction(v.x, other.truncate(), v.truncate());
        }
        let _ = random::hash_dvec3(v);
    }
    assert!(count > 1_000, "{count}");
}

#[test]
fn warps_take_anything() {
    for v in triples() {
        let (u, s) = (v.truncate(), v.as_vec3());
        let square =
            |p: DVec2| assert!(p.is_nan() || (p.min_element() >= 0.0 && p.max_element() <= 1.0), "{v}: {p}");
        square(warp64::disk_to_square(u));
        square(warp64::sphere_to_square(v.normalize_or(DVec3::Z)));
        square(warp64::equal_area_sphere_to_square(v.normalize_or(DVec3::Z)));
        square(warp64::sphere_to_latlong(v.normalize_or(DVec3::Z)));
        let s_square =
            |p: Vec2| assert!(p.is_nan() || (p.min_element() >= 0.0 && p.max_element() <= 1.0), "{v}: {p}");
        s_square(warp::equal_area_sphere_to_square(s.normalize_or(Vec3::Z)));
        s_square(warp::sphere_to_latlong(s.normalize_or(Vec3::Z)));
        let _ = (
            warp64::equal_area_square_to_sphere(u),
            warp64::equal_area_wrap(u),
            warp64::cone_to_square(v, v.x),
        );
        let _ = (
            warp64::square_to_cosine_hemisphere(u),
            warp64::square_to_cone(u, v.z),
            warp64::square_to_sphere(u),
        );
    }
}

#[test]
fn distributions_take_anything() {
    let mut made = 0;
    for v in triples() {
        let weights = [v.x, v.y, v.z, v.x, v.y];
        let line = PiecewiseConstant1D::new(&weights);
        let table = AliasTable::new(&weights);
        let picture = PiecewiseConstant2D::new(&weights.map(|w| w as f32)[..4], 2);
        let any = weights.iter().any(|w| 0.0 < *w && w.is_finite());
        assert_eq!((line.is_some(), table.is_some()), (any, any), "{v}");
        for u in AWKWARD {
            if let (Some(line), Some(table)) = (&line, &table) {
                let (x, pdf) = line.sample(u);
                assert!((0.0..1.0).contains(&x) && pdf > 0.0 && pdf.is_finite(), "{v} {u}");
                let choice = table.sample(u);
                let weight = weights[choice.index];
                assert!(0.0 < weight && weight.is_finite(), "{v} {u}: {choice:?}");
                assert!((0.0..1.0).contains(&choice.rest));
                assert!((0.0..1.0).contains(&line.invert(u)) && line.pdf(u) >= 0.0);
                made += 1;
            }
            if let Some(picture) = &picture {
                let (p, pdf) = picture.sample(DVec2::new(u, v.x));
                assert!(p.min_element() >= 0.0 && p.max_element() < 1.0 && pdf > 0.0);
                assert!(picture.pdf(DVec2::new(v.y, u)) >= 0.0);
                let _ = picture.invert(DVec2::new(u, v.z));
            }
        }
    }
    assert!(made > 10_000, "{made}");
}
