//! A camera and light for descriptions that have none: a mesh alone is worth a picture too.

use std::sync::Arc;

use lumbre_geometry::Aabb;
use lumbre_image::{Image, Rgb};
use lumbre_math::{DAffine3, DMat3, DVec3, Transform};

use crate::{Camera, CameraKind, EnvironmentDesc, EnvironmentMapping, LightDesc, UpAxis};

/// Full angle of the automatic camera along the shorter side of the picture, degrees.
const FOV: f64 = 37.0;

/// A three-quarter view from the front, the right and above that holds the whole box, whatever the picture's aspect.
pub(crate) fn camera(bounds: &Aabb, up: UpAxis) -> Camera {
    let [right, upward, front] = axes(up);
    let (center, half) = if bounds.is_empty() || !(bounds.min.is_finite() && bounds.max.is_finite()) {
        (DVec3::ZERO, DVec3::ONE)
    } else {
        (bounds.center(), 0.5 * bounds.size())
    };
    let forward = -(0.58 * right + 0.42 * upward + front).normalize();
    // The worlds of meshes are right-handed.
    let x = forward.cross(upward).normalize();
    let y = x.cross(forward);

    let slope = 0.92 * (0.5 * FOV.to_radians()).tan();
    let corners = (0..8).map(|i| {
        let sign = |bit: i32| if i >> bit & 1 == 1 { 1.0 } else { -1.0 };
        half * DVec3::new(sign(0), sign(1), sign(2))
    });
    let distance = corners
        .map(|corner| corner.dot(x).abs().max(corner.dot(y).abs()) / slope - corner.dot(forward))
        .fold(0.0, f64::max);
    let distance = if distance > 0.0 { distance } else { 1.0 };

    let placement =
        DAffine3::from_mat3_translation(DMat3::from_cols(x, y, forward), center - distance * forward);
    Camera {
        name: None,
        kind: CameraKind::Perspective { fov: FOV, lens_radius: 0.0, focal_distance: distance },
        world_from_camera: Transform::from_affine(placement).unwrap_or_default(),
        frame_aspect: None,
        screen_window: None,
        shutter_open: 0.0,
        shutter_close: 1.0,
    }
}

/// A studio: a large soft key from the upper left of the automatic camera, a bright ceiling that fades to a dim floor.
pub(crate) fn light(up: UpAxis) -> LightDesc {
    const WIDTH: u32 = 128;
    const HEIGHT: u32 = 64;
    let [right, upward, front] = axes(up);
    // In the light's own space z is up, x is to the right, and y to the back.
    let key = DVec3::new(-0.75, -1.0, 1.1).normalize();
    let pixels = (0..WIDTH * HEIGHT).map(|i| {
        let (x, y) = (f64::from(i % WIDTH) + 0.5, f64::from(i / WIDTH) + 0.5);
        let uv = lumbre_math::DVec2::new(x / f64::from(WIDTH) + 0.5, y / f64::from(HEIGHT));
        let towards = lumbre_math::warp64::latlong_to_sphere(uv);
        let height = 0.5 + 0.5 * towards.z;
        let ambient = Rgb::new(0.20, 0.19, 0.18).lerp(Rgb::new(0.62, 0.66, 0.72), height as f32);
        let lobe = (18.0 * (towards.dot(key) - 1.0)).exp();
        ambient + Rgb::new(1.0, 0.97, 0.92) * (6.5 * lobe) as f32
    });
    let image = Image::from_pixels(WIDTH, HEIGHT, pixels.collect());
    let space = DAffine3::from_mat3(DMat3::from_cols(right, -front, upward));
    LightDesc::Infinite {
        world_from_light: Transform::from_affine(space).unwrap_or_default(),
        radiance: Rgb::WHITE,
        image: image.map(|image| EnvironmentDesc {
            image: Arc::new(image),
            mapping: EnvironmentMapping::LatitudeLongitude,
        }),
    }
}

/// To the right, up, and to the front of a world with this axis up.
fn axes(up: UpAxis) -> [DVec3; 3] {
    match up {
        UpAxis::Y => [DVec3::X, DVec3::Y, DVec3::Z],
        UpAxis::Z => [DVec3::X, DVec3::Z, -DVec3::Y],
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::View;
    use lumbre_math::DVec2;

    #[test]
    fn the_whole_box_is_in_the_picture_and_fills_it() {
        let boxes = [
            (DVec3::new(-3.0, 2.0, 5.0), DVec3::new(4.0, 2.5, 9.0)),
            (DVec3::new(1e6, 0.0, -1e6), DVec3::new(1e6 + 3.0, 7.0, -1e6 + 0.5)),
            (DVec3::splat(-1e-3), DVec3::splat(2e-3)),
        ];
        for (min, max) in boxes {
            for up in [UpAxis::Y, UpAxis::Z] {
                let bounds = Aabb { min, max };
                let camera = camera(&bounds, up);
                let view = View::new(&camera, 300, 200);
                let slope = (0.5 * FOV.to_radians()).tan();
                let mut widest: f64 = 0.0;
                for i in 0..8 {
                    let pick = |bit: usize| if i >> bit & 1 == 1 { max } else { min };
                    let corner = DVec3::new(pick(0).x, pick(1).y, pick(2).z);
                    let local = camera.world_from_camera.inverse_point(corner);
                    assert!(local.z > 0.0 && view.depth(corner) > 0.0);
                    let most = (local.x / local.z).abs().max((local.y / local.z).abs()) / slope;
                    widest = widest.max(most);
                }
                assert!((0.9..0.93).contains(&widest), "{widest}");
                let middle = view.ray(DVec2::new(150.0, 100.0), DVec2::splat(0.5), 1.0).ray;
                let off = (bounds.center() - middle.origin).normalize() - middle.direction;
                assert!(off.length() < 1e-9, "{off}");
            }
        }
    }

    #[test]
    fn the_picture_of_a_right_handed_world_is_not_mirrored() {
        let bounds = Aabb { min: DVec3::splat(-2.0), max: DVec3::splat(3.0) };
        let view = View::new(&camera(&bounds, UpAxis::Y), 200, 200);
        let left = view.ray(DVec2::new(10.0, 100.0), DVec2::splat(0.5), 1.0).ray.direction;
        let right = view.ray(DVec2::new(190.0, 100.0), DVec2::splat(0.5), 1.0).ray.direction;
        let top = view.ray(DVec2::new(100.0, 10.0), DVec2::splat(0.5), 1.0).ray.direction;
        assert!(left.cross(right).dot(top) < 0.0);
        assert!(top.y > right.y);
    }
}
