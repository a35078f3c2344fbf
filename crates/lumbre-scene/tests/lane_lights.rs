//! Lights over lanes: the same bits at every width, and the means and densities of scalar code.

#![allow(clippy::unwrap_used, reason = "tests may panic")]

mod lit;

use lit::{lights_of_all_kinds, sky_under};
use lumbre_geometry::Ray;
use lumbre_math::random::RandomStream;
use lumbre_math::{DVec2, DVec3, Transform, warp64};
use lumbre_scene::light::Sampling;
use lumbre_scene::light::lanes::Receiver;
use lumbre_scene::{EnvironmentMapping, Footprint, LightSample, Scene};
use lumbre_shading::Scatter;
use lumbre_simd::{Double, InstructionSet, Job, Mask, Real, UInt, V3};

/// Who is lit, and the random numbers.
#[derive(Clone, Copy)]
struct Question {
    from: DVec3,
    normal: DVec3,
    u: [f32; 4],
}

#[derive(Clone, Copy, Debug, PartialEq)]
struct Answer {
    towards: [f32; 3],
    point: [f64; 3],
    error: [f64; 3],
    normal: [f32; 3],
    radiance: [f32; 3],
    pdf: f32,
    is_infinite: bool,
    is_delta: bool,
}

impl Answer {
    fn flux(&self) -> f64 {
        let density = if self.is_delta { 1.0 } else { f64::from(self.pdf) };
        f64::from(self.radiance.iter().sum::<f32>()) / 3.0 / density
    }

    fn towards(&self) -> DVec3 {
        DVec3::from(self.towards.map(f64::from))
    }
}

/// A column of numbers, in pieces of one vector; the last piece is filled up with the last number.
fn padded<T: Copy>(numbers: impl Iterator<Item = T>) -> Vec<T> {
    let mut numbers: Vec<T> = numbers.collect();
    let last = *numbers.last().unwrap();
    numbers.resize(numbers.len().next_multiple_of(16), last);
    numbers
}

fn vectors<R: Real>(columns: &[Vec<f32>; 3], at: usize) -> V3<R> {
    V3::new(
        R::from_slice(&columns[0][at..]),
        R::from_slice(&columns[1][at..]),
        R::from_slice(&columns[2][at..]),
    )
}

fn points<R: Real>(columns: &[Vec<f64>; 3], at: usize) -> V3<R::Double> {
    V3::new(
        R::Double::from_slice(&columns[0][at..]),
        R::Double::from_slice(&columns[1][at..]),
        R::Double::from_slice(&columns[2][at..]),
    )
}

fn columns(of: impl Iterator<Item = DVec3> + Clone) -> [Vec<f64>; 3] {
    [0, 1, 2].map(|k| padded(of.clone().map(|v| v[k])))
}

fn singles(of: impl Iterator<Item = DVec3> + Clone) -> [Vec<f32>; 3] {
    [0, 1, 2].map(|k| padded(of.clone().map(|v| v[k] as f32)))
}

struct Samples<'a> {
    scene: &'a Scene,
    questions: &'a [Question],
    sampling: Sampling,
}

impl Job for Samples<'_> {
    type Output = Vec<Option<Answer>>;

    #[inline(always)]
    fn run<R: Real>(self) -> Self::Output {
        let questions = self.questions;
        let from = columns(questions.iter().map(|q| q.from));
        let normal = singles(questions.iter().map(|q| q.normal));
        let u = [0, 1, 2, 3].map(|k| padded(questions.iter().map(|q| q.u[k])));
        let mut answers = Vec::new();
        let mut at = 0;
        while at < questions.len() {
            let receiver =
                Receiver::<R> { from: points::<R>(&from, at), normal: vectors(&normal, at), time: None };
            let u = [
                R::from_slice(&u[0][at..]),
                R::from_slice(&u[1][at..]),
                R::from_slice(&u[2][at..]),
                R::from_slice(&u[3][at..]),
            ];
            let active = R::Mask::first(questions.len() - at);
            let lights = self.scene.lane_lights();
            let sample = lights.sample(active, &receiver, u, self.sampling);
            let bits = [sample.infinite, sample.delta, sample.valid].map(Mask::to_bitmask);
            for lane in 0..R::LANES.min(questions.len() - at) {
                let single = |v: V3<R>| [v.x, v.y, v.z].map(|x| x.to_lanes()[lane]);
                let double = |v: V3<R::Double>| [v.x, v.y, v.z].map(|x| x.to_lanes()[lane]);
                let is = |bits: u32| bits >> lane & 1 == 1;
                answers.push(is(bits[2]).then(|| Answer {
                    towards: single(sample.towards),
                    point: double(sample.point),
                    error: double(sample.error),
                    normal: single(sample.normal),
                    radiance: single(sample.radiance),
                    pdf: sample.pdf.to_lanes()[lane],
                    is_infinite: is(bits[0]),
                    is_delta: is(bits[1]),
                }));
            }
            at += R::LANES;
        }
        answers
    }
}

