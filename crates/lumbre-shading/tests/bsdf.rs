//! What every BSDF promises: it samples what its density says, its weights are values over densities, it is reciprocal
//! (radiance in a denser medium counted by η²), it makes no energy, and it never answers NaN.
//!
//! Teeth: with the density of rough metal or glass multiplied by 1.005 the test of densities fails; with the Jacobian
//! of refraction taken the wrong way round those of densities, weights and reciprocity do; with η² left out of the
//! values of a transmission those of weights and reciprocity.

use std::f64::consts::{PI, TAU};
use std::marker::PhantomData;
use std::sync::Arc;
use std::thread;

use lumbre_math::random::RandomStream;
use lumbre_math::{Vec2, Vec3};
use lumbre_shading::coated::{Coat, CoatedConductor, CoatedDiffuse};
use lumbre_shading::conductor::Conductor;
use lumbre_shading::dielectric::{Dielectric, ThinDielectric};
use lumbre_shading::diffuse::{Diffuse, DiffuseTransmission};
use lumbre_shading::hair::Hair;
use lumbre_shading::lanes::{self, BsdfKind, LaneBsdf, Rows};
use lumbre_shading::measured::{Measured, MeasuredParts, MeasuredTables};
use lumbre_shading::microfacet::Microfacets;
use lumbre_shading::principled::{Body, Clearcoat, Principled};
use lumbre_shading::sheen::Sheen;
use lumbre_shading::subsurface::Subsurface;
use lumbre_shading::thin_film::ThinFilm;
use lumbre_shading::uber::Uber;
use lumbre_shading::{Bsdf, LocalDir, Scatter, ShadingFrame, Spectrum, fresnel};
use lumbre_simd::{InstructionSet, Job, Mask, Real, UInt, V3};

const GLASS: f32 = 1.5;

fn local(v: Vec3) -> LocalDir {
    ShadingFrame { s: Vec3::X, t: Vec3::Y, n: Vec3::Z }.to_local(v.normalize())
}

/// Every third of the views, another third for each of a list; all of them by `cargo xtask test --all`.
fn some_views(number: usize) -> impl Iterator<Item = (usize, LocalDir)> {
    let step = if is_long() { 1 } else { 3 };
    views().into_iter().enumerate().skip(number % step).step_by(step)
}

fn is_long() -> bool {
    std::env::var_os("LUMBRE_LONG_TESTS").is_some()
}

/// Head on, at moderate and at grazing angles, from both sides.
fn views() -> Vec<LocalDir> {
    [
        Vec3::new(0.0, 0.0, 1.0),
        Vec3::new(0.5, 0.3, 0.7),
        Vec3::new(-0.8, 0.5, 0.25),
        Vec3::new(0.3, -0.95, 0.06),
        Vec3::new(0.0, 0.0, -1.0),
        Vec3::new(0.35, 0.2, -0.8),
        Vec3::new(-0.7, -0.6, -0.3),
    ]
    .map(local)
    .to_vec()
}

fn gold(alpha: (f32, f32)) -> Bsdf {
    Bsdf::Conductor(Conductor {
        eta: Spectrum::new(0.16, 0.42, 1.45),
        k: Spectrum::new(3.5, 2.5, 1.9),
        facets: Microfacets::new(alpha.0, alpha.1),
    })
}

fn glass(eta: f32, alpha: (f32, f32)) -> Bsdf {
    Bsdf::Dielectric(Dielectric { eta, facets: Microfacets::new(alpha.0, alpha.1) })
}

fn coat(alpha: (f32, f32), albedo: f32, samples: u32) -> Coat {
    Coat {
        face: Dielectric { eta: GLASS, facets: Microfacets::new(alpha.0, alpha.1) },
        thickness: 0.3,
        g: 0.4,
        albedo: Spectrum::splat(albedo),
        max_depth: 10,
        samples,
    }
}

fn coated(alpha: (f32, f32), albedo: f32, samples: u32) -> CoatedDiffuse {
    let base = Diffuse { reflectance: Spectrum::new(0.8, 0.5, 0.1) };
    CoatedDiffuse { base, coat: coat(alpha, albedo, samples) }
}

fn coated_metal(alpha: (f32, f32), metal: (f32, f32), albedo: f32) -> CoatedConductor {
    let Bsdf::Conductor(base) = gold(metal) else { unreachable!() };
    CoatedConductor { base, coat: coat(alpha, albedo, 1) }
}

/// Surfaces that show every parameter of the principled material, alone and together.
fn principled() -> Vec<(&'static str, Principled)> {
    let rough = |x, y| Microfacets::new(x, y);
    let plastic =
        Principled { base: Spectrum::new(0.8, 0.5, 0.1), facets: rough(0.2, 0.2), ..Principled::DEFAULT };
    let metal = Principled { metallic: 1.0, base: Spectrum::new(1.0, 0.7, 0.3), ..plastic };
    let pane = Principled { transmission: 1.0, transmission_color: Spectrum::new(1.0, 0.9, 0.8), ..plastic };
    let solid = Principled { body: Body::Solid { spread: 0.0 }, ..pane };
    let film = ThinFilm { weight: 0.8, eta: 1.4, thickness: 380.0, ..ThinFilm::NONE };
    let sheen = Sheen::new(Spectrum::new(0.9, 0.3, 0.6), 0.4);
    let coat = Clearcoat { weight: 0.7, alpha: 0.15, ..Clearcoat::NONE };
    let amber = Clearcoat { eta: 1.8, color: Spectrum::new(1.0, 0.6, 0.1), darkening: 0.8, ..coat };
    let leaf = Principled {
        diffuse_transmission: 0.6,
        diffuse_transmission_color: Spectrum::new(0.4, 1.0, 0.2),
        ..plastic
    };
    let everything = Principled {
        metallic: 0.3,
        transmission: 0.5,
        facets: rough(0.4, 0.2),
        tangent: Vec2::new(0.6, 0.8),
        f0: Spectrum::new(0.03, 0.02, 0.04),
        f90: 0.9,
        film: ThinFilm { weight: 0.5, ..film },
        sheen,
        coat,
        ..leaf
    };
    vec![
        ("plastic", plastic),
        ("polished plastic", Principled { facets: Microfacets::SMOOTH, ..plastic }),
        (
            "chalk",
            Principled { facets: Microfacets::ROUGH, eta: 1.8, f0: Spectrum::splat(0.0816), ..plastic },
        ),
        ("half a reflection", Principled { f0: Spectrum::new(0.01, 0.02, 0.0), f90: 0.5, ..plastic }),
        ("specular colour", Principled { f0: Spectrum::new(0.9, 0.1, 0.2), ..plastic }),
        ("metal", metal),
        ("brushed metal", Principled { facets: rough(0.6, 0.1), tangent: Vec2::new(0.8, -0.6), ..metal }),
        ("rough metal", Principled { facets: Microfacets::ROUGH, ..metal }),
        ("mirror", Principled { facets: Microfacets::SMOOTH, ..metal }),
        ("half metal", Principled { metallic: 0.5, ..metal }),
        ("pane", pane),
        ("clear pane", Principled { facets: Microfacets::SMOOTH, ..pane }),
        ("solid", solid),
        ("rough solid", Principled { facets: Microfacets::ROUGH, ..solid }),
        ("light solid", Principled { eta: 0.8, f0: Spectrum::splat(0.012_345_68), ..solid }),
        ("clear solid", Principled { facets: Microfacets::SMOOTH, ..solid }),
        ("prism", Principled { body: Body::Solid { spread: 0.05 }, ..solid }),
        (
            "clear prism",
            Principled { body: Body::Solid { spread: 0.05 }, facets: Microfacets::SMOOTH, ..solid },
        ),
        ("air", Principled { eta: 1.0, f0: Spectrum::BLACK, ..solid }),
        ("half glass", Principled { transmission: 0.5, ..solid }),
        ("leaf", leaf),
        ("thick leaf", Principled { transmission: 0.5, body: Body::Solid { spread: 0.0 }, ..leaf }),
        ("soap film", Principled { film, ..pane }),
        ("filmed solid", Principled { film, ..solid }),
        ("filmed plastic", Principled { film, ..plastic }),
        ("filmed metal", Principled { film, ..metal }),
        ("cloth", Principled { sheen, facets: Microfacets::ROUGH, ..plastic }),
        ("satin", Principled { sheen: Sheen::new(Spectrum::WHITE, 0.1), ..plastic }),
        ("coated plastic", Principled { coat, ..plastic }),
        ("polished coat", Principled { coat: Clearcoat { alpha: 0.0, ..coat }, ..metal }),
        ("coated solid", Principled { coat, ..solid }),
        ("amber coat", Principled { coat: amber, ..plastic }),
        ("amber solid", Principled { coat: amber, ..solid }),
        ("polished amber", Principled { coat: Clearcoat { alpha: 0.0, ..amber }, ..metal }),
        ("everything", everything),
        ("everything solid", Principled { body: Body::Solid { spread: 0.03 }, ..everything }),
    ]
}

/// Fibres at different places, smooth and rough, clear and dark.
fn hair() -> Vec<(&'static str, Hair)> {
    let brown = Spectrum::new(0.3, 0.8, 1.6);
    vec![
        ("brown", Hair::new(brown, 0.4, 1.55, 0.3, 0.3, 2.0)),
        ("rough", Hair::new(brown, -0.8, 1.55, 0.9, 0.7, 5.0)),
        ("clear", Hair::new(Spectrum::BLACK, 0.1, 1.33, 0.5, 0.4, 0.0)),
        ("edge", Hair::new(brown, 1.0, 1.55, 0.4, 0.9, -3.0)),
    ]
}

/// Half of the difference of η between blue and red.
fn spread(bsdf: &Principled) -> f32 {
    match bsdf.body {
        Body::Solid { spread } => spread,
        Body::Thin => 0.0,
    }
}

