//! A picture is a function of the scene, the options and the seed.

#![allow(clippy::unwrap_used, reason = "tests may panic")]

use std::sync::Mutex;
use std::sync::atomic::{AtomicU32, Ordering};
use std::time::Duration;

use crate::common::*;
use lumbre_geometry::{Cuboid, Sphere, Torus};
use lumbre_image::{Image, Rgb};
use lumbre_math::{DVec3, Transform, Vec2, Vec3};
use lumbre_render::integrators::{Path, RayIntegrator};
use lumbre_render::transport::{PrimaryHit, SampleNumbers};
use lumbre_render::{
    CancelToken, Feature, NoProgress, PixelBounds, Progress, Record, RenderError, RenderOptions, Snapshot,
    State, denoise, render, render_with,
};
use lumbre_scene::{
    FilterDesc, GeometryDesc, InstanceDesc, LightDesc, ObjectDesc, ObjectId, SamplerKind, Scene, SceneDesc,
    ShapeDesc, View,
};
use lumbre_shading::{Material, MaterialKind, Roughness, Spectrum};

/// A bit of everything, `offset` away from where it usually is.
pub(crate) fn still_life(offset: DVec3) -> SceneDesc {
    let mut desc = empty();
    desc.filter = FilterDesc::Gaussian { radius: Vec2::splat(1.5), sigma: 0.5 };
    let grey = add_material(&mut desc, diffuse(0.6));
    let glass = add_material(
        &mut desc,
        Material::new(MaterialKind::Dielectric { eta: 1.5, roughness: Roughness::smooth() }),
    );
    let at = Transform::translate(offset);
    let ground = mesh(
        vec![
            Vec3::new(-4.0, -4.0, 0.0),
            Vec3::new(5.0, -4.0, 0.0),
            Vec3::new(5.0, 6.0, 0.0),
            Vec3::new(-4.0, 6.0, 0.0),
        ],
        vec![],
        vec![[0, 1, 2, 3]],
    );
    add(&mut desc, ground, grey).world_from_object = at;
    add(
        &mut desc,
        exact(Torus::new(DVec3::new(0.5, 0.25, 0.6), DVec3::new(0.1, 0.3, 1.0), 0.9, 0.35).unwrap()),
        grey,
    )
    .world_from_object = at;
    add(&mut desc, exact(Sphere::new(DVec3::new(-1.25, -0.75, 0.7), 0.7).unwrap()), glass)
        .world_from_object = at;
    let lamp = add(
        &mut desc,
        exact(Cuboid::new(DVec3::new(1.0, -2.0, 3.0), DVec3::new(2.5, -0.5, 3.25)).unwrap()),
        grey,
    );
    lamp.world_from_object = at;
    lamp.area_light = Some(glow(9.0));
    desc.lights.push(LightDesc::Infinite {
        world_from_light: Transform::IDENTITY,
        radiance: Rgb::splat(0.2),
        image: None,
    });
    desc.objects.push(ObjectDesc {
        name: "ball".into(),
        shapes: vec![ShapeDesc {
            geometry: exact(Sphere::new(DVec3::new(0.1, 0.0, 0.2), 0.3).unwrap()),
            world_from_object: Transform::IDENTITY,
            ..desc.shapes[1].clone()
        }],
        instances: vec![],
    });
    for x in [-1.5, 0.0, 1.75] {
        let place = at * Transform::translate(DVec3::new(x, 1.75, 0.3));
        desc.instances.push(InstanceDesc { object: ObjectId(0), world_from_object: place.into() });
    }
    desc.cameras = vec![look(offset + DVec3::new(-3.0, -5.0, 4.0), offset + DVec3::new(0.2, 0.3, 0.4), 42.0)];
    desc
}

fn bytes(image: &Image) -> Vec<u32> {
    image.pixels().iter().flat_map(|c| c.to_array().map(f32::to_bits)).collect()
}

