//! Vertices computed in lanes against vertices computed one by one.

#![allow(clippy::unwrap_used, reason = "tests may panic")]

use std::sync::Arc;

use lumbre_image::{Bitmap, Channels, Encoding, PixelData};
use lumbre_math::{DAffine3, DMat3, DVec2, DVec3, Transform, Vec2, Vec3};
use lumbre_scene::{
    Camera, CameraKind, GeometryDesc, InstanceDesc, MaterialId, MeshDesc, NamedMaterial, ObjectDesc,
    ObjectId, SamplerDesc, SamplerKind, Scene, SceneDesc, ShapeDesc, View,
};
use lumbre_shading::{
    ImageFilter, ImageTexture, Mapping2d, Material, MaterialKind, MipMap, MipMapOptions, PrincipledParams,
    ShadingNormals, Spectrum, SpectrumTexture, Texture, Wrap,
};
use lumbre_simd::InstructionSet;

use crate::transport::{Record, Sampler, Strategy};
use crate::wave::setting::Setting;
use crate::wave::vertices::{FOLDS, HAS_TERMINATOR_OFFSET, SIDED};
use crate::wave::{Precision, PrimaryHits, SampleId, Wave};

const SIDE: u32 = 48;
const CENTRE: DVec3 = DVec3::new(3.0, -2.0, 5.0);

/// A coarse ball of radius 1.7. Its lower half has no normals, and a band has faces turned against theirs.
fn ball() -> MeshDesc {
    let (columns, rows) = (13_u32, 7_u32);
    let (mut positions, mut normals, mut uvs) = (Vec::new(), Vec::new(), Vec::new());
    for row in 0..=rows {
        for column in 0..=columns {
            let uv = Vec2::new(column as f32 / columns as f32, row as f32 / rows as f32);
            let (around, down) = (std::f32::consts::TAU * uv.x, std::f32::consts::PI * uv.y);
            let out = Vec3::new(down.sin() * around.cos(), down.cos(), down.sin() * around.sin());
            positions.push(CENTRE.as_vec3() + 1.7 * out);
            normals.push(if row > 4 { Vec3::ZERO } else { 3.0 * out });
            uvs.push(2.5 * uv);
        }
    }
    let mut triangles = Vec::new();
    for row in 0..rows {
        for column in 0..columns {
            let at = |x: u32, y: u32| (row + y) * (columns + 1) + column + x;
            let mut two = [[at(0, 0), at(1, 0), at(1, 1)], [at(0, 0), at(1, 1), at(0, 1)]];
            if row == 2 {
                two.iter_mut().for_each(|triangle| triangle.swap(0, 1));
            }
            triangles.extend(two);
        }
    }
    MeshDesc { positions, normals: Some(normals), uvs: Some(uvs), triangles, ..MeshDesc::default() }
}

fn image(texels: impl Fn(usize) -> [f32; 3]) -> ImageTexture {
    let data = PixelData::F32((0..64).flat_map(texels).collect());
    let bitmap = Bitmap::new(8, 8, Channels::Rgb, data, Encoding::Linear).unwrap();
    let options = MipMapOptions { wrap: Wrap::Repeat, filter: ImageFilter::Trilinear };
    let image = Arc::new(MipMap::new(Arc::new(bitmap), options));
    ImageTexture { mapping: Mapping2d::IDENTITY, image, scale: 1.0, invert: false }
}

fn uniform() -> Material {
    Material::principled(Spectrum::new(0.7, 0.4, 0.2), 0.3, 0.45)
}

fn textured() -> Material {
    let shade = |i: usize| [0.2 + 0.01 * (i % 8) as f32, 0.9 - 0.01 * i as f32, 0.5];
    let base: SpectrumTexture = Texture::Image(image(shade));
    let params = PrincipledParams { base_color: Arc::new(base), ..PrincipledParams::default() };
    Material::new(MaterialKind::Principled(Box::new(params)))
}

fn bumpy() -> Material {
    let tilted = |i: usize| [0.5 + 0.02 * (i % 8) as f32, 0.5 - 0.004 * i as f32, 0.9];
    Material { normal_map: Some(image(tilted)), ..textured() }
}

/// A map that mirrors and shears around the centre of the ball.
fn sheared() -> Transform {
    let linear =
        DMat3::from_cols(DVec3::new(-0.9, 0.2, 0.1), DVec3::new(0.3, 0.8, -0.2), DVec3::new(0.0, 0.25, 1.1));
    let affine = DAffine3::from_mat3_translation(linear, CENTRE - linear * CENTRE);
    Transform::from_affine(affine).unwrap()
}