/// The tables of facets of GGX of this roughness along both axes, with colours that are brighter along the square.
fn measured(alpha: (f64, f64)) -> Measured {
    let (angles, width, height, side) = (9, 32, 20, 6);
    let azimuths = if alpha.0 == alpha.1 { 1 } else { 9 };
    let ramp = |n: usize| (0..n).map(move |i| i as f64 / (n - 1) as f64);
    let theta = |u: f64| u * u * 0.5 * PI;
    let phi = |v: f64| (2.0 * v - 1.0) * PI;
    let normal = |u: f64, v: f64| {
        let ((sin, cos), (y, x)) = (theta(u).sin_cos(), phi(v).sin_cos());
        [sin * x, sin * y, cos]
    };
    let density = |[x, y, z]: [f64; 3]| {
        let length = (x / alpha.0).powi(2) + (y / alpha.1).powi(2) + z * z;
        1.0 / (PI * alpha.0 * alpha.1 * length * length)
    };
    let area =
        |[x, y, z]: [f64; 3]| 0.5 * (z + ((alpha.0 * x).powi(2) + (alpha.1 * y).powi(2) + z * z).sqrt());
    let square = |f: &dyn Fn([f64; 3]) -> f64| -> Vec<f32> {
        ramp(height)
            .flat_map(|v| ramp(width).map(move |u| f(normal(u, v)) as f32).collect::<Vec<_>>())
            .collect()
    };
    let theta_i: Vec<f64> = ramp(angles).map(|t| 1.5 * t).collect();
    let phi_i: Vec<f64> = ramp(azimuths.max(2)).take(azimuths).map(|t| (2.0 * t - 1.0) * PI).collect();
    let (mut vndf, mut luminance, mut colours) = (vec![], vec![], [const { Vec::new() }; 3]);
    for &phi_o in &phi_i {
        // Azimuths of facets are relative to the viewer's where it has but one.
        let phi_o = if azimuths == 1 { 0.0 } else { phi_o };
        for &theta_o in &theta_i {
            let ((sin, cos), (y, x)) = (theta_o.sin_cos(), phi_o.sin_cos());
            let o = [sin * x, sin * y, cos];
            for v in ramp(height) {
                for u in ramp(width) {
                    let m = normal(u, v);
                    let seen: f64 = (0..3).map(|k| o[k] * m[k]).sum();
                    vndf.push((density(m) * seen.max(0.0) * u * theta(u).sin() + 1e-6) as f32);
                }
            }
            for y in ramp(side) {
                for x in ramp(side) {
                    let bright = 0.3 + 0.4 * x + 0.2 * y;
                    luminance.push(bright as f32);
                    let shares = [1.0, 0.6, 0.2];
                    colours.iter_mut().zip(shares).for_each(|(c, share)| c.push((bright * share) as f32));
                }
            }
        }
    }
    let single = |angles: Vec<f64>| angles.into_iter().map(|v| v as f32).collect();
    let of_facets = [height, width];
    Measured::new(Arc::new(
        MeasuredTables::new(MeasuredParts {
            theta_i: single(theta_i),
            phi_i: single(phi_i),
            size: [of_facets, of_facets, of_facets, [side, side]],
            ndf: square(&density),
            sigma: square(&area),
            vndf,
            luminance,
            colours,
        })
        .expect("the tables fit"),
    ))
}

fn boundary(alpha: f32) -> Bsdf {
    Bsdf::Subsurface(Subsurface::new(Dielectric { eta: 1.33, facets: Microfacets::new(alpha, alpha) }))
}

/// A coat that leans.
fn leaning() -> Principled {
    let normal = Vec3::new(0.3, -0.2, 0.9).normalize();
    let coat = Clearcoat { weight: 0.7, alpha: 0.15, normal, ..Clearcoat::NONE };
    Principled { coat, facets: Microfacets::new(0.3, 0.3), ..Principled::DEFAULT }
}

/// A BSDF under its name.
fn all() -> Vec<(String, Bsdf)> {
    let mut list = vec![
        ("diffuse".into(), Bsdf::Diffuse(Diffuse { reflectance: Spectrum::new(1.0, 0.4, 0.0) })),
        (
            "diffusetransmission".into(),
            Bsdf::DiffuseTransmission(DiffuseTransmission {
                reflectance: Spectrum::new(0.3, 0.2, 0.1),
                transmittance: Spectrum::new(0.1, 0.7, 0.2),
            }),
        ),
        ("thindielectric".into(), Bsdf::ThinDielectric(ThinDielectric { eta: GLASS })),
        ("smooth conductor".into(), gold((0.0, 0.0))),
        ("no border".into(), glass(1.0, (0.3, 0.3))),
    ];
    for alpha in [(0.05, 0.05), (0.3, 0.3), (0.1, 0.6), (0.9, 0.4)] {
        list.push((format!("conductor {alpha:?}"), gold(alpha)));
    }
    for eta in [GLASS, 1.0 / GLASS, 2.4] {
        for alpha in [(0.0, 0.0), (0.1, 0.1), (0.4, 0.2), (1.0, 1.0)] {
            list.push((format!("dielectric {eta} {alpha:?}"), glass(eta, alpha)));
        }
    }
    for alpha in [(0.0, 0.0), (0.1, 0.3), (0.6, 0.6)] {
        for albedo in [0.0, 0.7] {
            let bsdf = Bsdf::CoatedDiffuse(coated(alpha, albedo, 1));
            list.push((format!("coateddiffuse {alpha:?} {albedo}"), bsdf));
        }
    }
    for alpha in [(0.0, 0.0), (0.1, 0.2)] {
        for metal in [(0.0, 0.0), (0.05, 0.3), (0.4, 0.4)] {
            for albedo in [0.0, 0.6] {
                let bsdf = Bsdf::CoatedConductor(coated_metal(alpha, metal, albedo));
                list.push((format!("coatedconductor {alpha:?} {metal:?} {albedo}"), bsdf));
            }
        }
    }
    for (alpha, eta) in [((0.2, 0.2), GLASS), ((0.6, 0.1), 1.0 / GLASS)] {
        let uber = Uber {
            diffuse: Spectrum::new(0.4, 0.2, 0.1),
            glossy: Spectrum::new(0.2, 0.3, 0.25),
            mirror: Spectrum::BLACK,
            refracted: Spectrum::BLACK,
            passed: Spectrum::BLACK,
            eta,
            facets: Microfacets::new(alpha.0, alpha.1),
        };
        let clear = Uber {
            mirror: Spectrum::splat(0.2),
            refracted: Spectrum::new(0.1, 0.15, 0.05),
            passed: Spectrum::new(0.1, 0.05, 0.15),
            ..uber
        };
        let glossy = Uber { diffuse: Spectrum::BLACK, glossy: Spectrum::WHITE, eta: 2.4, ..uber };
        for (name, bsdf) in [("plastic", uber), ("clear", clear), ("glossy", glossy)] {
            list.push((format!("uber {name} {eta}"), Bsdf::Uber(bsdf)));
        }
    }
    for (name, bsdf) in hair() {
        list.push((format!("hair {name}"), Bsdf::Hair(bsdf)));
    }
    for alpha in [(0.4, 0.4), (0.5, 0.25)] {
        list.push((format!("measured {alpha:?}"), Bsdf::Measured(measured(alpha))));
    }
    for alpha in [0.0, 0.3] {
        list.push((format!("subsurface {alpha}"), boundary(alpha)));
    }
    for (name, bsdf) in principled().into_iter().chain([("leaning coat", leaning())]) {
        list.push((format!("principled {name}"), Bsdf::Principled(Box::new(bsdf))));
    }
    list
}

/// The same with this many walks an evaluation; `None` for a BSDF without walks.
fn with_walks(bsdf: Bsdf, samples: u32) -> Option<Bsdf> {
    match bsdf {
        Bsdf::CoatedDiffuse(b) => {
            Some(Bsdf::CoatedDiffuse(CoatedDiffuse { coat: Coat { samples, ..b.coat }, ..b }))
        }
        Bsdf::CoatedConductor(b) => {
            Some(Bsdf::CoatedConductor(CoatedConductor { coat: Coat { samples, ..b.coat }, ..b }))
        }
        _ => None,
    }
}

fn numbers(random: &mut RandomStream) -> (f32, Vec2) {
    (random.next_f32(), Vec2::new(random.next_f32(), random.next_f32()))
}

/// ∫ over a cell of (cos θ, φ), halved where the rule on it and on its quarters differ.
fn integrate(f: &dyn Fn(LocalDir) -> f64, z: (f64, f64), phi: (f64, f64), depth: u32) -> f64 {
    let rule = |z: (f64, f64), phi: (f64, f64)| {
        // Gauss–Legendre, three points each way.
        let nodes =
            [(-0.774_596_669_241_483_4, 5.0 / 9.0), (0.0, 8.0 / 9.0), (0.774_596_669_241_483_4, 5.0 / 9.0)];
        let at = |(a, b): (f64, f64), x: f64| 0.5 * (a + b) + 0.5 * (b - a) * x;
        let mut sum = 0.0;
        for (x, wx) in nodes {
            for (y, wy) in nodes {
                let (z, phi) = (at(z, x), at(phi, y));
                let r = (1.0 - z * z).max(0.0).sqrt();
                let v = Vec3::new((r * phi.cos()) as f32, (r * phi.sin()) as f32, z as f32);
                sum += wx * wy * f(local(v));
            }
        }
        sum * 0.25 * (z.1 - z.0) * (phi.1 - phi.0)
    };
    let (mid_z, mid_phi) = (0.5 * (z.0 + z.1), 0.5 * (phi.0 + phi.1));
    let quarters = [
        ((z.0, mid_z), (phi.0, mid_phi)),
        ((z.0, mid_z), (mid_phi, phi.1)),
        ((mid_z, z.1), (phi.0, mid_phi)),
        ((mid_z, z.1), (mid_phi, phi.1)),
    ];
    let fine: f64 = quarters.iter().map(|&(z, phi)| rule(z, phi)).sum();
    let agrees = (fine - rule(z, phi)).abs() <= 2e-7 + 1e-4 * fine;
    if depth == 0 || agrees {
        return fine;
    }
    quarters.iter().map(|&(z, phi)| integrate(f, z, phi, depth - 1)).sum()
}

