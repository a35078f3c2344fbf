//! White furnaces: in a closed room that emits as much as it absorbs, and around whatever conserves energy, everything
//! is equally bright. Sizes are not 1 and places not 0, so that missing squares and offsets show.

#![allow(clippy::unwrap_used, reason = "tests may panic")]

use std::sync::Arc;
use std::thread;

use crate::common::*;
use lumbre_geometry::{Cuboid, Shape, Sphere, Torus};
use lumbre_image::Rgb;
use lumbre_math::{DVec3, Vec3};
use lumbre_render::integrators::Path;
use lumbre_render::transport::Strategy;
use lumbre_render::{CancelToken, NoProgress, render_with};
use lumbre_scene::{GeometryDesc, MeshDesc, Scene, SceneDesc};
use lumbre_shading::uber::UberParams;
use lumbre_shading::{
    FloatTexture, Material, MaterialKind, PrincipledParams, Roughness, SpectrumTexture, VolumeParams,
};

const CENTER: DVec3 = DVec3::new(3.0, -7.0, 11.0);

/// A room that emits E = 1 - ρ and reflects ρ: the radiance everywhere in it is 1.
fn room(shape: Shape, reflectance: f32) -> SceneDesc {
    let mut desc = empty();
    let material = add_material(&mut desc, diffuse(reflectance));
    let walls = add(&mut desc, exact(shape), material);
    walls.reverse_orientation = true;
    walls.area_light = Some(glow(1.0 - reflectance));
    desc
}

fn is_long() -> bool {
    std::env::var_os("LUMBRE_LONG_TESTS").is_some()
}