/// The ball, if `instance` is given as an instance.
fn scene(material: Material, reverse: bool, instance: Option<Transform>) -> Scene {
    let (from, forward) = (CENTRE + DVec3::new(2.0, 1.3, 4.0), DVec3::new(-2.0, -1.3, -4.0).normalize());
    let right = forward.cross(DVec3::Y).normalize();
    let matrix = DMat3::from_cols(right, right.cross(forward), forward);
    let camera = Camera {
        name: None,
        kind: CameraKind::Perspective { fov: 48.0, lens_radius: 0.0, focal_distance: 1.0 },
        world_from_camera: Transform::from_affine(DAffine3::from_mat3_translation(matrix, from)).unwrap(),
        motion: None,
        frame_aspect: None,
        screen_window: None,
        shutter_open: 0.0,
        shutter_close: 1.0,
        medium: None,
        clip: None,
    };
    let shape = ShapeDesc {
        index: 0,
        geometry: GeometryDesc::Mesh(Arc::new(ball())),
        world_from_object: Transform::IDENTITY,
        reverse_orientation: reverse,
        material: Some(MaterialId(0)),
        boundary: None,
        area_light: None,
        alpha: None,
    };
    let (mut shapes, mut objects, mut instances) = (vec![shape], vec![], vec![]);
    if let Some(map) = instance {
        let name = "ball".to_owned();
        objects.push(ObjectDesc { name, shapes: std::mem::take(&mut shapes), instances: vec![] });
        // The second makes sure that it is not simply taken into the world.
        let far = Transform::translate(DVec3::new(0.0, 0.0, -40.0));
        instances.extend(
            [map, far].map(|map| InstanceDesc { object: ObjectId(0), world_from_object: map.into() }),
        );
    }
    Scene::build(SceneDesc {
        cameras: vec![camera],
        materials: vec![NamedMaterial { name: None, material: Arc::new(material) }],
        shapes,
        objects,
        instances,
        ..SceneDesc::default()
    })
    .unwrap()
}

/// The first vertices of paths through all pixels; all one by one if BSDFs are to be regularized, which first vertices
/// never are.
fn first_vertices<'s>(
    scene: &'s Scene,
    shading_normals: ShadingNormals,
    set: InstructionSet,
    one_by_one: bool,
) -> Wave<'s> {
    let setting = Setting {
        scene,
        sampler: SamplerKind::Sobol,
        strategy: Strategy::Both,
        max_depth: 5,
        roulette_start: 5,
        regularize: one_by_one,
        shading_normals,
        has_solids: false,
        has_media: false,
        has_panes: false,
        moves: false,
        is_spectral: false,
        instruction_set: set,
        merging: None,
    };
    let view = View::new(&scene.cameras()[0], SIDE, SIDE);
    let sampler = Sampler::new(&SamplerDesc { kind: SamplerKind::Sobol, spp: None, seed: 3 });
    let ids: Vec<_> = (0..SIDE * SIDE).map(|i| SampleId { x: i % SIDE, y: i / SIDE, index: 0 }).collect();
    let (mut wave, mut record) = (Wave::default(), Record::default());
    let mut primary_hits =
        PrimaryHits::start(scene, &view, &mut wave, Precision::Single, &sampler, &ids, None);
    for (slot, id) in ids.iter().enumerate() {
        let film = DVec2::new(f64::from(id.x) + 0.37, f64::from(id.y) + 0.61);
        primary_hits.set_ray(slot, &view.ray(film, DVec2::splat(0.5), 0.0, 0.25));
    }
    primary_hits.search();
    wave.make_vertices(&setting, &mut record);
    wave
}

fn vector(columns: &[Vec<f32>; 3], at: usize) -> Vec3 {
    Vec3::new(columns[0][at], columns[1][at], columns[2][at])
}