const RINGS: usize = 20;
const SECTORS: usize = 24;
const SAMPLES: u32 = 100_000;

/// The probability of each cell of the sphere by the density, and the counts of each by sampling.
fn histogram(bsdf: &Bsdf, wo: LocalDir, seed: u64) -> (Vec<f64>, Vec<u32>, u32) {
    let mut probabilities = Vec::with_capacity(RINGS * SECTORS);
    for ring in 0..RINGS {
        for sector in 0..SECTORS {
            let edge = |i: usize, n: usize, from: f64, size: f64| from + size * i as f64 / n as f64;
            let z = (edge(ring, RINGS, -1.0, 2.0), edge(ring + 1, RINGS, -1.0, 2.0));
            let phi = (edge(sector, SECTORS, -PI, TAU), edge(sector + 1, SECTORS, -PI, TAU));
            probabilities.push(integrate(&|wi| f64::from(bsdf.pdf(wo, wi)), z, phi, 6));
        }
    }
    let mut counts = vec![0; RINGS * SECTORS];
    let mut rest = 0;
    let mut random = RandomStream::new(seed);
    for _ in 0..SAMPLES {
        let (lobe, u) = numbers(&mut random);
        match bsdf.sample(wo, lobe, u) {
            Some(sample) if sample.scatter != Scatter::Delta => {
                let v = sample.wi.vec().as_dvec3();
                let ring = ((v.z + 1.0) / 2.0 * RINGS as f64) as usize;
                let sector = ((v.y.atan2(v.x) + PI) / TAU * SECTORS as f64) as usize;
                counts[ring.min(RINGS - 1) * SECTORS + sector.min(SECTORS - 1)] += 1;
            }
            _ => rest += 1,
        }
    }
    (probabilities, counts, rest)
}

/// ln Γ(x) for x > 0 (Lanczos, g = 7).
fn ln_gamma(x: f64) -> f64 {
    const C: [f64; 9] = [
        0.999_999_999_999_809_9,
        676.520_368_121_885_1,
        -1_259.139_216_722_402_8,
        771.323_428_777_653_1,
        -176.615_029_162_140_6,
        12.507_343_278_686_905,
        -0.138_571_095_265_720_12,
        9.984_369_578_019_572e-6,
        1.505_632_735_149_311_6e-7,
    ];
    let x = x - 1.0;
    let t = x + 7.5;
    let sum = (1..9).fold(C[0], |sum, i| sum + C[i] / (x + i as f64));
    0.5 * TAU.ln() + (x + 0.5) * t.ln() - t + sum.ln()
}

/// The probability that χ² with this many degrees of freedom is at least this: Q(k/2, x/2).
fn chi_square_tail(chi: f64, freedom: f64) -> f64 {
    let (a, x) = (0.5 * freedom, 0.5 * chi);
    if x <= 0.0 {
        return 1.0;
    }
    let front = (a * x.ln() - x - ln_gamma(a)).exp();
    if x < a + 1.0 {
        let (mut term, mut sum, mut n) = (1.0 / a, 1.0 / a, a);
        while term > sum * 1e-15 {
            n += 1.0;
            term *= x / n;
            sum += term;
        }
        return 1.0 - front * sum;
    }
    // Lentz's continued fraction.
    let mut b = x + 1.0 - a;
    let (mut c, mut d) = (1e300, 1.0 / b);
    let mut h = d;
    for i in 1..1000 {
        let an = -f64::from(i) * (f64::from(i) - a);
        b += 2.0;
        d = 1.0 / (an * d + b);
        c = b + an / c;
        h *= d * c;
        if (d * c - 1.0).abs() < 1e-14 {
            break;
        }
    }
    front * h
}

#[test]
fn the_tail_of_chi_square_is_that_of_the_tables() {
    for (freedom, chi, tail) in
        [(1.0, 3.841, 0.05), (10.0, 18.307, 0.05), (100.0, 149.449, 0.001), (5.0, 1.145, 0.95)]
    {
        assert!((chi_square_tail(chi, freedom) - tail).abs() < 1e-4, "{freedom} {chi}");
    }
}

#[test]
fn samples_follow_the_density_and_it_integrates_to_one() {
    let list = all();
    let tests = (0..list.len()).map(|b| some_views(b).count()).sum::<usize>() as f64;
    // Šidák: all tests together fail by chance once in a thousand.
    let significance = 1.0 - (1.0_f64 - 1e-3).powf(1.0 / tests);
    let compared: usize = thread::scope(|scope| {
        let threads: Vec<_> = (list.iter().enumerate())
            .map(|(b, (name, bsdf))| {
                scope.spawn(move || assert_sampling_follows(name, bsdf, b, significance))
            })
            .collect();
        threads.into_iter().map(|thread| thread.join().unwrap()).sum()
    });
    assert!(compared > if is_long() { 10_000 } else { 3_000 }, "{compared}");
}

/// By χ² from its views; returns how many cells were compared.
fn assert_sampling_follows(name: &str, bsdf: &Bsdf, number: usize, significance: f64) -> usize {
    let mut compared = 0;
    for (v, wo) in some_views(number) {
        let (probabilities, counts, rest) = histogram(bsdf, wo, (100 * number + v) as u64);
        let total = f64::from(SAMPLES);
        let integral: f64 = probabilities.iter().sum();
        let sampled = 1.0 - f64::from(rest) / total;
        let deviation = (sampled * (1.0 - sampled) / total).sqrt();
        assert!(
            (integral - sampled).abs() < 4.5 * deviation + 1e-3,
            "{name} from {:?}: the density integrates to {integral}, {sampled} are sampled",
            wo.vec()
        );
        // Cells with few expected are counted together with their neighbours.
        let (mut chi, mut cells) = (0.0, 0);
        let (mut expected, mut observed) = (0.0, 0.0);
        for (p, &n) in probabilities.iter().zip(&counts) {
            expected += p * total;
            observed += f64::from(n);
            if expected >= 8.0 {
                chi += (observed - expected).powi(2) / expected;
                cells += 1;
                compared += 1;
                (expected, observed) = (0.0, 0.0);
            }
        }
        assert!(
            observed <= expected + 8.0 * expected.sqrt() + 8.0,
            "{name}: {observed} where {expected} are expected"
        );
        if cells < 2 {
            continue;
        }
        let tail = chi_square_tail(chi, f64::from(cells - 1));
        assert!(tail > significance, "{name} from {:?}: χ² {chi} over {cells} cells, p {tail:e}", wo.vec());
    }
    compared
}

#[test]
fn a_weight_is_the_value_over_the_density() {
    let mut random = RandomStream::new(5);
    let mut count = 0;
    for (name, bsdf) in all() {
        for wo in views() {
            for _ in 0..2_000 {
                let (lobe, u) = numbers(&mut random);
                let Some(sample) = bsdf.sample(wo, lobe, u) else { continue };
                let Scatter::Density(density) = sample.scatter else { continue };
                let (value, pdf) = (bsdf.eval(wo, sample.wi), bsdf.pdf(wo, sample.wi));
                assert!(
                    (density / pdf - 1.0).abs() < 2e-2,
                    "{name} from {:?} to {:?}: {density} {pdf}",
                    wo.vec(),
                    sample.wi.vec()
                );
                let expected = value / pdf;
                let difference = (expected - sample.weight).map(f32::abs).max_component();
                assert!(
                    difference <= 2e-2 * (sample.weight.max_component() + 1e-3),
                    "{name} from {:?} to {:?}: {:?} {expected:?}",
                    wo.vec(),
                    sample.wi.vec(),
                    sample.weight
                );
                let crosses = !wo.same_hemisphere(sample.wi);
                assert_eq!(sample.transmitted, crosses, "{name}");
                count += 1;
            }
        }
    }
    assert!(count > 100_000, "{count}");
}

fn random_direction(random: &mut RandomStream) -> LocalDir {
    let z = 2.0 * random.next_f32() - 1.0;
    let (sin, cos) = (std::f32::consts::TAU * random.next_f32()).sin_cos();
    let r = (1.0 - z * z).sqrt();
    local(Vec3::new(r * cos, r * sin, z))
}

#[test]
fn light_goes_back_the_way_it_came() {
    let mut random = RandomStream::new(17);
    let mut count = 0;
    for (name, bsdf) in all() {
        let eta = match &bsdf {
            Bsdf::CoatedDiffuse(_) | Bsdf::CoatedConductor(_) => continue,
            // What it absorbs, and its tilt, are those of the viewer's angle.
            Bsdf::Hair(_) => continue,
            // As far as it is measured well, and not where light leaves otherwise than it comes.
            Bsdf::Measured(_) | Bsdf::Subsurface(_) => continue,
            // Under a coat it need not.
            Bsdf::Principled(bsdf) if bsdf.coat.weight > 0.0 => continue,
            // Each lane of a prism has an index of its own.
            Bsdf::Principled(bsdf) if spread(bsdf) > 0.0 => continue,
            Bsdf::Dielectric(glass) => glass.eta,
            Bsdf::Principled(bsdf) if bsdf.transmission > 0.0 && bsdf.body != Body::Thin => bsdf.eta,
            _ => 1.0,
        };
        for _ in 0..3_000 {
            let (a, b) = (random_direction(&mut random), random_direction(&mut random));
            if a.abs_cos_theta() < 0.05 || b.abs_cos_theta() < 0.05 {
                continue;
            }
            let index2 = |w: LocalDir| if w.cos_theta() < 0.0 { eta * eta } else { 1.0 };
            let there = bsdf.eval(a, b) / (b.abs_cos_theta() * index2(a));
            let back = bsdf.eval(b, a) / (a.abs_cos_theta() * index2(b));
            let difference = (there - back).map(f32::abs).max_component();
            // Next to the critical angle the little that crosses is a difference of nearly equal numbers.
            assert!(
                difference <= 2e-3 * there.max_component().max(1.5e-2),
                "{name} {:?} {:?}: {there:?} {back:?}",
                a.vec(),
                b.vec()
            );
            count += usize::from(!there.is_black());
        }
    }
    assert!(count > 10_000, "{count}");
}