/// Closed shapes, each with a place well within.
fn rooms() -> [(&'static str, Shape, DVec3); 3] {
    [
        ("sphere", Sphere::new(CENTER, 2.5).unwrap().into(), CENTER),
        ("box", Cuboid::new(CENTER - DVec3::new(2.0, 1.5, 3.0), CENTER + 2.5).unwrap().into(), CENTER),
        ("torus", Torus::new(CENTER, DVec3::Z, 4.0, 1.5).unwrap().into(), CENTER + DVec3::new(4.0, 0.0, 0.0)),
    ]
}

/// How light is found, by how many samples a pixel and bounces a path, and how far from 1 the mean may be.
#[derive(Clone, Copy)]
struct Way {
    strategy: Strategy,
    spp: u32,
    bounces: u32,
    share: f64,
}

/// The mean of the picture is 1 however light is found, by paths without roulette. Each way takes the samples per pixel
/// that its noise asks for; lights alone are noisy where they are near, and so is the tolerance.
fn assert_white(desc: SceneDesc, what: &str, ways: &[Way]) {
    let scene = Scene::build(desc).unwrap();
    for &Way { strategy, spp, bounces, share } in ways {
        let path = Path { strategy, roulette_start: 1000, ..Path::new(bounces) };
        let options = options(&scene, 12, 12, spp);
        let rendered = render_with(&scene, &options, &path, &NoProgress, &CancelToken::new()).unwrap();
        assert_eq!(rendered.stats.dropped, 0);
        assert!(rendered.stats.rays.bounce > 1_000, "{what}: {:?}", rendered.stats.rays);
        for channel in mean(&rendered.image) {
            assert_close(channel, 1.0, share, &format!("{what}, {strategy:?}"));
        }
    }
}

// Rooms keep a half or a quarter of the light at every wall: after twenty-four bounces 10⁻⁷ of it in one that is empty,
// and about 10⁻⁴ around a ring of thin glass.
const BOTH: Way = Way { strategy: Strategy::Both, spp: 320, bounces: 24, share: 2e-3 };
/// Without diffuse light there is less noise.
const QUIET: Way = Way { spp: 64, ..BOTH };
/// Rough solids are noisy: with ten times the samples they too are within 0.1 %. And light stays within them for long.
const LAYERED: Way = Way { spp: 96, bounces: 40, share: 6e-3, ..BOTH };
const LIGHTS: Way = Way { strategy: Strategy::Lights, spp: 48, share: 2.5e-2, ..BOTH };
const BSDF: Way = Way { strategy: Strategy::Bsdf, spp: 24, ..BOTH };

#[test]
fn a_sphere_a_box_and_a_torus_are_white_from_inside() {
    for (name, shape, middle) in rooms() {
        let from = middle + DVec3::new(0.4, -0.3, 0.7);
        let mut desc = room(shape, 0.5);
        desc.cameras = vec![look(from, from + DVec3::new(0.3, 1.0, -0.2), 70.0)];
        assert_white(desc, name, &[BOTH, LIGHTS, BSDF]);
    }
}

fn smooth_conductor() -> Material {
    Material::new(MaterialKind::ConductorReflectance {
        reflectance: Arc::new(SpectrumTexture::Constant(Rgb::WHITE)),
        roughness: Roughness::smooth(),
    })
}

/// Materials that absorb nothing.
fn conserving() -> Vec<(&'static str, Material)> {
    let texture = |value: f32| Arc::new(SpectrumTexture::Constant(Rgb::splat(value)));
    vec![
        ("diffuse", diffuse(1.0)),
        (
            "diffuse transmission",
            Material::new(MaterialKind::DiffuseTransmission {
                reflectance: texture(0.375),
                transmittance: texture(0.625),
                scale: 1.0,
            }),
        ),
        ("glass", Material::new(MaterialKind::Dielectric { eta: 1.5, roughness: Roughness::smooth() })),
        ("thin glass", Material::new(MaterialKind::ThinDielectric { eta: 1.7 })),
        ("mirror", smooth_conductor()),
        (
            "mixture",
            Material::new(MaterialKind::Mix {
                materials: [Arc::new(diffuse(1.0)), Arc::new(smooth_conductor())],
                amount: Arc::new(FloatTexture::Constant(0.375)),
            }),
        ),
        ("interface", Material::new(MaterialKind::Interface)),
    ]
}

#[test]
fn what_absorbs_nothing_cannot_be_seen_in_a_white_room() {
    let plain = conserving().into_iter().map(|m| (m, false));
    let materials: Vec<_> = plain.chain(principled().into_iter().map(|m| (m, true))).collect();
    // A picture is too small for more than one thread.
    let seen: usize = thread::scope(|scope| {
        let threads: Vec<_> = (materials.iter().enumerate())
            .map(|(number, ((name, material), is_layered))| {
                scope.spawn(move || assert_not_seen(number, name, material, *is_layered))
            })
            .collect();
        threads.into_iter().map(|thread| thread.join().unwrap()).sum()
    });
    assert_eq!(seen, if is_long() { 53 } else { 19 });
}

/// White Lambert as far as it is opaque, and what goes straight on for the rest.
#[test]
fn a_lossless_uber_vanishes_in_a_white_room() {
    let grey = |c: f32| Arc::new(SpectrumTexture::Constant(Rgb::splat(c)));
    let [kd, ks, kr, kt, opacity] = [1.0, 0.0, 0.0, 0.0, 0.375].map(grey);
    let eta = Arc::new(FloatTexture::Constant(1.5));
    let uber = UberParams { kd, ks, kr, kt, opacity, eta, roughness: Roughness::smooth() };
    let seen = assert_not_seen(1, "uber", &Material::new(MaterialKind::Uber(Box::new(uber))), false);
    assert!(seen > 0);
}

/// In how many shapes it was not seen. Every material is in one of the rooms, and in all of them by `cargo xtask
/// test --all`.
fn assert_not_seen(number: usize, name: &str, material: &Material, is_layered: bool) -> usize {
    let mut seen = 0;
    for (i, (room_name, walls, middle)) in rooms().into_iter().enumerate() {
        if !is_long() && i != number % 3 {
            continue;
        }
        let shapes: [Shape; 3] = [
            Sphere::new(middle + DVec3::new(0.3, 0.2, -0.25), 0.6).unwrap().into(),
            Cuboid::new(middle - DVec3::new(0.5, 0.6, 0.55), middle + 0.4).unwrap().into(),
            Torus::new(middle, DVec3::new(0.2, 1.0, 0.4), 0.6, 0.25).unwrap().into(),
        ];
        for (j, shape) in shapes.into_iter().enumerate() {
            // Every shape in the sphere; one in each of the others, and one everywhere of what takes long.
            if (i > 0 || is_layered) && i != j {
                continue;
            }
            let what = format!("{name} {} in a {room_name}", shape.name());
            let mut desc = room(walls.clone(), 0.25);
            let material = add_material(&mut desc, material.clone());
            add(&mut desc, exact(shape), material);
            desc.cameras = vec![look(middle - DVec3::new(0.2, 1.2, 0.3), middle, 70.0)];
            let both = if is_layered {
                LAYERED
            } else if ["diffuse", "diffuse transmission", "mixture", "uber"].contains(&name) {
                BOTH
            } else {
                QUIET
            };
            let ways = [both, LIGHTS, BSDF];
            assert_white(desc, &what, &ways[..if i == 0 && !is_layered { 3 } else { 1 }]);
            seen += 1;
        }
    }
    seen
}

/// Layered materials that absorb nothing.
fn principled() -> Vec<(&'static str, Material)> {
    let number = |v: f32| Arc::new(FloatTexture::Constant(v));
    let white = |metallic: f32, roughness: f32, transmission: f32, volume: bool| {
        Material::new(MaterialKind::Principled(Box::new(PrincipledParams {
            metallic: number(metallic),
            roughness: number(roughness),
            transmission: number(transmission),
            volume: volume.then(VolumeParams::default),
            ..PrincipledParams::default()
        })))
    };
    vec![
        ("polished metal", white(1.0, 0.0, 0.0, false)),
        ("rough metal", white(1.0, 0.7, 0.0, false)),
        ("glossy plastic", white(0.0, 0.2, 0.0, false)),
        ("rough pane", white(0.0, 0.5, 1.0, false)),
        ("clear solid", white(0.0, 0.0, 1.0, true)),
        ("rough solid", white(0.0, 0.4, 1.0, true)),
    ]
}

/// A coarse sphere whose vertices have the normals of the sphere: shading normals are up to 30 degrees off.
fn coarse_sphere(center: DVec3, radius: f64) -> GeometryDesc {
    let corners = [DVec3::X, DVec3::Y, -DVec3::X, -DVec3::Y, DVec3::Z, -DVec3::Z];
    // An octahedron, each edge halved once.
    let mut unit: Vec<DVec3> = vec![];
    let mut triangles = vec![];
    for pole in [4, 5] {
        for side in 0..4 {
            let (a, b) = (corners[side], corners[(side + 1) % 4]);
            let (a, b) = if pole == 4 { (a, b) } else { (b, a) };
            let c = corners[pole];
            let middle = |p: DVec3, q: DVec3| (p + q).normalize();
            let points = [a, b, c, middle(a, b), middle(b, c), middle(c, a)];
            let first = unit.len() as u32;
            unit.extend(points);
            triangles.extend([[0, 3, 5], [3, 1, 4], [5, 4, 2], [3, 4, 5]].map(|t| t.map(|i| first + i)));
        }
    }
    GeometryDesc::Mesh(Arc::new(MeshDesc {
        positions: unit.iter().map(|n| (center + radius * *n).as_vec3()).collect(),
        normals: Some(unit.iter().map(|n| n.as_vec3()).collect::<Vec<Vec3>>()),
        triangles,
        ..MeshDesc::default()
    }))
}

/// Light that a normal leads inside is lost on the black skin there; without folding directions back
/// the picture of a diffuse one is 0.5 % dark.
#[test]
fn shading_normals_take_nothing_from_what_absorbs_nothing() {
    let (mut count, mut opaque) = (0, 0);
    for (name, material) in conserving().into_iter().chain(principled()) {
        let mut desc = room(Sphere::new(CENTER, 2.5).unwrap().into(), 0.25);
        let material = add_material(&mut desc, material);
        let center = CENTER + DVec3::new(0.5, 0.25, -0.25);
        add(&mut desc, coarse_sphere(center, 0.75), material);
        let is_clear = ["diffuse transmission", "glass", "pane", "solid", "interface"]
            .iter()
            .any(|kind| name.contains(kind));
        if !is_clear {
            let black = add_material(&mut desc, diffuse(0.0));
            add(&mut desc, coarse_sphere(center, 0.748), black);
            opaque += 1;
        }
        desc.cameras = vec![look(CENTER - DVec3::new(0.3, 2.2, 0.4), CENTER, 60.0)];
        // By lights alone a narrow lobe is all noise. What the corners' normals bend stays within for long.
        let both = Way { spp: 64, bounces: 40, share: 4e-3, ..BOTH };
        assert_white(desc, name, &[both, Way { strategy: Strategy::Bsdf, ..both }]);
        count += 1;
    }
    assert_eq!((count, opaque), (13, 6));
}