#[test]
fn any_number_of_threads_gives_the_same_bytes() {
    let scene = Scene::build(still_life(DVec3::ZERO)).unwrap();
    let with = |threads, features| {
        picture(
            &scene,
            &changed(options(&scene, 75, 50, 7), |it| {
                it.threads = threads;
                it.features = features;
            }),
        )
    };
    let one = with(1, true);
    assert!(one.stats.rays.bounce > 10_000 && one.stats.rays.shadow > 5_000, "{:?}", one.stats.rays);
    assert!(one.image.pixels().iter().filter(|c| c.g > 0.05).count() > 3000);
    for threads in [2, 3, 16] {
        let many = with(threads, true);
        assert_eq!(many.stats.threads, threads);
        assert_eq!(bytes(&one.image), bytes(&many.image), "{threads} threads");
        assert_eq!(one.features, many.features, "{threads} threads");
        assert_eq!(one.stats.rays, many.stats.rays, "{threads} threads");
    }
    assert_eq!(bytes(&one.image), bytes(&with(2, false).image), "features change nothing");
    let guided = picture(&scene, &changed(options(&scene, 75, 50, 7), |it| it.guides = true));
    assert_eq!(bytes(&one.image), bytes(&guided.image), "guides change nothing");
    let denoised = [1, 4].map(|threads| bytes(&denoise(&guided, threads).unwrap().image));
    assert_eq!(denoised[0], denoised[1]);
}

#[test]
fn every_pixel_depends_on_its_own_samples_alone() {
    let scene = Scene::build(still_life(DVec3::ZERO)).unwrap();
    let whole = options(&scene, 61, 47, 5);
    let full = picture(&scene, &whole).image;
    let crop = PixelBounds { x0: 13, y0: 7, x1: 52, y1: 40 };
    let part = picture(&scene, &changed(whole, |it| it.crop = Some(crop)));
    assert_eq!(part.bounds, crop);
    for (x, y) in crop.pixels() {
        assert_eq!(part.image.pixel(x - crop.x0, y - crop.y0), full.pixel(x, y), "({x}, {y})");
    }
}

#[test]
fn seeds_and_samplers_change_the_noise_and_nothing_else() {
    let scene = Scene::build(still_life(DVec3::ZERO)).unwrap();
    let base = options(&scene, 40, 30, 64);
    let reference = picture(&scene, &base).image;
    for (kind, seed) in [(SamplerKind::Sobol, 5), (SamplerKind::Independent, 0)] {
        let mut other = base.clone();
        other.sampler.kind = kind;
        other.sampler.seed = seed;
        let image = picture(&scene, &other).image;
        assert_ne!(bytes(&image), bytes(&reference));
        assert_close(mean(&image)[1], mean(&reference)[1], 0.02, &format!("{kind:?} {seed}"));
    }
}

#[test]
fn a_scene_far_from_the_origin_looks_the_same() {
    let near = Scene::build(still_life(DVec3::ZERO)).unwrap();
    let reference = picture(&near, &options(&near, 60, 40, 16)).image;
    for distance in [1e5, 1e6] {
        let offset = distance * DVec3::new(1.0, -1.0, 0.75);
        let far = Scene::build(still_life(offset)).unwrap();
        let image = picture(&far, &options(&far, 60, 40, 16)).image;
        // What rounding of the input to 1e-10 may change is which side of an edge a sample falls on, and the last bit
        // of a direction in single precision, by which walks through coats and mixtures are keyed.
        let differs = |a: &Rgb, b: &Rgb| (a.g - b.g).abs() > 1e-3 * (a.g + b.g);
        let changed = reference.pixels().iter().zip(image.pixels()).filter(|(a, b)| differs(a, b)).count();
        assert!(changed <= 240, "{distance}: {changed} of 2400 pixels");
        assert_close(mean(&image)[1], mean(&reference)[1], 1e-3, "far away");
    }
}

/// Gives light that is no number to one sample in 97, by pixel.
#[derive(Debug)]
struct Broken(AtomicU32);

impl RayIntegrator for Broken {
    fn radiance(
        &self,
        _: &Scene,
        _: &View,
        _: PrimaryHit<'_>,
        numbers: &SampleNumbers,
        _: &mut Record,
    ) -> Spectrum {
        if numbers.lobe(7) < 1.0 / 97.0 {
            let count = self.0.fetch_add(1, Ordering::Relaxed);
            Spectrum::new(1.0, if count.is_multiple_of(2) { f32::NAN } else { f32::INFINITY }, 1.0)
        } else {
            Spectrum::splat(0.25)
        }
    }
}

#[test]
fn samples_that_are_no_numbers_are_dropped_counted_and_named() {
    let scene = Scene::build(still_life(DVec3::ZERO)).unwrap();
    let broken = Broken(AtomicU32::new(0));
    let options = options(&scene, 40, 30, 16);
    let rendered = render_with(&scene, &options, &broken, &NoProgress, &CancelToken::new()).unwrap();
    let given = u64::from(broken.0.load(Ordering::Relaxed));
    assert!(given > 50, "{given}");
    assert_eq!(rendered.stats.dropped, given);
    assert_eq!(rendered.stats.first_dropped.len(), 16);
    assert!(rendered.image.pixels().iter().all(|&c| c == Rgb::splat(0.25)));
    let first = rendered.stats.first_dropped[0];
    let sampler = lumbre_render::transport::Sampler::new(&options.sampler);
    assert!(sampler.numbers(first.x, first.y, first.sample).lobe(7) < 1.0 / 97.0);
}