/// The mean of red and its standard error over directions that hardly differ, each a random walk of its own.
fn mean_of_walks(bsdf: &Bsdf, wo: LocalDir, wi: LocalDir) -> (f64, f64) {
    let batches = 24;
    let values: Vec<f64> = (0..batches)
        .map(|i| {
            let aside = Vec3::new(1e-5, -2e-5, 0.0) * i as f32;
            let (wo, wi) = (local(wo.vec() + aside), local(wi.vec() - aside));
            f64::from(bsdf.eval(wo, wi).r / wi.abs_cos_theta())
        })
        .collect();
    let mean = values.iter().sum::<f64>() / f64::from(batches);
    let variance = values.iter().map(|v| (v - mean).powi(2)).sum::<f64>() / f64::from(batches - 1);
    (mean, (variance / f64::from(batches)).sqrt())
}

#[test]
fn walks_through_a_coat_go_back_the_way_they_came_in_the_mean() {
    let mut random = RandomStream::new(18);
    let mut count = 0;
    for (name, bsdf) in all() {
        let Some(bsdf) = with_walks(bsdf, 3_000) else { continue };
        for _ in 0..6 {
            let (a, b) = (random_direction(&mut random), random_direction(&mut random));
            let b = if a.same_hemisphere(b) { b } else { -b };
            if a.abs_cos_theta() < 0.1 || b.abs_cos_theta() < 0.1 {
                continue;
            }
            let ((there, there_error), (back, back_error)) =
                (mean_of_walks(&bsdf, a, b), mean_of_walks(&bsdf, b, a));
            let error = there_error.hypot(back_error);
            assert!(
                (there - back).abs() <= 5.0 * error + 5e-3 * there + 1e-7,
                "{name} {:?} {:?}: {there} {back} ± {error}",
                a.vec(),
                b.vec()
            );
            // A test with errors as large as its values would find nothing.
            count += usize::from(there > 0.0 && error < 0.05 * there);
        }
    }
    assert!(count > 50, "{count}");
}

/// The share of the power from `wo` that leaves again, brightest lane; radiance that crossed counted by η².
fn furnace(bsdf: &Bsdf, wo: LocalDir, samples: u32, seed: u64) -> f64 {
    let mut random = RandomStream::new(seed);
    let mut sum = [0.0; 3];
    for _ in 0..samples {
        let (lobe, u) = numbers(&mut random);
        let Some(sample) = bsdf.sample(wo, lobe, u) else { continue };
        let denser = f64::from(sample.eta * sample.eta);
        for (sum, weight) in sum.iter_mut().zip(sample.weight.to_array()) {
            *sum += f64::from(weight) * denser;
        }
    }
    sum.into_iter().fold(0.0, f64::max) / f64::from(samples)
}

/// The same with one sample in each cell of a grid of random numbers, which errs less, and four and a half times the
/// standard error that independent samples would have.
fn even_furnace(bsdf: &Principled, wo: LocalDir, [lobes, side]: [u32; 2]) -> (f64, f64) {
    let bsdf = Bsdf::Principled(Box::new(*bsdf));
    let mut random = RandomStream::new(31);
    let (mut sum, mut squares) = ([0.0; 3], 0.0);
    for i in 0..lobes * side * side {
        let mut within = |cell: u32, cells: u32| {
            ((cell as f32 + random.next_f32()) / cells as f32).min(1.0 - f32::EPSILON / 2.0)
        };
        let lobe = within(i / (side * side), lobes);
        let u = Vec2::new(within(i / side % side, side), within(i % side, side));
        let Some(sample) = bsdf.sample(wo, lobe, u) else { continue };
        for (sum, weight) in sum.iter_mut().zip(sample.weight.to_array()) {
            *sum += f64::from(weight) * f64::from(sample.eta * sample.eta);
        }
        squares += f64::from(sample.weight.max_component() * sample.eta * sample.eta).powi(2);
    }
    let samples = f64::from(lobes * side * side);
    let share = sum.into_iter().fold(0.0, f64::max) / samples;
    let error = 4.5 * ((squares / samples - share * share).max(0.0) / samples).sqrt();
    (share, error)
}

/// Whether what a furnace found is at least this, and no more than is there, but for its error.
fn within((share, error): (f64, f64), least: f64) -> bool {
    least - error <= share && share <= 1.002 + error
}

#[test]
#[ignore = "takes minutes: a million samples for each direction"]
fn white_surfaces_reflect_within_two_thousandths_of_everything() {
    let facets = Microfacets::new(1.0, 1.0);
    let low =
        Principled { eta: 1.1, f0: Spectrum::splat(fresnel::dielectric(1.0, 1.1)), ..Principled::DEFAULT };
    let list = [
        ("metal 1", Principled { metallic: 1.0, facets, ..Principled::DEFAULT }),
        ("pane 1 1.1", Principled { transmission: 1.0, facets, ..low }),
        ("opaque .01 1.1", Principled { facets: Microfacets::new(0.01, 0.01), ..low }),
        (
            "solid .01 2.4",
            Principled {
                facets: Microfacets::new(0.01, 0.01),
                transmission: 1.0,
                body: Body::Solid { spread: 0.0 },
                eta: 2.4,
                f0: Spectrum::splat(fresnel::dielectric(1.0, 2.4)),
                ..Principled::DEFAULT
            },
        ),
        (
            "cloth 0.1",
            Principled {
                sheen: Sheen::new(Spectrum::WHITE, 0.0),
                facets: Microfacets::new(0.09, 0.09),
                ..Principled::DEFAULT
            },
        ),
        (
            "cloth 0.4",
            Principled {
                sheen: Sheen::new(Spectrum::WHITE, 0.4),
                facets: Microfacets::new(0.09, 0.09),
                ..Principled::DEFAULT
            },
        ),
        (
            "coat",
            Principled {
                coat: Clearcoat { weight: 1.0, alpha: 0.01, ..Clearcoat::NONE },
                facets: Microfacets::new(0.09, 0.09),
                ..Principled::DEFAULT
            },
        ),
        ("brushed", Principled { metallic: 1.0, facets: Microfacets::new(0.6, 0.1), ..Principled::DEFAULT }),
    ];
    for (name, bsdf) in list {
        // Layers and stretched facets lose some; nothing makes any.
        let loses = name.starts_with("cloth") || name == "brushed";
        let least = if loses { 0.5 } else { 0.998 };
        for wo in views() {
            let share = even_furnace(&bsdf, wo, [64, 128]);
            assert!(within(share, least), "{name} from {:?}: {share:?}", wo.vec());
        }
    }
}

#[test]
fn no_surface_makes_light() {
    let mut count = 0;
    for (number, (name, bsdf)) in all().into_iter().enumerate() {
        for (v, wo) in some_views(number) {
            let (share, error) = match &bsdf {
                // Along the surface a few directions carry most of the light: there it takes more samples to decide.
                Bsdf::Principled(bsdf) => Some(even_furnace(bsdf, wo, GRID))
                    .filter(|(_, error)| *error < 0.1)
                    .unwrap_or_else(|| even_furnace(bsdf, wo, [16, 128])),
                _ => (furnace(&bsdf, wo, 100_000, v as u64), 0.0),
            };
            // A sample has one index for all lanes.
            let lanes = match &bsdf {
                Bsdf::Principled(bsdf) => f64::from(1.0 + spread(bsdf)).powi(2),
                _ => 1.0,
            };
            assert!(share <= (1.002 + error) * lanes, "{name} from {:?}: {share} ± {error}", wo.vec());
            // A test with errors as large as its values would find nothing.
            assert!(error < 0.1, "{name} from {:?}: ± {error}", wo.vec());
            assert!(share > 0.05, "{name} from {:?}: {share:?}", wo.vec());
            count += 1;
        }
    }
    assert!(count > if is_long() { 150 } else { 50 });
}

#[test]
fn what_promises_to_conserve_energy_does() {
    let grey = Spectrum::splat;
    let mut list = vec![
        ("diffuse", Bsdf::Diffuse(Diffuse { reflectance: grey(1.0) })),
        (
            "diffusetransmission",
            Bsdf::DiffuseTransmission(DiffuseTransmission {
                reflectance: grey(0.3),
                transmittance: grey(0.7),
            }),
        ),
        ("mirror", Bsdf::Conductor(Conductor::from_reflectance(grey(1.0), Microfacets::SMOOTH))),
    ];
    for (h, beta_m, beta_n) in [(0.0, 0.3, 0.3), (0.7, 0.05, 0.6), (-0.99, 1.0, 0.1), (1.0, 0.4, 1.0)] {
        list.push(("hair", Bsdf::Hair(Hair::new(Spectrum::BLACK, h, 1.55, beta_m, beta_n, 0.0))));
    }
    for eta in [GLASS, 1.0 / GLASS, 2.4, 1.0] {
        list.push(("dielectric", glass(eta, (0.0, 0.0))));
        list.push(("thindielectric", Bsdf::ThinDielectric(ThinDielectric { eta })));
    }
    let mut count = 0;
    for (name, bsdf) in &list {
        for (v, wo) in views().into_iter().enumerate() {
            let share = furnace(bsdf, wo, 20_000, v as u64);
            assert!((share - 1.0).abs() < 2e-3, "{name} from {:?}: {share:?}", wo.vec());
            count += 1;
        }
    }
    assert_eq!(count, 15 * 7);
}

