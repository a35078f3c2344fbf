//! What a scene file relies on: how shapes are parametrised, what constructors refuse, and that no size is too large or
//! too small.

use lumbre_geometry::{
    BilinearPatch, Cone, Cuboid, Cylinder, Disk, Plane, Ray, Roots, Shape, ShapeError, Sphere, Triangle,
};
use lumbre_math::random::RandomStream;
use lumbre_math::{DVec2, DVec3, Transform};

fn v(x: f64, y: f64, z: f64) -> DVec3 {
    DVec3::new(x, y, z)
}

/// The parameters and derivatives where a ray first meets a shape.
fn met(shape: impl Into<Shape>, origin: DVec3, direction: DVec3) -> (DVec2, DVec3, DVec3) {
    let (shape, ray) = (shape.into(), Ray::new(origin, direction));
    let root = shape.closest(&ray).expect("a hit");
    let surface = shape.surface(&ray, &root);
    (surface.uv, surface.dpdu, surface.dpdv)
}

fn near(a: DVec2, x: f64, y: f64) -> bool {
    (a - DVec2::new(x, y)).length() < 1e-12
}

#[test]
fn a_sphere_is_parametrised_as_pbrt_does_it() {
    let center = v(2.0, 3.0, 5.0);
    let whole = Sphere::new(center, 1.5).unwrap();
    // From +y: a quarter of the way round, half the way up; u grows towards -x there and v towards +z.
    let (uv, dpdu, dpdv) = met(whole, center + v(0.0, 4.0, 0.0), v(0.0, -1.0, 0.0));
    assert!(near(uv, 0.25, 0.5), "{uv}");
    assert!(dpdu.x < 0.0 && dpdu.y.abs() < 1e-9 && dpdv.z > 0.0);
    // The low end has v = 0, the high end v = 1, measured in angle.
    let part = whole.partial(-0.75, 1.5, 180.0).unwrap();
    let (uv, ..) = met(part, center + v(-4.0, 1e-9, 0.0), v(1.0, 0.0, 0.0));
    assert!((uv - DVec2::new(1.0, 0.25)).length() < 1e-8, "{uv}");
    let bottom = part.surface_at(0, DVec2::new(0.3, 0.0)).unwrap();
    assert!((bottom.point.z - (center.z - 0.75)).abs() < 1e-12);
}

#[test]
fn a_disk_and_a_cylinder_are_parametrised_as_pbrt_does_it() {
    let disk = Disk::new(v(0.0, 0.0, 3.0), DVec3::Z, 2.0, 0.5).unwrap().partial(180.0).unwrap();
    let (uv, dpdu, dpdv) = met(disk, v(0.0, 1.25, 9.0), v(0.0, 0.0, -1.0));
    assert!(near(uv, 0.5, 0.5), "{uv}");
    assert!(dpdu.x < 0.0 && dpdv.y < 0.0);
    let cylinder = Cylinder::along_z(1.5, 5.0, 1.0, false).unwrap().partial(180.0).unwrap();
    let (uv, dpdu, dpdv) = met(cylinder, v(0.0, 7.0, 2.0), v(0.0, -1.0, 0.0));
    assert!(near(uv, 0.5, 0.25), "{uv}");
    assert!(dpdu.x < 0.0 && dpdv.z > 0.0);
    // The half that phimax cuts away is not there.
    assert_eq!(cylinder.closest(&Ray::new(v(0.0, -1.0, 2.0), v(0.0, -1.0, 0.0))), None);
}

#[test]
fn a_patch_has_its_corners_at_the_corners_of_uv() {
    let corners = [v(0.2, 0.1, 0.7), v(2.0, 0.4, 0.9), v(0.5, 1.3, 0.2), v(1.6, 1.9, 1.1)];
    let [p00, p10, p01, p11] = corners;
    let patch = BilinearPatch::new(p00, p10, p01, p11).unwrap();
    for (uv, corner) in [(0.0, 0.0), (1.0, 0.0), (0.0, 1.0), (1.0, 1.0)].into_iter().zip(corners) {
        assert_eq!(patch.surface_at(0, uv.into()).unwrap().point, corner);
    }
}