/// Finite light that is brighter than a sum of samples holds.
#[derive(Debug)]
struct Blinding;

impl RayIntegrator for Blinding {
    fn radiance(
        &self,
        _: &Scene,
        _: &View,
        _: PrimaryHit<'_>,
        _: &SampleNumbers,
        _: &mut Record,
    ) -> Spectrum {
        Spectrum::splat(1e19)
    }
}

#[test]
fn too_bright_samples_are_clamped_and_counted() {
    let scene = Scene::build(still_life(DVec3::ZERO)).unwrap();
    let options = options(&scene, 40, 30, 4);
    let rendered = render_with(&scene, &options, &Blinding, &NoProgress, &CancelToken::new()).unwrap();
    assert_eq!((rendered.stats.dropped, rendered.stats.clamped), (0, 4 * 1200));
    let most = lumbre_render::Stats::MAX_SAMPLE as f32;
    assert!(rendered.image.pixels().iter().all(|&c| c == Rgb::splat(most)));
}

/// Cancels after a number of passes, and records its calls.
struct Impatient {
    cancel: CancelToken,
    after_spp: u32,
    told: Mutex<Vec<(u32, Option<f64>, f32)>>,
}

impl Progress for Impatient {
    fn pass(&self, snapshot: &Snapshot<'_>) {
        let green = mean(&snapshot.image())[1] as f32;
        self.told.lock().unwrap().push((snapshot.spp, snapshot.noise, green));
        if snapshot.spp >= self.after_spp {
            self.cancel.cancel();
        }
    }

    fn state(&self, state: &State) {
        assert!(state.total.is_some_and(|total| state.samples <= total) && state.share <= 1.0);
    }
}

#[test]
fn a_cancelled_render_returns_what_it_has() {
    let scene = Scene::build(still_life(DVec3::ZERO)).unwrap();
    let cancel = CancelToken::new();
    let impatient = Impatient { cancel: cancel.clone(), after_spp: 8, told: Mutex::default() };
    let partial = render(&scene, &options(&scene, 40, 30, 1 << 20), &impatient, &cancel).unwrap();
    assert!(partial.stats.cancelled);
    assert_eq!((partial.stats.spp, partial.stats.samples), (8, 8 * 1200));
    let told = impatient.told.into_inner().unwrap();
    assert_eq!(told.iter().map(|t| t.0).collect::<Vec<_>>(), [1, 2, 4, 8]);
    assert!(told[0].1.is_none() && told[3].1 < told[1].1 && told[3].1 > Some(0.0), "{told:?}");
    assert_eq!(told[3].2, mean(&partial.image)[1] as f32);
    // The same samples as a render that wanted no more.
    let whole = picture(&scene, &options(&scene, 40, 30, 8));
    assert_eq!(bytes(&partial.image), bytes(&whole.image));
    assert!(!whole.stats.cancelled);
}

#[test]
fn time_and_noise_end_a_render() {
    let scene = Scene::build(still_life(DVec3::ZERO)).unwrap();
    let mut timed = options(&scene, 40, 30, 1 << 20);
    timed.stop.time = Some(Duration::from_millis(300));
    let rendered = picture(&scene, &timed);
    assert!(rendered.stats.elapsed < Duration::from_secs(10), "{:?}", rendered.stats.elapsed);
    assert!(rendered.stats.samples > 0 && !rendered.stats.cancelled);
}

/// Lit from a side, with sky behind: some pixels are clean at once, others for long not.
fn uneven() -> Scene {
    Scene::build(still_life(DVec3::ZERO)).unwrap()
}