#[test]
fn rough_glass_and_metal_lose_only_what_bounces_twice() {
    for (alpha, least) in [(0.05, 0.985), (0.2, 0.93), (0.5, 0.65)] {
        let mirror =
            Bsdf::Conductor(Conductor::from_reflectance(Spectrum::WHITE, Microfacets::new(alpha, alpha)));
        for bsdf in [mirror, glass(GLASS, (alpha, alpha))] {
            let share = furnace(&bsdf, local(Vec3::new(0.3, 0.2, 0.9)), 100_000, 3);
            assert!((least..1.001).contains(&share), "{bsdf:?}: {share}");
        }
    }
}

/// Cells of the random numbers for a furnace.
const GRID: [u32; 2] = [16, 32];

/// The roughnesses to try energy at.
const ROUGHNESSES: [f32; 7] = [0.0, 0.1, 0.25, 0.4, 0.6, 0.8, 1.0];

#[test]
fn white_metal_gives_everything_back_at_any_roughness() {
    let mut count = 0;
    for roughness in ROUGHNESSES {
        let facets = Microfacets::new(roughness * roughness, roughness * roughness);
        let metal = Principled { metallic: 1.0, facets, ..Principled::DEFAULT };
        for wo in views() {
            let share = even_furnace(&metal, wo, GRID);
            assert!(within(share, 0.997), "{roughness} from {:?}: {share:?}", wo.vec());
            count += 1;
        }
    }
    assert_eq!(count, 49);
}

#[test]
fn white_dielectrics_give_everything_back_at_any_roughness() {
    let mut count = 0;
    for roughness in ROUGHNESSES {
        let alpha = roughness * roughness;
        for eta in [1.1, 2.4] {
            let f0 = Spectrum::splat(fresnel::dielectric(1.0, eta));
            let opaque =
                Principled { facets: Microfacets::new(alpha, alpha), eta, f0, ..Principled::DEFAULT };
            let leaf = Principled { diffuse_transmission: 0.4, ..opaque };
            let pane = Principled { transmission: 1.0, ..opaque };
            let solid = Principled { body: Body::Solid { spread: 0.0 }, ..pane };
            for (name, bsdf) in [("opaque", opaque), ("leaf", leaf), ("pane", pane), ("solid", solid)] {
                for wo in views() {
                    let share = even_furnace(&bsdf, wo, GRID);
                    assert!(within(share, 0.995), "{name} {roughness} {eta} from {:?}: {share:?}", wo.vec());
                    count += 1;
                }
            }
        }
    }
    assert_eq!(count, 7 * 2 * 4 * 7);
}

#[test]
fn a_coloured_coat_tints_by_the_way_through_it() {
    let color = Spectrum::new(1.0, 0.5, 0.25);
    for eta in [1.3, 1.6, 2.5_f32] {
        for cos in [1.0, 0.6, 0.2_f32] {
            let coat = Clearcoat { weight: 1.0, eta, color, ..Clearcoat::NONE };
            let base = Spectrum::splat(0.5);
            let bsdf =
                Principled { metallic: 1.0, base, facets: Microfacets::SMOOTH, coat, ..Principled::DEFAULT };
            let wo = LocalDir::new(Vec3::new((1.0 - cos * cos).sqrt(), 0.0, cos));
            let lobes = (0..2000).map(|k| (k as f32 + 0.5) / 2000.0);
            let sum = lobes.fold(Spectrum::BLACK, |sum, lobe| {
                let sample = bsdf.sample(wo, lobe, Vec2::splat(0.5)).expect("a mirror reflects");
                sum + sample.weight
            });
            let face = fresnel::dielectric(cos, eta);
            let metal = 0.5 + 0.5 * (1.0 - cos).powi(5);
            let inside = (1.0 - (1.0 - cos * cos) / (eta * eta)).sqrt();
            let expected = color.map(|c| face + (1.0 - face) * metal * c.powf(1.0 / inside));
            let found = sum / 2000.0;
            let away = (found - expected).map(f32::abs).max_component();
            assert!(away < 0.012, "{eta} {cos}: {found:?}, not {expected:?}");
        }
    }
}

#[test]
fn a_coat_darkens_grey_by_the_light_that_it_reflects_back_down() {
    // A coat of index 1.5 reflects 0.0918 of even light from outside, so 1 - 0.9082 / 1.5² = 0.5963 from inside.
    // Grey of
    // 0.5 without reflections of its own keeps (1 - 0.5963) / (1 - 0.5 · 0.5963) = 0.5752 of itself.
    let coat = Clearcoat { weight: 1.0, darkening: 1.0, ..Clearcoat::NONE };
    let grey =
        Principled { base: Spectrum::splat(0.5), f0: Spectrum::BLACK, f90: 0.0, coat, ..Principled::DEFAULT };
    let up = LocalDir::new(Vec3::Z);
    let (share, error) = even_furnace(&grey, up, GRID);
    let expected = 0.04 + 0.96 * 0.5 * 0.5752;
    assert!((share - expected).abs() < 0.004 + error, "{share}, not {expected}");
    let half = Principled { coat: Clearcoat { weight: 0.5, ..coat }, ..grey };
    let (share, error) = even_furnace(&half, up, GRID);
    // Layers of one surface, not two surfaces side by side.
    let expected = 0.02 + 0.98 * 0.5 * 0.5 * (1.0 + 0.5752);
    assert!((share - expected).abs() < 0.004 + error, "{share}, not {expected}");
}

#[test]
fn white_layers_make_no_light_and_a_coat_loses_none() {
    let mut count = 0;
    for roughness in ROUGHNESSES {
        let alpha = roughness * roughness;
        for metallic in [0.0, 1.0] {
            let base = Principled { metallic, facets: Microfacets::new(0.09, 0.09), ..Principled::DEFAULT };
            let coat = Principled { coat: Clearcoat { weight: 1.0, alpha, ..Clearcoat::NONE }, ..base };
            let dense = Clearcoat { eta: 2.5, darkening: 1.0, ..coat.coat };
            let cloth = Principled { sheen: Sheen::new(Spectrum::WHITE, roughness), ..base };
            let list = [("coat", coat), ("dense coat", Principled { coat: dense, ..base }), ("cloth", cloth)];
            for (name, bsdf) in list {
                for wo in views() {
                    let share = even_furnace(&bsdf, wo, GRID);
                    let least = if name.ends_with("coat") { 0.995 } else { 0.6 };
                    assert!(
                        within(share, least),
                        "{name} {roughness} {metallic} from {:?}: {share:?}",
                        wo.vec()
                    );
                    count += 1;
                }
            }
        }
    }
    assert_eq!(count, 7 * 2 * 3 * 7);
}

#[test]
fn white_brushed_surfaces_give_everything_back() {
    let mut count = 0;
    for (x, y) in [(0.3, 0.1), (0.1, 0.6), (1.0, 0.04), (0.3, 1.0)] {
        let brushed = Principled { facets: Microfacets::new(x, y), ..Principled::DEFAULT };
        let metal = Principled { metallic: 1.0, tangent: Vec2::new(0.6, 0.8), ..brushed };
        let mirror_like = Principled { f0: Spectrum::WHITE, ..brushed };
        let pane = Principled { transmission: 1.0, ..brushed };
        let solid = Principled { body: Body::Solid { spread: 0.0 }, ..pane };
        let list = [
            ("metal", metal, 0.99),
            ("all specular", mirror_like, 0.99),
            ("plastic", brushed, 0.975),
            ("pane", pane, 0.99),
            // Which gives back only some of it.
            ("solid", solid, 0.5),
        ];
        for (name, bsdf, least) in list {
            for wo in views().into_iter().step_by(2) {
                let (share, error) = even_furnace(&bsdf, wo, GRID);
                let most = if name == "plastic" { 1.02 } else { 1.004 };
                let ok = least - error <= share && share <= most + error;
                assert!(ok, "{name} {x} {y} from {:?}: {share} ± {error}", wo.vec());
                count += 1;
            }
        }
    }
    assert_eq!(count, 4 * 5 * 4);
}

#[test]
fn plain_principled_glass_and_panes_are_the_plain_kinds() {
    let solid = Principled {
        facets: Microfacets::SMOOTH,
        transmission: 1.0,
        body: Body::Solid { spread: 0.0 },
        ..Principled::DEFAULT
    };
    let pane = Principled { body: Body::Thin, ..solid };
    let pairs = [
        (Bsdf::Principled(Box::new(solid)), glass(GLASS, (0.0, 0.0))),
        (Bsdf::Principled(Box::new(pane)), Bsdf::ThinDielectric(ThinDielectric { eta: GLASS })),
    ];
    let (mut random, mut count) = (RandomStream::new(8), 0);
    for (ours, plain) in pairs {
        assert!(ours.is_delta());
        for wo in views() {
            for _ in 0..200 {
                let (lobe, u) = numbers(&mut random);
                let (Some(a), Some(b)) = (ours.sample(wo, lobe, u), plain.sample(wo, lobe, u)) else {
                    unreachable!()
                };
                // Next to the border between the two ways rounding may choose.
                if a.transmitted != b.transmitted {
                    continue;
                }
                assert!((a.wi.vec() - b.wi.vec()).length() < 1e-5);
                assert!((a.weight - b.weight).map(f32::abs).max_component() < 1e-4, "{a:?} {b:?}");
                assert_eq!((a.scatter, a.eta), (b.scatter, b.eta));
                count += 1;
            }
        }
    }
    assert!(count > 2_750, "{count}");
}