/// What a ray from a place met.
#[derive(Clone, Copy)]
struct Found {
    from: DVec3,
    normal: DVec3,
    entry: u32,
    primitive: u32,
    point: DVec3,
}

struct Densities<'a>(&'a Scene, &'a [Found]);

impl Job for Densities<'_> {
    type Output = Vec<f32>;

    #[inline(always)]
    fn run<R: Real>(self) -> Vec<f32> {
        let Self(scene, found) = self;
        let from = columns(found.iter().map(|f| f.from));
        let normal = singles(found.iter().map(|f| f.normal));
        let point = columns(found.iter().map(|f| f.point));
        let entry = padded(found.iter().map(|f| f.entry));
        let primitive = padded(found.iter().map(|f| f.primitive));
        let mut pdf = vec![0.0; entry.len()];
        let mut at = 0;
        while at < found.len() {
            let receiver =
                Receiver::<R> { from: points::<R>(&from, at), normal: vectors(&normal, at), time: None };
            let density = scene.lane_lights().pdf(
                R::Mask::first(found.len() - at),
                &receiver,
                R::UInt::from_slice(&entry[at..]),
                R::UInt::from_slice(&primitive[at..]),
                points::<R>(&point, at),
            );
            density.copy_to_slice(&mut pdf[at..]);
            at += R::LANES;
        }
        pdf.truncate(found.len());
        pdf
    }
}

/// Radiance and density of the first infinite light, for places, normals and directions.
struct Escapes<'a>(&'a Scene, &'a [(DVec3, DVec3, DVec3)]);

impl Job for Escapes<'_> {
    type Output = Vec<([f32; 3], f32)>;

    #[inline(always)]
    fn run<R: Real>(self) -> Self::Output {
        let Self(scene, rays) = self;
        let from = columns(rays.iter().map(|ray| ray.0));
        let normal = singles(rays.iter().map(|ray| ray.1));
        let direction = singles(rays.iter().map(|ray| ray.2));
        let mut answers = Vec::new();
        let mut at = 0;
        while at < rays.len() {
            let receiver =
                Receiver::<R> { from: points::<R>(&from, at), normal: vectors(&normal, at), time: None };
            let active = R::Mask::first(rays.len() - at);
            let (radiance, pdf) = scene.lane_lights().escaped(0, active, &receiver, vectors(&direction, at));
            for lane in 0..R::LANES.min(rays.len() - at) {
                let radiance = [radiance.x, radiance.y, radiance.z].map(|c| c.to_lanes()[lane]);
                answers.push((radiance, pdf.to_lanes()[lane]));
            }
            at += R::LANES;
        }
        answers
    }
}

fn number(random: &mut RandomStream) -> f32 {
    (random.next_u64() >> 40) as f32 / 16_777_216.0
}

fn direction(random: &mut RandomStream) -> DVec3 {
    warp64::square_to_sphere(DVec2::new(random.next_f64(), random.next_f64()))
}

fn questions(random: &mut RandomStream, count: usize) -> Vec<Question> {
    let question = |i: usize| {
        let mut x = || random.next_f64() - 0.5;
        let from = 8.0 * DVec3::new(x(), x(), x());
        let normal = if i.is_multiple_of(3) { DVec3::ZERO } else { direction(random) };
        let u = [number(random), number(random), number(random), number(random)];
        Question { from, normal, u }
    };
    (0..count).map(question).collect()
}

fn sample(scene: &Scene, questions: &[Question], sampling: Sampling) -> Vec<Option<Answer>> {
    InstructionSet::detect().run(Samples { scene, questions, sampling })
}