#[test]
fn noise_ends_the_sampling_of_each_pixel_by_its_own_samples() {
    let scene = uneven();
    let quiet = changed(options(&scene, 40, 30, 1 << 12), |it| it.stop.noise = Some(0.1));
    let whole = picture(&scene, &quiet);
    let stats = &whole.stats;
    assert!(stats.spp == 16 && stats.most_spp >= 64 && !stats.cancelled, "{stats:?}");
    assert!(stats.noise.unwrap() <= 0.1 && stats.samples < 1200 * 160, "{stats:?}");
    // Neither threads nor crops change a pixel.
    assert_eq!(
        bytes(&whole.image),
        bytes(&picture(&scene, &changed(quiet.clone(), |it| it.threads = 1)).image)
    );
    let crop = PixelBounds { x0: 9, y0: 12, x1: 33, y1: 29 };
    let part = picture(&scene, &changed(quiet, |it| it.crop = Some(crop)));
    for (x, y) in crop.pixels() {
        assert_eq!(part.image.pixel(x - crop.x0, y - crop.y0), whole.image.pixel(x, y), "({x}, {y})");
    }
}

#[test]
fn the_true_error_is_within_the_noise_that_was_asked_for() {
    let scene = uneven();
    let reference = picture(&scene, &changed(options(&scene, 24, 18, 4096), |it| it.sampler.seed = 77)).image;
    let mean_of = |image: &Image| {
        image.pixels().iter().map(|c| f64::from(c.luminance())).sum::<f64>() / image.pixels().len() as f64
    };
    let mean_reference = mean_of(&reference);
    for limit in [0.2, 0.05] {
        let quiet = changed(options(&scene, 24, 18, 1 << 12), |it| it.stop.noise = Some(limit));
        let image = picture(&scene, &quiet).image;
        let pairs = image.pixels().iter().zip(reference.pixels());
        let squares = pairs.map(|(a, b)| {
            let (a, b) = (f64::from(a.luminance()), f64::from(b.luminance()));
            ((a - b) / (b + 0.1 * mean_reference)).powi(2)
        });
        let error = (squares.sum::<f64>() / image.pixels().len() as f64).sqrt();
        let bias = mean_of(&image) / mean_reference - 1.0;
        println!("limit {limit}: true error {error:.4}, mean off by {bias:+.4}");
        assert!(error <= limit && bias.abs() < 0.1 * limit, "{limit}: {error} {bias}");
    }
}

#[test]
fn features_are_what_they_are_called() {
    let scene = Scene::build(still_life(DVec3::new(50.0, 20.0, -10.0))).unwrap();
    let rendered = picture(&scene, &changed(options(&scene, 90, 60, 4), |it| it.features = true));
    let get = |wanted| &rendered.features.iter().find(|(f, _)| *f == wanted).unwrap().1;
    // The middle of the picture is on the torus or the ground before it; the lower edge is ground.
    let (x, y) = (45, 58);
    let normal = get(Feature::Normal).pixel(x, y);
    assert!((normal.b - 1.0).abs() < 1e-5 && normal.r.abs() < 1e-5, "{normal:?}");
    assert!((get(Feature::Albedo).pixel(x, y).g - 0.6).abs() < 1e-6);
    let view = View::new(&scene.cameras()[0], 90, 60);
    let ray = view.ray(lumbre_math::DVec2::new(45.5, 58.5), lumbre_math::DVec2::splat(0.5), 0.0, 1.0).ray;
    let hit = scene.closest(&ray).unwrap();
    let depth = view.depth(ray.at(hit.root.t), 0.0);
    assert_close(get(Feature::Depth).pixel(x, y).g.into(), depth, 0.03, "depth");
    let uv = get(Feature::Uv).pixel(x, y);
    assert!(uv.r > 0.0 && uv.r < 1.0 && uv.g > 0.0 && uv.g < 1.0 && uv.b == 0.0, "{uv:?}");
}

#[test]
fn options_that_make_no_picture_are_refused() {
    let scene = Scene::build(still_life(DVec3::ZERO)).unwrap();
    let refused =
        |options: RenderOptions| render(&scene, &options, &NoProgress, &CancelToken::new()).unwrap_err();
    let base = options(&scene, 40, 30, 1);
    assert_eq!(refused(changed(base.clone(), |it| it.width = 0)), RenderError::Size { width: 0, height: 30 });
    let crop = PixelBounds { x0: 40, y0: 0, x1: 50, y1: 9 };
    let empty = refused(changed(base.clone(), |it| it.crop = Some(crop)));
    assert_eq!(empty, RenderError::EmptyCrop { crop, width: 40, height: 30 });
    assert_eq!(empty.to_string(), "the crop 40,0,50,9 is outside the picture (40x30)");
    assert_eq!(
        refused(changed(base.clone(), |it| it.camera = 3)),
        RenderError::NoSuchCamera { index: 3, count: 1 }
    );
    let filter = FilterDesc::Box { radius: Vec2::ZERO };
    assert_eq!(refused(changed(base, |it| it.filter = filter)), RenderError::Filter);
}