#[test]
fn a_prism_bends_blue_more_than_red() {
    let prism = Bsdf::Principled(Box::new(Principled {
        facets: Microfacets::SMOOTH,
        transmission: 1.0,
        body: Body::Solid { spread: 0.1 },
        ..Principled::DEFAULT
    }));
    let wo = local(Vec3::new(0.6, 0.0, 0.8));
    let (mut random, mut seen) = (RandomStream::new(9), [0; 3]);
    for _ in 0..3_000 {
        let (lobe, u) = numbers(&mut random);
        let Some(sample) = prism.sample(wo, lobe, u) else { continue };
        if !sample.transmitted {
            continue;
        }
        let lane = sample.weight.to_array().iter().position(|&w| w > 0.0).unwrap();
        assert!(sample.weight.to_array().iter().filter(|&&w| w > 0.0).count() == 1);
        let eta = [1.4, 1.5, 1.6][lane];
        assert!((sample.wi.vec().x + 0.6 / eta).abs() < 1e-5, "{lane} {sample:?}");
        seen[lane] += 1;
    }
    assert!(seen.iter().all(|&n| n > 850), "{seen:?}");
}

#[test]
fn grazing_directions_give_finite_answers() {
    let odd: Vec<LocalDir> = [
        Vec3::X,
        Vec3::Z,
        -Vec3::Z,
        Vec3::new(1.0, 0.0, 1e-7),
        Vec3::new(0.0, 1.0, -1e-7),
        Vec3::new(0.6, -0.8, 1e-30),
        Vec3::new(1e-20, 0.0, 1.0),
    ]
    .map(local)
    .into_iter()
    // Of no length at all, which no frame should give.
    .chain([ShadingFrame { s: Vec3::X, t: Vec3::Y, n: Vec3::Z }.to_local(Vec3::ZERO)])
    .collect();
    let edge = [0.0, 0.5, 1.0 - f32::EPSILON / 2.0];
    let mut count = 0;
    let finite = |c: Spectrum| c.is_finite() && c.min_component() >= 0.0;
    for (name, bsdf) in all() {
        for &wo in &odd {
            for &wi in &odd {
                let pdf = bsdf.pdf(wo, wi);
                assert!(pdf.is_finite() && pdf >= 0.0, "{name} {:?} {:?}: {pdf}", wo.vec(), wi.vec());
                assert!(finite(bsdf.eval(wo, wi)), "{name} {:?} {:?}", wo.vec(), wi.vec());
            }
            for lobe in edge {
                for x in edge {
                    for y in edge {
                        let Some(sample) = bsdf.sample(wo, lobe, Vec2::new(x, y)) else { continue };
                        assert!(finite(sample.weight), "{name} {:?} {sample:?}", wo.vec());
                        assert!(
                            (sample.wi.vec().length() - 1.0).abs() < 1e-4,
                            "{name} {:?} {sample:?}",
                            wo.vec()
                        );
                        if let Scatter::Density(pdf) = sample.scatter {
                            assert!(pdf > 0.0 && pdf.is_finite(), "{name} {:?} {sample:?}", wo.vec());
                        }
                        count += 1;
                    }
                }
            }
        }
    }
    assert!(count > 2_000, "{count}");
}

#[test]
fn a_delta_has_no_density_and_says_so() {
    let mut deltas = 0;
    for (name, bsdf) in all() {
        let mut random = RandomStream::new(2);
        for wo in views() {
            for _ in 0..100 {
                let (lobe, u) = numbers(&mut random);
                let Some(sample) = bsdf.sample(wo, lobe, u) else { continue };
                if bsdf.is_delta() {
                    assert_eq!(sample.scatter, Scatter::Delta, "{name}");
                    assert_eq!(bsdf.pdf(wo, sample.wi), 0.0, "{name}");
                    assert!(bsdf.eval(wo, sample.wi).is_black(), "{name}");
                    deltas += 1;
                }
            }
        }
    }
    assert!(deltas > 1_000);
    assert!(!Bsdf::CoatedDiffuse(coated((0.0, 0.0), 0.0, 1)).is_delta());
}

#[test]
fn glass_refracts_by_snell_s_law() {
    let bsdf = glass(GLASS, (0.0, 0.0));
    let wo = local(Vec3::new(0.6, 0.0, 0.8));
    let sample = bsdf.sample(wo, 0.999, Vec2::new(0.3, 0.4)).unwrap();
    assert!(sample.transmitted && sample.eta == GLASS);
    assert!((sample.wi.vec() - Vec3::new(-0.4, 0.0, -(1.0_f32 - 0.16).sqrt())).length() < 1e-6);
    assert!((sample.weight.r - 1.0 / (GLASS * GLASS)).abs() < 1e-6);
    // And beyond the critical angle everything comes back.
    let inside = local(Vec3::new(0.8, 0.0, -0.6));
    let back = bsdf.sample(inside, 0.999, Vec2::new(0.3, 0.4)).unwrap();
    assert!(!back.transmitted && back.eta == 1.0 && back.weight == Spectrum::WHITE);
}

/// The mean over the hemisphere, by the cosine law, of what the coat reflects back from below.
fn internal_reflectance(eta: f32) -> f64 {
    (0..20_000)
        .map(|i| {
            // cos² uniform.
            let cos = ((f64::from(i) + 0.5) / 20_000.0).sqrt();
            f64::from(fresnel::dielectric(-cos as f32, eta))
        })
        .sum::<f64>()
        / 20_000.0
}

#[test]
fn a_smooth_clear_coat_has_the_value_of_the_closed_form() {
    // All the bounces between a diffuse base and a smooth face: T(o) T(i) ρ / (π η² (1 − ρ R)).
    let inner = internal_reflectance(GLASS);
    let mut coat = coated((0.0, 0.0), 0.0, 100_000);
    (coat.coat.thickness, coat.coat.max_depth) = (0.0, 200);
    let mut count = 0;
    for (wo, wi) in [
        (Vec3::new(0.1, 0.2, 0.9), Vec3::new(-0.5, 0.3, 0.6)),
        (Vec3::new(-0.8, 0.1, 0.4), Vec3::new(0.3, 0.3, 0.5)),
        (Vec3::new(0.2, 0.1, -0.7), Vec3::new(0.5, 0.4, -0.6)),
    ] {
        let (wo, wi) = (local(wo), local(wi));
        let through = |w: LocalDir| 1.0 - f64::from(fresnel::dielectric(w.abs_cos_theta(), GLASS));
        let ours = coat.eval(wo, wi).to_array();
        for (ours, rho) in ours.into_iter().zip(coat.base.reflectance.to_array()) {
            let rho = f64::from(rho);
            let expected = through(wo) * through(wi) * rho * f64::from(wi.abs_cos_theta())
                / (PI * f64::from(GLASS * GLASS) * (1.0 - rho * inner));
            assert!((f64::from(ours) / expected - 1.0).abs() < 1e-2, "{ours} {expected}");
            count += 1;
        }
    }
    assert_eq!(count, 9);
}

#[test]
fn a_nearly_smooth_coat_is_nearly_the_smooth_one() {
    let (wo, wi) = (local(Vec3::new(0.1, 0.2, 0.9)), local(Vec3::new(-0.5, 0.3, 0.6)));
    for albedo in [0.0, 0.8] {
        let smooth = coated((0.0, 0.0), albedo, 60_000).eval(wo, wi);
        let rough = coated((0.02, 0.02), albedo, 60_000).eval(wo, wi);
        for (a, b) in smooth.to_array().into_iter().zip(rough.to_array()) {
            assert!((a / b - 1.0).abs() < 0.02, "{smooth:?} {rough:?}");
        }
    }
}

#[test]
fn a_medium_without_base_scatters_as_its_phase_function_says() {
    // A thin layer under no border at all over a black base: single scattering, whose closed form is known.
    let mut coat = coated((0.0, 0.0), 1.0, 400_000);
    coat.coat.face.eta = 1.0;
    coat.base.reflectance = Spectrum::BLACK;
    (coat.coat.thickness, coat.coat.g, coat.coat.max_depth) = (0.01, 0.6, 1);
    let (wo, wi) = (local(Vec3::new(0.1, 0.2, 0.9)), local(Vec3::new(-0.5, 0.3, 0.6)));
    let (cos_o, cos_i) = (f64::from(wo.cos_theta()), f64::from(wi.cos_theta()));
    let cos = -f64::from(wo.vec().dot(wi.vec()));
    let g = 0.6_f64;
    let phase = (1.0 - g * g) / (4.0 * PI * (1.0 + g * g - 2.0 * g * cos).powf(1.5));
    // ∫ p e^(−τ(1/μo + 1/μi)) dτ / μo: Chandrasekhar's single scattering, times μi / μi.
    let paths = 1.0 / cos_o + 1.0 / cos_i;
    let expected = phase * (1.0 - (-0.01 * paths).exp()) / (paths * cos_o);
    let ours = f64::from(coat.eval(wo, wi).r);
    assert!((ours / expected - 1.0).abs() < 0.05, "{ours} {expected}");
}

#[test]
fn smooth_layers_reflect_the_geometric_series() {
    let metal = coated_metal((0.0, 0.0), (0.0, 0.0), 0.0);
    let mut endless = metal;
    (endless.coat.thickness, endless.coat.max_depth) = (0.2, 200);
    let mut count = 0;
    for wo in views() {
        let sample = Bsdf::CoatedConductor(endless).sample(wo, 0.4, Vec2::new(0.3, 0.6)).unwrap();
        assert_eq!(sample.scatter, Scatter::Delta);
        let v = wo.vec();
        assert!((sample.wi.vec() - Vec3::new(-v.x, -v.y, v.z)).length() < 1e-6);
        let cos_o = wo.abs_cos_theta();
        let cos_t = (1.0 - (1.0 - cos_o * cos_o) / (GLASS * GLASS)).sqrt();
        let f = f64::from(fresnel::dielectric(cos_o, GLASS));
        let pass = f64::from((-0.4 / cos_t).exp());
        let channels = sample.weight.to_array().into_iter().zip(metal.base.fresnel(cos_t).to_array());
        for (ours, r) in channels {
            let r = f64::from(r) * pass;
            let expected = f + (1.0 - f).powi(2) * r / (1.0 - r * f);
            assert!((f64::from(ours) - expected).abs() < 1e-4, "{ours} {expected}");
            count += 1;
        }
    }
    assert_eq!(count, 21);
}