#[test]
fn every_instruction_set_gives_the_same_bits() {
    let mut random = RandomStream::new(31);
    for scene in [
        lights_of_all_kinds(None),
        lights_of_all_kinds(Some(EnvironmentMapping::EqualArea)),
        lights_of_all_kinds(Some(EnvironmentMapping::LatitudeLongitude)),
    ] {
        let questions = questions(&mut random, 3001);
        for sampling in [Sampling::Mis, Sampling::LightsOnly] {
            let expected =
                InstructionSet::SCALAR.run(Samples { scene: &scene, questions: &questions, sampling });
            assert!(expected.iter().flatten().count() > 2000);
            for set in InstructionSet::available() {
                assert_eq!(set.run(Samples { scene: &scene, questions: &questions, sampling }), expected);
            }
        }
        let rays: Vec<_> = questions.iter().map(|q| (q.from, q.normal, direction(&mut random))).collect();
        let expected = InstructionSet::SCALAR.run(Escapes(&scene, &rays));
        for set in InstructionSet::available() {
            assert_eq!(set.run(Escapes(&scene, &rays)), expected);
        }
        let found = found(&scene, &questions, &sample(&scene, &questions, Sampling::Mis));
        let found: Vec<Found> = found.into_iter().map(|(found, _)| found).collect();
        let expected = InstructionSet::SCALAR.run(Densities(&scene, &found));
        assert!(expected.iter().filter(|&&pdf| pdf > 0.0).count() > 300);
        for set in InstructionSet::available() {
            assert_eq!(set.run(Densities(&scene, &found)), expected);
        }
    }
}

/// Where samples are what a ray along them meets, and their densities.
fn found(scene: &Scene, questions: &[Question], answers: &[Option<Answer>]) -> Vec<(Found, f32)> {
    let mut found = Vec::new();
    for (question, answer) in questions.iter().zip(answers) {
        let Some(answer) = answer.filter(|answer| !answer.is_delta && !answer.is_infinite) else { continue };
        let (from, point) = (question.from, DVec3::from(answer.point));
        let ray = Ray::new(from, (point - from).normalize());
        let Some(hit) = scene.closest(&ray) else { continue };
        let met = scene.interaction(&ray, &hit, &Footprint::Point);
        // Another light may stand before it, or another triangle of the same one.
        if (met.surface.point - point).length() > 2e-6 * (point - from).length() {
            continue;
        }
        let (entry, primitive, normal) = (hit.id, met.primitive, question.normal);
        found.push((Found { from, normal, entry, primitive, point: met.surface.point }, answer.pdf));
    }
    found
}

#[test]
fn the_density_of_what_a_ray_finds_is_that_of_the_sample() {
    let mut random = RandomStream::new(32);
    let scene = lights_of_all_kinds(None);
    let questions = questions(&mut random, 8000);
    let found = found(&scene, &questions, &sample(&scene, &questions, Sampling::Mis));
    let rays: Vec<Found> = found.iter().map(|(found, _)| *found).collect();
    let densities = InstructionSet::detect().run(Densities(&scene, &rays));
    let (mut count, mut near, mut alike) = (0, 0, 0);
    for ((found, expected), density) in found.iter().zip(&densities) {
        // On an edge between triangles a ray may meet the other one.
        near += usize::from((density / expected - 1.0).abs() < 1e-3);
        // And that of scalar code, which samples smaller ones by solid angle.
        let ray = Ray::new(found.from, (found.point - found.from).normalize());
        let hit = scene.closest(&ray).unwrap();
        let met = scene.interaction(&ray, &hit, &Footprint::Point);
        let scalar = scene.light_pdf(found.from, found.normal, &met);
        alike += usize::from((scalar / expected - 1.0).abs() < 2e-3);
        count += 1;
    }
    assert!(near > count - count / 500, "{near} of {count}");
    assert!(count > 1000 && alike > count - count / 50, "{alike} of {count}");
}

fn flux(sample: Option<LightSample>) -> f64 {
    sample.map_or(0.0, |sample| {
        let density = if let Scatter::Density(pdf) = sample.scatter { pdf } else { 1.0 };
        f64::from(sample.radiance.average() / density)
    })
}