#[test]
fn bad_shapes_are_refused_with_parameter_and_range() {
    let (o, inf, nan) = (v(2.0, 3.0, 5.0), f64::INFINITY, f64::NAN);
    let ball = || Sphere::new(o, 1.5).unwrap();
    let refused: Vec<(&str, Option<ShapeError>)> = vec![
        ("radius", Sphere::new(o, 0.0).err()),
        ("radius", Sphere::new(o, -2.0).err()),
        ("radius", Sphere::new(o, nan).err()),
        ("radius", Sphere::new(o, inf).err()),
        ("center", Sphere::new(v(0.0, nan, 0.0), 2.0).err()),
        ("zmin", ball().partial(nan, 1.0, 360.0).err()),
        ("phimax", ball().partial(-9.0, 9.0, 0.0).err()),
        ("phimax", ball().partial(-9.0, 9.0, 360.1).err()),
        ("phimax", ball().partial(-9.0, 9.0, nan).err()),
        ("between", ball().partial(2.0, 7.0, 90.0).err()),
        ("normal", Plane::new(o, DVec3::ZERO).err()),
        ("normal", Plane::new(o, v(nan, 1.0, 0.0)).err()),
        ("point", Plane::new(v(inf, 0.0, 0.0), o).err()),
        ("normal", Disk::new(o, DVec3::ZERO, 2.0, 0.0).err()),
        ("radius", Disk::new(o, o, -2.0, 0.0).err()),
        ("innerradius", Disk::new(o, o, 2.0, 2.0).err()),
        ("innerradius", Disk::new(o, o, 2.0, -1.0).err()),
        ("innerradius", Disk::new(o, o, 2.0, nan).err()),
        ("box", Cuboid::new(o, o).err()),
        ("box", Cuboid::new(o, v(2.0, 3.0, 9.0)).err()),
        ("p1", Cuboid::new(o, v(inf, 3.0, 9.0)).err()),
        ("same point", Cylinder::new(o, o, 2.0, true).err()),
        ("radius", Cylinder::new(o, -o, nan, true).err()),
        ("zmin", Cylinder::along_z(2.0, nan, 1.0, false).err()),
        ("between", Cylinder::along_z(2.0, inf, inf, false).err()),
        ("axis", Cylinder::infinite(o, DVec3::ZERO, 2.0).err()),
        ("same point", Cone::new(o, o, 2.0, 1.0, true).err()),
        ("radius", Cone::new(o, -o, -2.0, 1.0, true).err()),
        ("topradius", Cone::new(o, -o, 2.0, nan, true).err()),
        ("both radii", Cone::new(o, -o, 0.0, 0.0, true).err()),
        ("angle", Cone::nappe(o, o, 0.0, 3.0, false).err()),
        ("angle", Cone::nappe(o, o, 90.0, 3.0, false).err()),
        ("height", Cone::nappe(o, o, 30.0, 0.0, false).err()),
        ("axis", Cone::nappe(o, DVec3::ZERO, 30.0, 3.0, false).err()),
        ("p1", Triangle::new(o, v(0.0, 0.0, nan), o).err()),
        ("p11", BilinearPatch::new(o, -o, v(1.0, 0.0, 0.0), v(0.0, 0.0, nan)).err()),
        ("line", BilinearPatch::new(o, 2.0 * o, 3.0 * o, 4.0 * o).err()),
    ];
    for (i, (word, error)) in refused.into_iter().enumerate() {
        let message = error.unwrap_or_else(|| panic!("case {i}, {word}: accepted")).to_string();
        assert!(message.contains(word), "case {i}: {message}");
        assert!(!message.contains("out of range") || message.contains("expected"), "case {i}: {message}");
    }
    let message = Sphere::new(o, -2.0).unwrap_err().to_string();
    assert_eq!(message, "radius out of range (found -2; expected a finite number greater than 0)");
}