#[test]
fn slightly_rough_coated_metal_is_as_bright_as_smooth() {
    for wo in [Vec3::new(0.1, 0.2, 0.9), Vec3::new(-0.5, 0.3, 0.6)].map(local) {
        let share = |coat, metal| {
            let bsdf = Bsdf::CoatedConductor(coated_metal((coat, coat), (metal, metal), 0.0));
            furnace(&bsdf, wo, 400_000, 11)
        };
        let smooth = share(0.0, 0.0);
        for (coat, metal) in [(0.0, 0.02), (0.02, 0.0), (0.02, 0.02)] {
            let rough = share(coat, metal);
            assert!((rough / smooth - 1.0).abs() < 0.015, "{coat} {metal}: {rough} {smooth}");
        }
    }
}

#[test]
fn a_bsdf_stays_small() {
    assert!(size_of::<Bsdf>() <= 176, "{}", size_of::<Bsdf>());
}

#[test]
fn regularizing_roughens_mirrors_only() {
    let Bsdf::Conductor(metal) = gold((0.0, 0.0)).regularized() else { unreachable!() };
    assert_eq!(metal.facets.alpha(), Vec2::splat(0.1));
    let Bsdf::Dielectric(rough) = glass(GLASS, (0.12, 0.25)).regularized() else { unreachable!() };
    assert_eq!(rough.facets.alpha(), Vec2::new(0.24, 0.3));
    assert_eq!(glass(GLASS, (0.4, 0.5)).regularized(), glass(GLASS, (0.4, 0.5)));
    let mirror = Bsdf::CoatedConductor(coated_metal((0.0, 0.0), (0.0, 0.0), 0.0));
    assert!(mirror.is_delta() && !mirror.regularized().is_delta());
}

#[test]
fn a_coat_looks_the_same_from_both_sides() {
    let mut count = 0;
    for bsdf in all().into_iter().filter_map(|(_, bsdf)| with_walks(bsdf, 3)) {
        for wo in views() {
            let (lobe, u) = (0.97, Vec2::new(0.3, 0.6));
            let (Some(above), Some(below)) = (bsdf.sample(wo, lobe, u), bsdf.sample(-wo, lobe, u)) else {
                continue;
            };
            assert_eq!((above.wi.vec(), above.weight), (-below.wi.vec(), below.weight));
            assert_eq!(bsdf.eval(wo, above.wi), bsdf.eval(-wo, -above.wi));
            count += 1;
        }
    }
    assert!(count > 60, "{count}");
}

/// Directions, random numbers and rows of one kind, to run at any number of lanes.
struct Columns {
    table: Rows,
    at: Vec<u32>,
    wo: [Vec<f32>; 3],
    wi: [Vec<f32>; 3],
    u: [Vec<f32>; 3],
    regularized: Vec<bool>,
}

impl Columns {
    /// The row of each lane is one of the BSDFs'; directions are of all kinds, samples of theirs and such that have no
    /// side among them.
    fn new(bsdfs: &[Bsdf], count: usize, seed: u64) -> Self {
        let mut table = Rows::default();
        (0..5).for_each(|_| {
            table.push(&Bsdf::ThinDielectric(ThinDielectric { eta: f32::NAN }));
        });
        let starts: Vec<u32> = bsdfs.iter().map(|bsdf| table.push(bsdf)).collect();
        assert_eq!(starts[0], 5);
        let mut random = RandomStream::new(seed);
        let mut columns = Self {
            table,
            at: Vec::new(),
            wo: Default::default(),
            wi: Default::default(),
            u: Default::default(),
            regularized: Vec::new(),
        };
        for i in 0..count {
            let which = (random.next_f32() * bsdfs.len() as f32) as usize;
            let wo = if i % 61 == 0 { local(Vec3::X) } else { random_direction(&mut random) };
            let (lobe, u) = numbers(&mut random);
            let regularized = i % 7 == 3;
            let bsdf = if regularized { bsdfs[which].clone().regularized() } else { bsdfs[which].clone() };
            let sampled = bsdf.sample(wo, random.next_f32(), u).filter(|_| i % 2 == 0);
            let wi = sampled.map_or_else(|| random_direction(&mut random), |sample| sample.wi);
            columns.at.push(starts[which]);
            columns.regularized.push(regularized);
            for axis in 0..3 {
                columns.wo[axis].push(wo.vec()[axis]);
                columns.wi[axis].push(wi.vec()[axis]);
                columns.u[axis].push([lobe, u.x, u.y][axis]);
            }
        }
        columns
    }
}

/// Value, density and sample of each row of the columns, as bits.
struct Scattering<'a, K>(&'a Columns, PhantomData<K>);

type Outcome = ([f32; 4], bool, Option<([f32; 8], [bool; 2])>);

/// A kind of BSDF at any number of lanes.
trait Kind {
    type Lanes<R: Real>: LaneBsdf<R>;
}

impl<K: Kind> Job for Scattering<'_, K> {
    type Output = Vec<Outcome>;
    #[inline(always)]
    fn run<R: Real>(self) -> Vec<Outcome> {
        let Self(columns, _) = self;
        let count = columns.at.len();
        assert_eq!(count % R::LANES, 0);
        let mut outcomes = Vec::with_capacity(count);
        for start in (0..count).step_by(R::LANES) {
            let mut bits = 0;
            for lane in 0..R::LANES {
                bits |= u32::from(columns.regularized[start + lane]) << lane;
            }
            let at = R::UInt::from_slice(&columns.at[start..]);
            let bsdf: K::Lanes<R> = columns.table.load(at);
            let bsdf = bsdf.regularized(R::Mask::from_bitmask(bits));
            let (wo, wi) = (load::<R>(&columns.wo, start), load(&columns.wi, start));
            let V3 { x: lobe, y: u, z: v } = load(&columns.u, start);
            let (value, pdf) = bsdf.eval(wo, wi);
            let sample = bsdf.sample(wo, lobe, [u, v]);
            let evaluated = [value.x.to_lanes(), value.y.to_lanes(), value.z.to_lanes(), pdf.to_lanes()];
            let s = sample;
            let (w, c) = ([s.wi.x.to_lanes(), s.wi.y.to_lanes(), s.wi.z.to_lanes()], s.weight);
            let c = [c.x.to_lanes(), c.y.to_lanes(), c.z.to_lanes(), s.pdf.to_lanes(), s.eta.to_lanes()];
            let sampled = [w[0], w[1], w[2], c[0], c[1], c[2], c[3], c[4]];
            let masks = [
                bsdf.is_delta().to_bitmask(),
                s.valid.to_bitmask(),
                s.delta.to_bitmask(),
                s.transmitted.to_bitmask(),
            ];
            for lane in 0..R::LANES {
                let [is_delta, valid, delta, transmitted] = masks.map(|mask| mask >> lane & 1 == 1);
                let sample = valid.then(|| (sampled.map(|lanes| lanes[lane]), [delta, transmitted]));
                outcomes.push((evaluated.map(|lanes| lanes[lane]), is_delta, sample));
            }
        }
        outcomes
    }
}

#[inline(always)]
fn load<R: Real>(columns: &[Vec<f32>; 3], start: usize) -> V3<R> {
    let [x, y, z] = columns;
    V3::new(R::from_slice(&x[start..]), R::from_slice(&y[start..]), R::from_slice(&z[start..]))
}

/// The same by the scalar interface.
fn scalar_outcomes(bsdfs: &[Bsdf], columns: &Columns) -> Vec<Outcome> {
    let row = bsdfs[0].row().len() as u32;
    let outcome = |i: usize| {
        let bsdf = bsdfs[((columns.at[i] - 5) / row) as usize].clone();
        let bsdf = if columns.regularized[i] { bsdf.regularized() } else { bsdf };
        // Made up by its coordinates, which the frame's products and sums leave as they are.
        let direction = |w: &[Vec<f32>; 3]| {
            ShadingFrame { s: Vec3::X, t: Vec3::Y, n: Vec3::Z }.to_local(Vec3::new(w[0][i], w[1][i], w[2][i]))
        };
        let (wo, wi) = (direction(&columns.wo), direction(&columns.wi));
        let value = bsdf.eval(wo, wi);
        let sample = bsdf.sample(wo, columns.u[0][i], Vec2::new(columns.u[1][i], columns.u[2][i]));
        let sample = sample.map(|s| {
            let (w, c) = (s.wi.vec(), s.weight);
            let (pdf, delta) = match s.scatter {
                Scatter::Density(pdf) => (pdf, false),
                Scatter::Delta => (1.0, true),
            };
            ([w.x, w.y, w.z, c.r, c.g, c.b, pdf, s.eta], [delta, s.transmitted])
        });
        ([value.r, value.g, value.b, bsdf.pdf(wo, wi)], bsdf.is_delta(), sample)
    };
    (0..columns.at.len()).map(outcome).collect()
}

fn bits_of((evaluated, is_delta, sample): &Outcome) -> impl PartialEq + std::fmt::Debug {
    (
        evaluated.map(f32::to_bits),
        *is_delta,
        sample.map(|(numbers, masks)| (numbers.map(f32::to_bits), masks)),
    )
}