fn compare(
    material: Material,
    reverse: bool,
    instance: Option<Transform>,
    shading_normals: ShadingNormals,
) -> [usize; 3] {
    let is_placed = instance.is_some();
    let scene = scene(material, reverse, instance);
    let lanes = first_vertices(&scene, shading_normals, InstructionSet::detect(), false);
    let oracle = first_vertices(&scene, shading_normals, InstructionSet::detect(), true);
    let (a, b) = (&lanes.vertices, &oracle.vertices);
    let met = if is_placed { &lanes.placed } else { &lanes.smooth };
    assert_eq!(met.base.len(), a.len);
    assert_eq!(oracle.smooth.base.len() + oracle.placed.base.len(), 0);
    assert_eq!(a.len, b.len);
    assert!(a.len > 500, "{}", a.len);
    let (mut folds, mut rises, mut others) = (0, 0, 0);
    for i in 0..a.len {
        assert_eq!(a.path[i], b.path[i]);
        assert!((a.point(i) - b.point(i)).length() < 1e-12);
        assert!((a.offset[i] / b.offset[i] - 1.0).abs() < 1e-5, "{} {}", a.offset[i], b.offset[i]);
        assert!((vector(&a.normal, i) - vector(&b.normal, i)).length() < 1e-6);
        let (n, other) = (vector(&a.frame_n, i), vector(&b.frame_n, i));
        assert!((n - other).length() < 1e-5, "{n} {other}");
        // The basis of a normal is discontinuous where its z is 0.
        if n.z.abs() > 1e-3 {
            assert!((vector(&a.frame_s, i) - vector(&b.frame_s, i)).length() < 1e-4);
        }
        folds += usize::from(a.flags[i] & (FOLDS | SIDED) != 0);
        rises += usize::from(a.flags[i] & HAS_TERMINATOR_OFFSET != 0);
        others += usize::from(a.flags[i] != b.flags[i]);
        if a.flags[i] & b.flags[i] & HAS_TERMINATOR_OFFSET != 0 {
            assert!((vector(&a.smooth_normal, i) - vector(&b.smooth_normal, i)).length() < 2e-6);
            let terminator_origin = |v: &crate::wave::vertices::Vertices<'_>| {
                DVec3::new(v.terminator_origin[0][i], v.terminator_origin[1][i], v.terminator_origin[2][i])
            };
            assert!(
                (terminator_origin(a) - terminator_origin(b)).length() < 2e-7,
                "{} {}",
                terminator_origin(a),
                terminator_origin(b)
            );
        }
        let kind = (0..a.queues.len()).find(|&kind| a.queues[kind].contains(&(i as u32)));
        assert_eq!(kind, (0..b.queues.len()).find(|&kind| b.queues[kind].contains(&(i as u32))));
        assert!(kind.is_some());
        let (row, other) = (a.bsdf[i] as usize, b.bsdf[i] as usize);
        for k in 0..12 {
            let (x, y) = (a.rows.numbers()[row + k], b.rows.numbers()[other + k]);
            assert!((x - y).abs() < 1e-4, "{k}: {x} {y}");
        }
    }
    // Rounding decides if a normal is almost the geometric one.
    assert!(others * 400 < a.len, "{others} of {}", a.len);
    [folds, rises, a.len]
}

#[test]
fn vertices_in_lanes_are_those_made_one_by_one() {
    for (reverse, instance) in [false, true].into_iter().flat_map(|r| [(r, None), (r, Some(sheared()))]) {
        for make in [uniform, textured, bumpy] {
            let [folds, rises, all] = compare(make(), reverse, instance, ShadingNormals::Lumbre);
            assert!(folds > all / 3 && rises > all / 8, "{folds} {rises} {all}");
            let [folds, rises, all] = compare(make(), reverse, instance, ShadingNormals::Pbrt);
            assert!(folds > all / 3 && rises == 0, "{folds} {rises} {all}");
        }
    }
}

#[test]
fn vertices_have_the_same_bits_at_every_instruction_set() {
    for instance in [None, Some(sheared())] {
        let scene = scene(bumpy(), false, instance);
        compare_instruction_sets(&scene);
    }
}

fn compare_instruction_sets(scene: &Scene) {
    let scalar = first_vertices(scene, ShadingNormals::Lumbre, InstructionSet::SCALAR, false);
    for set in InstructionSet::available() {
        let lanes = first_vertices(scene, ShadingNormals::Lumbre, set, false);
        let (a, b) = (&lanes.vertices, &scalar.vertices);
        assert_eq!(a.len, b.len);
        for i in 0..a.len {
            assert_eq!((a.point(i), a.offset[i], a.flags[i]), (b.point(i), b.offset[i], b.flags[i]));
            let vectors = [(&a.normal, &b.normal), (&a.frame_s, &b.frame_s), (&a.frame_n, &b.frame_n)];
            assert!(vectors.iter().all(|(a, b)| vector(a, i) == vector(b, i)));
            if a.flags[i] & HAS_TERMINATOR_OFFSET != 0 {
                assert!((0..3).all(|k| a.terminator_origin[k][i] == b.terminator_origin[k][i]
                    && a.smooth_normal[k][i] == b.smooth_normal[k][i]));
            }
        }
    }
}