#[test]
fn a_world_of_any_size_is_the_same_world() {
    let shapes = |s: f64| -> Vec<Shape> {
        let (p, q, r) = (s * v(0.4, -0.3, 1.2), s * v(-1.3, 2.1, 0.6), s * v(2.2, 0.9, -0.8));
        vec![
            Sphere::new(p, 1.5 * s).unwrap().into(),
            Sphere::new(p, 1.5 * s).unwrap().partial(-0.5 * s, 1.1 * s, 200.0).unwrap().into(),
            Plane::new(p, q).unwrap().into(),
            Disk::new(p, q, 1.9 * s, 0.4 * s).unwrap().into(),
            Cuboid::new(p, q).unwrap().into(),
            Cylinder::new(p, q, 0.8 * s, true).unwrap().into(),
            Cone::new(p, q, 1.1 * s, 0.4 * s, true).unwrap().into(),
            Cone::new(p, q, 1.1 * s, 0.0, false).unwrap().into(),
            BilinearPatch::new(p, q, r, p + q - 0.5 * r).unwrap().into(),
            Triangle::new(p, q, r).unwrap().into(),
        ]
    };
    let normal = shapes(1.0);
    for exponent in [-100, 100] {
        let s = 2f64.powi(exponent);
        let mut random = RandomStream::new(41);
        for (shape, scaled) in normal.iter().zip(shapes(s)) {
            let mut hits = 0;
            for _ in 0..3000 {
                let mut point = |size: f64| {
                    let mut x = || size * (2.0 * random.next_f64() - 1.0);
                    DVec3::new(x(), x(), x())
                };
                let (origin, target) = (point(5.0), point(1.5));
                let ray = Ray::new(origin, target - origin);
                let scaled_ray = Ray::new(s * origin, s * (target - origin));
                let (mut found, mut found_scaled) = (Roots::new(), Roots::new());
                shape.roots(&ray, &mut found);
                scaled.roots(&scaled_ray, &mut found_scaled);
                // A power of two changes no digit of anything.
                assert_eq!(found, found_scaled, "{} times 2^{exponent}", shape.name());
                hits += found.len();
                for root in &found {
                    let (a, b) = (shape.surface(&ray, root), scaled.surface(&scaled_ray, root));
                    assert!((s * a.point - b.point).length() <= 1e-13 * s, "{}", shape.name());
                    // On a plane uv are lengths.
                    let uv = if shape.name() == "plane" { b.uv / s } else { b.uv };
                    assert!((a.normal - b.normal).length() < 1e-13, "{}: {a:?} {b:?}", shape.name());
                    assert!((a.uv - uv).length() < 1e-12, "{}: {a:?} {b:?}", shape.name());
                }
                let u = DVec2::new(0.3, 0.8);
                let samples = (shape.sample_direction(origin, u), scaled.sample_direction(s * origin, u));
                if let (Some(a), Some(b)) = samples {
                    assert!((a.pdf / b.pdf - 1.0).abs() < 1e-9, "{}: {a:?} {b:?}", shape.name());
                }
                assert_eq!(samples.0.is_some(), samples.1.is_some(), "{}", shape.name());
            }
            assert!(hits > 100, "{}: {hits}", shape.name());
            let (area, scaled_area) = (s * s * shape.area(), scaled.area());
            assert!(area == scaled_area || (area / scaled_area - 1.0).abs() < 1e-12, "{}", shape.name());
            let bounds = scaled.bounds(&Transform::IDENTITY).map(|b| b.size() / s);
            let expected = shape.bounds(&Transform::IDENTITY).map(|b| b.size());
            let close = |(a, b): (DVec3, DVec3)| (a - b).length() < 1e-12;
            assert!(bounds.zip(expected).is_none_or(close), "{}", shape.name());
        }
    }
}