/// Compares all instruction sets with the scalar interface on random BSDFs of a kind.
fn assert_lanes_agree<K: Kind>(kind: BsdfKind, random_bsdf: impl Fn(&mut RandomStream) -> Bsdf) {
    let mut random = RandomStream::new(61 + kind as u64);
    let bsdfs: Vec<Bsdf> = (0..97).map(|_| random_bsdf(&mut random)).collect();
    assert!(bsdfs.iter().all(|bsdf| bsdf.kind() == kind));
    assert_eq!(bsdfs[0].row().len(), <K::Lanes<f32> as LaneBsdf<f32>>::ROW);
    let columns = Columns::new(&bsdfs, 16 * 1500, 3 + kind as u64);
    let expected = scalar_outcomes(&bsdfs, &columns);
    for set in InstructionSet::available() {
        let outcomes = set.run(Scattering::<K>(&columns, PhantomData));
        for (i, (outcome, expected)) in outcomes.iter().zip(&expected).enumerate() {
            assert!(
                bits_of(outcome) == bits_of(expected),
                "{kind:?} at {}, row {i}: {outcome:?} and {expected:?}",
                set.name()
            );
        }
    }
    let met = expected.iter().filter(|(evaluated, ..)| evaluated[3] > 0.0).count();
    let sampled = expected.iter().filter(|(.., sample)| sample.is_some()).count();
    assert!(kind == BsdfKind::ThinDielectric || met > 2000, "{kind:?}: {met}");
    assert!(sampled > 10_000 && sampled < expected.len(), "{kind:?}: {sampled}");
}

fn random_colour(random: &mut RandomStream) -> Spectrum {
    Spectrum::new(random.next_f32(), random.next_f32(), random.next_f32())
}

/// A quarter smooth, a quarter isotropic.
fn random_facets(random: &mut RandomStream) -> Microfacets {
    let (x, y) = (random.next_f32(), random.next_f32());
    match (4.0 * random.next_f32()) as u32 {
        0 => Microfacets::SMOOTH,
        1 => Microfacets::new(x * x, x * x),
        _ => Microfacets::new(x * x, y),
    }
}

/// A third of them scatter.
fn random_coat(random: &mut RandomStream) -> Coat {
    let scatters = random.next_f32() < 0.3;
    Coat {
        face: Dielectric {
            eta: if random.next_f32() < 0.1 { 1.0 } else { 1.0 + random.next_f32() },
            facets: random_facets(random),
        },
        thickness: random.next_f32(),
        g: 1.8 * random.next_f32() - 0.9,
        albedo: if scatters { random_colour(random) } else { Spectrum::BLACK },
        max_depth: (12.0 * random.next_f32()) as u32,
        samples: (4.0 * random.next_f32()) as u32,
    }
}

/// Every part is missing in some.
fn random_principled(random: &mut RandomStream) -> Principled {
    let (sin, cos) = (std::f32::consts::TAU * random.next_f32()).sin_cos();
    let mut share = || {
        let number = 3.0 * random.next_f32() - 1.0;
        number.clamp(0.0, 1.0)
    };
    let (metallic, transmission, diffuse_transmission) = (share(), share(), share());
    let (film, coat, sheen, leans, thin, disperses) = (share(), share(), share(), share(), share(), share());
    let eta = if random.next_f32() < 0.1 { 1.0 } else { 0.6 + 1.5 * random.next_f32() };
    let normal = Vec3::new(random.next_f32() - 0.5, random.next_f32() - 0.5, 1.0).normalize();
    Principled {
        base: random_colour(random),
        metallic,
        facets: random_facets(random),
        tangent: Vec2::new(cos, sin),
        eta,
        f0: random_colour(random) * 0.2,
        f90: random.next_f32(),
        transmission,
        transmission_color: random_colour(random),
        body: match (thin > 0.5, disperses > 0.5) {
            (true, _) => Body::Thin,
            (_, true) => Body::Solid { spread: 0.05 },
            _ => Body::Solid { spread: 0.0 },
        },
        diffuse_transmission,
        diffuse_transmission_color: random_colour(random),
        film: ThinFilm {
            weight: film,
            eta: 1.0 + random.next_f32(),
            thickness: 800.0 * random.next_f32(),
            ..ThinFilm::NONE
        },
        sheen: if sheen > 0.5 { Sheen::new(random_colour(random), random.next_f32()) } else { Sheen::NONE },
        coat: Clearcoat {
            weight: coat,
            alpha: (2.0 * random.next_f32() - 1.0).max(0.0),
            normal: if leans > 0.5 { normal } else { Vec3::Z },
            eta: 1.0 + 2.0 * random.next_f32(),
            color: if random.next_f32() > 0.5 { random_colour(random) } else { Spectrum::WHITE },
            darkening: (2.0 * random.next_f32() - 1.0).max(0.0),
            base_alpha: None,
        },
    }
}

macro_rules! kinds {
    ($($name:ident = $lanes:ident),*) => {
        $(
            struct $name;
            impl Kind for $name {
                type Lanes<R: Real> = lanes::$lanes<R>;
            }
        )*
    };
}

kinds! {
    DiffuseKind = DiffuseLanes, DiffuseTransmissionKind = DiffuseTransmissionLanes, ConductorKind = ConductorLanes,
    DielectricKind = DielectricLanes, ThinDielectricKind = ThinDielectricLanes,
    CoatedDiffuseKind = CoatedDiffuseLanes, CoatedConductorKind = CoatedConductorLanes,
    PrincipledKind = PrincipledLanes, UberKind = UberLanes, HairKind = HairLanes, MeasuredKind = MeasuredLanes,
    SubsurfaceKind = SubsurfaceLanes
}

#[test]
fn lanes_scatter_as_scalar_code_does_to_the_bit() {
    assert_lanes_agree::<DiffuseKind>(BsdfKind::Diffuse, |random| {
        Bsdf::Diffuse(Diffuse { reflectance: random_colour(random) })
    });
    assert_lanes_agree::<DiffuseTransmissionKind>(BsdfKind::DiffuseTransmission, |random| {
        let (reflectance, transmittance) = (random_colour(random) * 0.5, random_colour(random) * 0.5);
        Bsdf::DiffuseTransmission(DiffuseTransmission { reflectance, transmittance })
    });
    assert_lanes_agree::<ConductorKind>(BsdfKind::Conductor, |random| {
        let (eta, k) = (random_colour(random) * 3.0, random_colour(random) * 5.0);
        let k = if random.next_f32() < 0.1 { Spectrum::new(f32::INFINITY, 0.0, 3e4) } else { k };
        Bsdf::Conductor(Conductor { eta, k, facets: random_facets(random) })
    });
    assert_lanes_agree::<DielectricKind>(BsdfKind::Dielectric, |random| {
        let eta = if random.next_f32() < 0.1 { 1.0 } else { 0.4 + 2.0 * random.next_f32() };
        Bsdf::Dielectric(Dielectric { eta, facets: random_facets(random) })
    });
    assert_lanes_agree::<ThinDielectricKind>(BsdfKind::ThinDielectric, |random| {
        Bsdf::ThinDielectric(ThinDielectric { eta: 1.0 + 2.0 * random.next_f32() })
    });
    assert_lanes_agree::<CoatedDiffuseKind>(BsdfKind::CoatedDiffuse, |random| {
        let base = Diffuse { reflectance: random_colour(random) };
        Bsdf::CoatedDiffuse(CoatedDiffuse { base, coat: random_coat(random) })
    });
    assert_lanes_agree::<CoatedConductorKind>(BsdfKind::CoatedConductor, |random| {
        let (eta, k) = (random_colour(random) * 3.0, random_colour(random) * 5.0);
        let base = Conductor { eta, k, facets: random_facets(random) };
        Bsdf::CoatedConductor(CoatedConductor { base, coat: random_coat(random) })
    });
    assert_lanes_agree::<PrincipledKind>(BsdfKind::Principled, |random| {
        Bsdf::Principled(Box::new(random_principled(random)))
    });
    let tables = [measured((0.4, 0.4)), measured((0.2, 0.2)), measured((0.5, 0.25))];
    assert_lanes_agree::<MeasuredKind>(BsdfKind::Measured, |random| {
        Bsdf::Measured(tables[(3.0 * random.next_f32()) as usize].clone())
    });
    assert_lanes_agree::<SubsurfaceKind>(BsdfKind::Subsurface, |random| {
        let face = Dielectric { eta: 1.05 + random.next_f32(), facets: random_facets(random) };
        Bsdf::Subsurface(Subsurface::new(face))
    });
    assert_lanes_agree::<UberKind>(BsdfKind::Uber, |random| {
        let mut part = || {
            let is_there = random.next_f32() < 0.7;
            random_colour(random) * if is_there { 0.3 } else { 0.0 }
        };
        let [diffuse, glossy, mirror, refracted, passed] = std::array::from_fn(|_| part());
        let (x, y) = (random.next_f32(), random.next_f32());
        let facets = Microfacets::new(x * x + 1e-3, y + 1e-3);
        let eta = 0.6 + 1.5 * random.next_f32();
        Bsdf::Uber(Uber { diffuse, glossy, mirror, refracted, passed, eta, facets })
    });
    assert_lanes_agree::<HairKind>(BsdfKind::Hair, |random| {
        let absorption = random_colour(random) * 3.0;
        let [h, beta_m, beta_n] = std::array::from_fn(|_| random.next_f32());
        Bsdf::Hair(Hair::new(absorption, 2.0 * h - 1.0, 1.2 + random.next_f32(), beta_m, beta_n, 4.0 * h))
    });
}

#[test]
fn a_row_that_reaches_beyond_the_table_panics() {
    struct Load(u32);
    impl Job for Load {
        type Output = ();
        #[inline(always)]
        fn run<R: Real>(self) {
            let mut at = [0; 16];
            at[R::LANES - 1] = self.0;
            let bsdf = lanes::ConductorLanes::<R>::load(&[0.5; 8], R::UInt::from_lanes(&at));
            assert!(bsdf.is_delta().none());
        }
    }
    for set in InstructionSet::available() {
        set.run(Load(0));
        assert!(std::panic::catch_unwind(|| set.run(Load(1))).is_err(), "{}", set.name());
    }
}