#[test]
fn the_light_of_samples_is_in_the_mean_that_of_scalar_code() {
    const COUNT: usize = 60_000;
    let mut random = RandomStream::new(33);
    for sky in [None, Some(EnvironmentMapping::EqualArea)] {
        let scene = lights_of_all_kinds(sky);
        let places = [
            (DVec3::ZERO, DVec3::ZERO),
            (DVec3::new(2.0, -1.0, 0.5), DVec3::new(0.6, 0.0, -0.8)),
            (DVec3::new(-30.0, 20.0, 10.0), DVec3::new(0.0, -1.0, 0.0)),
        ];
        for (from, normal) in places {
            let question = |_| Question { from, normal, u: [0; 4].map(|_| number(&mut random)) };
            let questions: Vec<Question> = (0..COUNT).map(question).collect();
            // As it is on a surface that faces the normal.
            let cosine =
                |towards: DVec3| if normal == DVec3::ZERO { 1.0 } else { towards.dot(normal).max(0.0) };
            for sampling in [Sampling::LightsOnly, Sampling::Mis] {
                // What is dim of a sky is left to other rays.
                if sky.is_some() && sampling == Sampling::Mis {
                    continue;
                }
                let answers = sample(&scene, &questions, sampling);
                let lanes: f64 =
                    answers.iter().flatten().map(|answer| answer.flux() * cosine(answer.towards())).sum();
                let mut scalar = 0.0;
                for _ in 0..COUNT {
                    let u = DVec2::new(random.next_f64(), random.next_f64());
                    let sample = scene.sample_light_alone(from, normal, 0.0, random.next_f64(), u);
                    scalar += flux(sample) * sample.map_or(0.0, |sample| cosine(sample.towards));
                }
                assert!((lanes / scalar - 1.0).abs() < 0.03, "{from} {sampling:?}: {lanes} {scalar}");
            }
        }
    }
}

#[test]
fn escaping_rays_find_the_sky_of_scalar_code() {
    let mut random = RandomStream::new(34);
    let turned = Transform::rotate(DVec3::new(1.0, 2.0, 0.5), 40.0).unwrap();
    let stretched = turned * Transform::scale(DVec3::new(1e-3, -3e-3, 2e-3)).unwrap();
    for mapping in [EnvironmentMapping::EqualArea, EnvironmentMapping::LatitudeLongitude] {
        for map in [turned, stretched] {
            let scene = sky_under(mapping, map);
            let rays: Vec<_> = (0..4000)
                .map(|_| (DVec3::ONE, DVec3::ZERO, direction(&mut random).as_vec3().as_dvec3()))
                .collect();
            let mut near = 0;
            for (ray, (radiance, pdf)) in
                rays.iter().zip(InstructionSet::detect().run(Escapes(&scene, &rays)))
            {
                let ray = Ray::new(ray.0, ray.2.normalize());
                let (expected, density) = scene.escaped(&ray, DVec3::ZERO).next().unwrap();
                for (ours, theirs) in radiance.into_iter().zip(expected.to_array()) {
                    assert!((ours - theirs).abs() < 1e-3 * (1.0 + theirs), "{ours} {theirs}");
                }
                // A direction may round to the other side of a border between pixels.
                near += u32::from((pdf / density - 1.0).abs() < 1e-4);
            }
            assert!(near > 3980, "{mapping:?}: {near}");
            // Samples have the density and the radiance of what escapes, and all densities together are 1.
            let question = |i: u32| {
                let (x, y) = ((i % 200) as f32, (i / 200) as f32);
                let jitter = [number(&mut random), number(&mut random)];
                let u = [0.5, (x + jitter[0]) / 200.0, (y + jitter[1]) / 200.0, number(&mut random)];
                Question { from: DVec3::ONE, normal: DVec3::ZERO, u }
            };
            let questions: Vec<Question> = (0..40_000).map(question).collect();
            let answers = sample(&scene, &questions, Sampling::Mis);
            let rays: Vec<_> =
                answers.iter().flatten().map(|a| (DVec3::ONE, DVec3::ZERO, a.towards())).collect();
            let escapes = InstructionSet::detect().run(Escapes(&scene, &rays));
            let (mut near, mut count, mut sphere) = (0, 0, 0.0);
            for (answer, (radiance, pdf)) in answers.iter().flatten().zip(escapes) {
                assert!(answer.is_infinite && (answer.towards().length() - 1.0).abs() < 1e-6);
                let is_near = (pdf / answer.pdf - 1.0).abs() < 1e-3
                    && (0..3).all(|k| (radiance[k] - answer.radiance[k]).abs() < 2e-3 * (1.0 + radiance[k]));
                near += u32::from(is_near);
                count += 1;
                sphere += 1.0 / f64::from(answer.pdf);
            }
            assert!(count > 38_000 && near > count - count / 100, "{mapping:?}: {near} of {count}");
            // All of the sphere but for what is black.
            let part = sphere / f64::from(questions.len() as u32) / (4.0 * std::f64::consts::PI);
            assert!((0.85..1.02).contains(&part), "{mapping:?}: {part}");
        }
    }
}