#[test]
fn instanced_lights_are_as_bright_as_plain_ones() {
    let lamp = || ShapeDesc {
        area_light: Some(glow(3.0)),
        ..{
            let mut desc = empty();
            let black = add_material(&mut desc, diffuse(0.0));
            add(&mut desc, exact(Sphere::new(DVec3::new(0.3, 0.2, 0.1), 1.5).unwrap()), black).clone()
        }
    };
    let place = Transform::translate(DVec3::new(0.0, 1.0, 3.0));
    let scene = |depth: u32| {
        let mut desc = empty();
        add_material(&mut desc, diffuse(0.0));
        let grey = add_material(&mut desc, diffuse(0.8));
        let ground: GeometryDesc =
            exact(Cuboid::new(DVec3::new(-9.0, -9.0, -1.0), DVec3::new(9.0, 9.0, 0.0)).unwrap());
        add(&mut desc, ground, grey);
        let instance = |object, place: Transform| InstanceDesc {
            object: ObjectId(object),
            world_from_object: place.into(),
        };
        if depth == 0 {
            desc.shapes.push(ShapeDesc { world_from_object: place, ..lamp() });
        } else {
            desc.objects.push(ObjectDesc { name: "lamp".into(), shapes: vec![lamp()], instances: vec![] });
            let instances = vec![instance(0, Transform::IDENTITY)];
            desc.objects.extend((depth == 2).then(|| ObjectDesc { instances, ..ObjectDesc::default() }));
            desc.instances.push(instance(depth - 1, place));
        }
        desc.cameras = vec![look(DVec3::new(-4.0, -6.0, 5.0), DVec3::ZERO, 50.0)];
        Scene::build(desc).unwrap()
    };
    let path = Path::new(2);
    let light = |scene: &Scene| {
        let options = options(scene, 32, 24, 128);
        let rendered = render_with(scene, &options, &path, &NoProgress, &CancelToken::new()).unwrap();
        mean(&rendered.image)[1]
    };
    let [plain, instanced, nested] = [0, 1, 2].map(scene);
    assert!(plain.warnings().is_empty() && instanced.warnings().is_empty());
    assert_eq!(nested.warnings().len(), 1);
    assert_close(light(&instanced), light(&plain), 0.005, "instanced");
    assert_close(light(&nested), light(&plain), 0.02, "nested");
}

/// White; cancels the render after this many samples.
#[derive(Debug)]
struct Interrupting {
    cancel: CancelToken,
    left: AtomicU32,
}

impl RayIntegrator for Interrupting {
    fn radiance(
        &self,
        _: &Scene,
        _: &View,
        _: PrimaryHit<'_>,
        _: &SampleNumbers,
        _: &mut Record,
    ) -> Spectrum {
        if self.left.fetch_sub(1, Ordering::Relaxed) == 1 {
            self.cancel.cancel();
        }
        Spectrum::splat(1.0)
    }
}

#[test]
fn a_render_stopped_in_its_first_pass_is_coarse_but_whole() {
    let scene = Scene::build(still_life(DVec3::ZERO)).unwrap();
    // Some tiles are narrower than others, and none begins at zero.
    let mut options = options(&scene, 700, 500, 4);
    options.crop = Some(PixelBounds { x0: 37, y0: 21, x1: 37 + 603, y1: 21 + 290 });
    options.threads = 1;
    let squares = |side: u32| 603_u32.div_ceil(side) * 290_u32.div_ceil(side);
    for (after, stride) in [
        (2, None),
        (squares(256), Some(256)),
        (squares(64) - 1, Some(256)),
        (squares(64) + 1, Some(64)),
        (squares(16), Some(16)),
        (squares(4) + 50, Some(4)),
        (squares(1) - 300, Some(2)),
        (squares(1), Some(1)),
    ] {
        let cancel = CancelToken::new();
        let interrupting = Interrupting { cancel: cancel.clone(), left: AtomicU32::new(after) };
        let part = render_with(&scene, &options, &interrupting, &NoProgress, &cancel).unwrap();
        assert_eq!((part.stats.stride, part.stats.spp), (stride, u32::from(stride == Some(1))), "{after}");
        // What was begun is finished: a sample of each new pixel of a tile at most.
        assert!((u64::from(after)..u64::from(after) + 256).contains(&part.stats.samples), "{after}");
        let dark = part.image.pixels().iter().filter(|pixel| pixel.g < 0.99).count();
        assert_eq!(dark == 0, stride.is_some(), "{after}: {dark} pixels are dark");
    }
}
