//! Small scenes, and what their pictures are compared by.

#![allow(clippy::unwrap_used, reason = "tests may panic")]
#![allow(dead_code, reason = "each test crate uses its own part")]

use std::sync::Arc;

use lumbre_geometry::Shape;
use lumbre_image::{Image, Rgb};
use lumbre_math::{DAffine3, DMat3, DVec3, Transform, Vec2, Vec3};
use lumbre_render::{CancelToken, NoProgress, RenderOptions, Rendered, render};
use lumbre_scene::{
    AreaLightDesc, Camera, CameraKind, FilterDesc, GeometryDesc, IntegratorDesc, MaterialId, MeshDesc,
    NamedMaterial, Scene, SceneDesc, ShapeDesc,
};
use lumbre_shading::{Material, MaterialKind, SpectrumTexture};

pub(crate) fn diffuse(reflectance: f32) -> Material {
    Material::new(MaterialKind::Diffuse {
        reflectance: Arc::new(SpectrumTexture::Constant(Rgb::splat(reflectance))),
    })
}

/// A scene with nothing in it but a filter of one pixel.
pub(crate) fn empty() -> SceneDesc {
    SceneDesc {
        filter: FilterDesc::Box { radius: Vec2::splat(0.5) },
        integrator: IntegratorDesc::default(),
        ..SceneDesc::default()
    }
}

pub(crate) fn add_material(desc: &mut SceneDesc, material: Material) -> MaterialId {
    desc.materials.push(NamedMaterial { name: None, material: Arc::new(material) });
    MaterialId(desc.materials.len() as u32 - 1)
}

pub(crate) fn add(desc: &mut SceneDesc, geometry: GeometryDesc, material: MaterialId) -> &mut ShapeDesc {
    desc.shapes.push(ShapeDesc {
        index: desc.shapes.len() as u32,
        geometry,
        world_from_object: Transform::IDENTITY,
        reverse_orientation: false,
        material: Some(material),
        boundary: None,
        area_light: None,
        alpha: None,
    });
    desc.shapes.last_mut().unwrap()
}

pub(crate) fn exact(shape: impl Into<Shape>) -> GeometryDesc {
    GeometryDesc::Exact(shape.into())
}

pub(crate) fn mesh(positions: Vec<Vec3>, triangles: Vec<[u32; 3]>, quads: Vec<[u32; 4]>) -> GeometryDesc {
    GeometryDesc::Mesh(Arc::new(MeshDesc { positions, triangles, quads, ..MeshDesc::default() }))
}

pub(crate) fn glow(radiance: f32) -> AreaLightDesc {
    AreaLightDesc {
        radiance: Rgb::splat(radiance),
        image: None,
        by_vertices: false,
        two_sided: false,
        power: None,
        spectrum: None,
    }
}

/// A camera in a right-handed world.
pub(crate) fn look(from: DVec3, at: DVec3, fov: f64) -> Camera {
    let forward = (at - from).normalize();
    let up = if forward.x.abs() < 0.9 { DVec3::X } else { DVec3::Y };
    let right = forward.cross(up).normalize();
    let matrix = DMat3::from_cols(right, right.cross(forward), forward);
    Camera {
        name: None,
        kind: CameraKind::Perspective { fov, lens_radius: 0.0, focal_distance: 1.0 },
        world_from_camera: Transform::from_affine(DAffine3::from_mat3_translation(matrix, from)).unwrap(),
        motion: None,
        frame_aspect: None,
        screen_window: None,
        shutter_open: 0.0,
        shutter_close: 1.0,
        medium: None,
        clip: None,
    }
}

pub(crate) fn options(scene: &Scene, width: u32, height: u32, spp: u32) -> RenderOptions {
    let mut options = changed(RenderOptions::of(scene), |it| {
        it.width = width;
        it.height = height;
        it.threads = 1;
    });
    options.stop.spp = spp;
    options
}

pub(crate) fn picture(scene: &Scene, options: &RenderOptions) -> Rendered {
    let rendered = render(scene, options, &NoProgress, &CancelToken::new()).unwrap();
    assert_eq!(rendered.stats.dropped, 0, "{:?}", rendered.stats.first_dropped);
    rendered
}

/// The mean over all pixels, channel by channel, in double precision.
pub(crate) fn mean(image: &Image) -> [f64; 3] {
    let mut sum = [0.0; 3];
    for pixel in image.pixels() {
        for (sum, channel) in sum.iter_mut().zip(pixel.to_array()) {
            *sum += f64::from(channel);
        }
    }
    sum.map(|s| s / image.pixels().len() as f64)
}

pub(crate) fn assert_close(found: f64, expected: f64, share: f64, what: &str) {
    let error = found / expected - 1.0;
    assert!(error.abs() < share, "{what}: {found}, expected {expected}, off by {:.3} %", 100.0 * error);
}

/// A camera that sees nothing but a point from close by, along a direction.
pub(crate) fn peer(at: DVec3, from: DVec3) -> Camera {
    let stand = at + 0.02 * from.normalize();
    Camera {
        kind: CameraKind::Orthographic { lens_radius: 0.0, focal_distance: 1.0 },
        screen_window: Some([-1e-7, 1e-7, -1e-7, 1e-7]),
        ..look(stand, at, 45.0)
    }
}

/// A value with some of its fields changed.
pub(crate) fn changed<T>(mut base: T, change: impl FnOnce(&mut T)) -> T {
    change(&mut base);
    base
}
