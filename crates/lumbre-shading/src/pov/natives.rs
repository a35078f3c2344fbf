//! The functions that POV-Ray's `functions.inc` names by number.

use std::f64::consts::{PI, TAU};

use lumbre_math::{DVec3, Elementary};

use super::function::power;
use super::noise::{NoiseGenerator, noise};

/// The names, in the order of their numbers.
pub const NAMES: [&str; 79] = [
    "algbr_cyl1",
    "algbr_cyl2",
    "algbr_cyl3",
    "algbr_cyl4",
    "bicorn",
    "bifolia",
    "blob",
    "blob2",
    "boy_surface",
    "comma",
    "cross_ellipsoids",
    "crossed_trough",
    "cubic_saddle",
    "cushion",
    "devils_curve",
    "devils_curve_2d",
    "dupin_cyclid",
    "ellipsoid",
    "enneper",
    "flange_cover",
    "folium_surface",
    "folium_surface_2d",
    "glob",
    "heart",
    "helical_torus",
    "helix1",
    "helix2",
    "hex_x",
    "hex_y",
    "hetero_mf",
    "hunt_surface",
    "hyperbolic_torus",
    "isect_ellipsoids",
    "kampyle_of_eudoxus",
    "kampyle_of_eudoxus_2d",
    "klein_bottle",
    "kummer_surface_v1",
    "kummer_surface_v2",
    "lemniscate_of_gerono",
    "lemniscate_of_gerono_2d",
    "mesh1",
    "mitre",
    "nodal_cubic",
    "odd",
    "ovals_of_cassini",
    "paraboloid",
    "parabolic_torus",
    "ph",
    "pillow",
    "piriform",
    "piriform_2d",
    "poly4",
    "polytubes",
    "quantum",
    "quartic_paraboloid",
    "quartic_saddle",
    "quartic_cylinder",
    "r",
    "ridge",
    "ridged_mf",
    "rounded_box",
    "sphere",
    "spikes",
    "spikes_2d",
    "spiral",
    "steiners_roman",
    "strophoid",
    "strophoid_2d",
    "superellipsoid",
    "th",
    "torus",
    "torus2",
    "torus_gumdrop",
    "umbrella",
    "witch_of_agnesi",
    "witch_of_agnesi_2d",
    "noise3d",
    "pattern",
    "noise_generator",
];

/// Functions that are not implemented.
pub const MISSING: [&str; 6] = ["comma", "enneper", "helical_torus", "hex_x", "hex_y", "mesh1"];

/// Whether the function of a number is here.
pub fn is_known(index: u32) -> bool {
    NAMES
        .get(index as usize)
        .is_some_and(|name| !MISSING.contains(name) && *name != "spiral" && *name != "pattern")
}

/// The value of the function of a number; 0 for functions that are not implemented.
pub fn value(index: u32, arguments: &[f64]) -> f64 {
    let at = |i: usize| arguments.get(i).copied().unwrap_or(0.0);
    let p = DVec3::new(at(0), at(1), at(2));
    let parameter = |i: usize| at(3 + i);
    let Some(&name) = NAMES.get(index as usize) else { return 0.0 };
    if let Some(g) = surface(name, p, [1, 2, 3, 4, 5].map(parameter)) {
        return (-parameter(0) * g).clamp(-10.0, 10.0);
    }
    if let Some(value) = flat(name, p, &arguments[3.min(arguments.len())..]) {
        return value;
    }
    whole(name, p, &parameter)
}

/// The polynomials of surfaces, by the squares X, Y, Z of the coordinates and the parameters after the first.
fn surface(name: &str, p: DVec3, [a, b, c, d, f]: [f64; 5]) -> Option<f64> {
    let DVec3 { x, y, z } = p;
    let (xx, yy, zz) = (x * x, y * y, z * z);
    let sum = xx + yy + zz;
    let square = |v: f64| v * v;
    let (aa, bb) = (a * a, b * b);
    Some(match name {
        "bicorn" => square(xx + zz + 2.0 * a * y - aa) - yy * (aa - xx - zz),
        "bifolia" => square(sum) - a * (xx + zz) * y,
        "crossed_trough" => y - xx * zz,
        "cubic_saddle" => x.powi(3) - y.powi(3) - z,
        "cushion" => {
            zz * zz - xx * zz + 2.0 * z * xx - 2.0 * z * zz - xx
                + zz
                + square(xx - z)
                + yy * yy
                + 2.0 * xx * yy
                + yy * zz
                - 2.0 * yy * z
                - yy
        }
        "devils_curve" => xx * xx + 2.0 * xx * zz - 0.36 * xx - yy * yy + 0.25 * yy + zz * zz,
        "folium_surface" => -((yy + zz) * (1.0 + (b - 4.0 * a) * x) + xx * (1.0 + b)),
        "glob" => yy + zz - 0.5 * x.powi(5) - 0.5 * x.powi(4),
        "heart" => (2.0 * xx + yy + zz - 1.0).powi(3) - 0.1 * xx * z.powi(3) - yy * z.powi(3),
        "hunt_surface" => 4.0 * (sum - 13.0).powi(3) + 27.0 * square(3.0 * xx + yy - 4.0 * zz - 12.0),
        "hyperbolic_torus" => {
            xx * xx + 2.0 * xx * yy - 2.0 * xx * zz - 2.0 * xx * (aa + bb) + yy * yy - 2.0 * yy * zz
                + 2.0 * (aa - bb) * yy
                + zz * zz
                + 2.0 * (aa + bb) * zz
                + square(aa - bb)
        }
        "kampyle_of_eudoxus" => yy + zz - bb * xx * xx + bb * aa * xx,
        "klein_bottle" => {
            let (plus, minus) = (sum + 2.0 * y - 1.0, sum - 2.0 * y - 1.0);
            plus * (minus * minus - 8.0 * zz) + 16.0 * x * z * minus
        }
        "kummer_surface_v1" => xx * xx + yy * yy + zz * zz - sum - xx * yy - xx * zz - yy * zz + 1.0,
        "kummer_surface_v2" => {
            xx * xx + yy * yy + zz * zz + a * sum + b * (xx * yy + xx * zz + yy * zz) + c * x * y * z - 1.0
        }
        "lemniscate_of_gerono" => xx * xx - xx + yy + zz,
        "mitre" => 4.0 * xx * sum - yy * (1.0 - yy - zz),
        "nodal_cubic" => y.powi(3) + z.powi(3) - 6.0 * y * z,
        "odd" => {
            zz * zz - xx * zz + 2.0 * z * xx - 2.0 * z * zz - xx
                + zz
                + square(xx - z)
                + yy * yy
                + 2.0 * xx * yy
                + yy * zz
                - 2.0 * yy * z
                - yy
        }
        "ovals_of_cassini" => square(sum + aa) - c * aa * (xx + zz) - bb,
        "paraboloid" => xx - y + zz,
        "parabolic_torus" => {
            xx * xx + 2.0 * xx * yy - 2.0 * xx * z - (aa + bb) * xx + yy * yy - 2.0 * yy * z
                + (aa - bb) * yy
                + zz
                + (aa + bb) * z
                + square(aa - bb)
        }
        "pillow" => sum - xx * xx - yy * yy - zz * zz,
        "piriform" => -(xx * xx - x.powi(3) + yy + zz),
        "quartic_paraboloid" => xx * xx + zz * zz - y,
        "quartic_saddle" => xx * xx - zz * zz - y,
        "quartic_cylinder" => (xx + zz) * yy + bb * (xx + zz) - aa * bb,
        "steiners_roman" => xx * yy + xx * zz + yy * zz + x * y * z,
        "strophoid" => (b - x) * (yy + zz) - c * c * a * xx - c * c * x.powi(3),
        "torus2" => square(sum) - 2.0 * (aa + bb) * (xx + zz) + 2.0 * (aa - bb) * yy + square(aa - bb),
        "torus_gumdrop" => 4.0 * (xx * xx + square(yy + zz)) + 17.0 * xx * (yy + zz) - 20.0 * sum + 17.0,
        "umbrella" => xx - yy * z,
        "witch_of_agnesi" => a * (y - 1.0) + (xx + zz) * y,
        "boy_surface" => -a * boy(x, y, z),
        "dupin_cyclid" => cyclide(p, [a, b, c, d, f]),
        _ => return None,
    })
}

fn boy(x: f64, y: f64, z: f64) -> f64 {
    let (xx, yy, zz) = (x * x, y * y, z * z);
    let rest = 1.0 - z;
    let root = std::f64::consts::SQRT_2;
    64.0 * rest.powi(3) * z.powi(3) - 48.0 * rest * rest * zz * (3.0 * xx + 3.0 * yy + 2.0 * zz)
        + 12.0
            * rest
            * z
            * (27.0 * (xx + yy).powi(2) - 24.0 * zz * (xx + yy)
                + 36.0 * root * y * z * (yy - 3.0 * xx)
                + 4.0 * zz * zz)
        + (9.0 * xx + 9.0 * yy - 2.0 * zz)
            * (-81.0 * (xx + yy).powi(2) - 72.0 * zz * (xx + yy)
                + 108.0 * root * x * z * (xx - 3.0 * yy)
                + 4.0 * zz * zz)
}

fn cyclide(p: DVec3, [a, b, c, d, f]: [f64; 5]) -> f64 {
    let DVec3 { x, y, z: _ } = p;
    let sum = p.length_squared();
    let (q1, q2) = (b * b - d * d - (c + a).powi(2), b * b - d * d - (c - a).powi(2));
    let inner = b * b - d * d - c * c + a * a;
    q1 * q2 * sum * sum
        + 2.0 * f * f * (inner * (2.0 * x * c + 2.0 * y * d - f * f) - 4.0 * d * b * b * y) * sum
        + 4.0 * f.powi(4) * (c * x + d * y) * (c * x + d * y - f * f)
        + 4.0 * f.powi(4) * a * a * y * y
        + f.powi(8)
}

/// Curves of a plane, swept along z or bent about y by the last three parameters.
fn flat(name: &str, p: DVec3, parameters: &[f64]) -> Option<f64> {
    let last = parameters.len().checked_sub(3)?;
    let [sweep, extent, turn] = [parameters[last], parameters[last + 1], parameters[last + 2]];
    let at = |i: usize| parameters.get(i).copied().unwrap_or(0.0);
    let (u, v) = if sweep > 0.0 {
        let u = p.x.hypotenuse(p.z) - extent;
        let (sine, cosine) = turn.to_radians().sine_cosine();
        (u * cosine - p.y * sine, u * sine + p.y * cosine)
    } else {
        (p.x, p.y)
    };
    let (uu, vv) = (u * u, v * v);
    let [a, b, c] = [at(1), at(2), at(3)];
    let curve = match name {
        "devils_curve_2d" => uu * (uu - a * a) - vv * (vv - b * b),
        "folium_surface_2d" => vv * (1.0 + (b - 4.0 * a) * u) + uu * (1.0 + b),
        "kampyle_of_eudoxus_2d" => vv - b * b * uu * uu + a * b.powi(3) * uu,
        "lemniscate_of_gerono_2d" => vv - a * a * b * b * uu + b * b * uu * uu,
        "piriform_2d" => vv - a * c * c * u.powi(3) - b * c * c * uu * uu,
        "strophoid_2d" => (b - u) * vv - c * c * a * uu - c * c * u.powi(3),
        "witch_of_agnesi_2d" => a * a * v + uu * v - b,
        "algbr_cyl1" => {
            let g = u.abs() * uu - uu + vv;
            return Some((at(0) * g).clamp(-at(1), at(1).max(-at(1))));
        }
        "algbr_cyl2" => {
            return Some(limited(at(0), at(1), 2.0 * uu * uu - 3.0 * uu * v + vv - 2.0 * vv * v + vv * vv));
        }
        "algbr_cyl3" => return Some(limited(at(0), at(1), uu * uu + uu * vv - 2.0 * uu * v - u * vv + vv)),
        "algbr_cyl4" => {
            return Some(limited(at(0), at(1), uu * uu + vv * vv + 2.0 * uu * vv + 3.0 * uu * v - vv * v));
        }
        _ => return None,
    };
    Some((-at(0) * curve).clamp(-10.0, 10.0))
}

fn limited(strength: f64, limit: f64, g: f64) -> f64 {
    let limit = limit.abs();
    (-strength * g).clamp(-limit, limit)
}

/// The functions that are given whole.
fn whole(name: &str, p: DVec3, at: &dyn Fn(usize) -> f64) -> f64 {
    let DVec3 { x, y, z } = p;
    let (xx, yy, zz) = (x * x, y * y, z * z);
    let sum = xx + yy + zz;
    let [a, b, c, d, f] = [at(0), at(1), at(2), at(3), at(4)];
    let bump = |fx: f64, fy: f64, fz: f64| (-b * (fx * xx + fy * yy + fz * zz)).exponential();
    let bumps = || [bump(a, a, 1.0), bump(a, 1.0, a), bump(1.0, a, a)];
    match name {
        "blob" => {
            let ball = |offset: f64, scale: f64| {
                let x = x + offset;
                (1.0 - (x * x + yy + zz) * scale * scale).max(0.0).powi(2)
            };
            -(b * ball(0.5 * a, c) + d * ball(-0.5 * a, f))
        }
        "blob2" => {
            let far = (x - a) * (x - a);
            d - c * ((-b * sum).exponential() + (-b * (far + yy + zz)).exponential())
        }
        "cross_ellipsoids" => d - c * bumps().into_iter().fold(0.0, f64::max),
        "flange_cover" => d - c * bumps().into_iter().sum::<f64>(),
        "isect_ellipsoids" => d - c * bumps().into_iter().fold(f64::INFINITY, f64::min),
        "spikes" => -c * (f * (-d * sum).exponential() - bumps().into_iter().sum::<f64>()),
        "spikes_2d" => y - a * (b * x).cosine() * (c * z).cosine() * (-d * (xx + zz)).exponential(),
        "poly4" => x.hypotenuse(z) - (a + b * y + c * yy + d * y.powi(3) + f * y.powi(4)).max(-5.0),
        "polytubes" => tubes(p, [a, b, c, d, f, at(5)]),
        "quantum" => {
            let r = sum.sqrt();
            let wave = 4.0 * sum * (-2.0 * r * 0.333_333_33).exponential() * (3.0 * yy / sum - 1.0);
            1.2 - 0.1 * wave * wave
        }
        "ellipsoid" => (xx * a * a + yy * b * b + zz * c * c).sqrt(),
        "sphere" => sum.sqrt() - a,
        "r" => sum.sqrt(),
        "th" => x.angle_from(z),
        "ph" => x.hypotenuse(z).angle_from(y),
        "torus" => (x.hypotenuse(z) - a).hypotenuse(y) - b,
        "rounded_box" => {
            let outside = (p.abs() - DVec3::new(b, c, d) + DVec3::splat(a)).max(DVec3::ZERO);
            outside.length() - a - 1e-6
        }
        "superellipsoid" => {
            let (e, n) = (a, b);
            let across = power(x.abs(), 2.0 / e) + power(y.abs(), 2.0 / e);
            1.0 - power(power(across, e / n) + power(z.abs(), 2.0 / n), 0.5 * n)
        }
        "helix1" => helix(p, [a, b, c, d, f, at(5), at(6)]),
        "helix2" => helix2(p, [a, b, c, d, f, at(5), at(6)]),
        "ridged_mf" => ridged(p, [a, b, c, d, f, at(5)]),
        "hetero_mf" => hetero(p, [a, b, c, d, f, at(5)]),
        "ridge" => ridge(p, [a, b, c, d, f, at(5)]),
        "noise3d" => noise(p, NoiseGenerator::Corrected),
        "noise_generator" => noise(p, generator(a)),
        _ => 0.0,
    }
}

fn generator(number: f64) -> NoiseGenerator {
    match number as i64 {
        1 => NoiseGenerator::Original,
        3 => NoiseGenerator::Perlin,
        _ => NoiseGenerator::Corrected,
    }
}

fn tubes(p: DVec3, [count, b, c, d, f, g]: [f64; 6]) -> f64 {
    let y = p.y;
    let radius = b + c * y + d * y * y + f * y.powi(3) + g * y.powi(4);
    let tube = |i: u32| {
        let (sine, cosine) = (TAU * f64::from(i) / count).sine_cosine();
        (p.x - radius * cosine).hypotenuse(p.z - radius * sine)
    };
    (0..count.clamp(1.0, 1000.0) as u32).map(tube).fold(f64::INFINITY, f64::min)
}

/// The distance from the middle of a section with rounded corners.
fn section(x: f64, z: f64, corner: f64, degrees: f64) -> f64 {
    if corner == 1.0 {
        return x.hypotenuse(z);
    }
    let (sine, cosine) = degrees.to_radians().sine_cosine();
    let (x, z) = ((x * cosine - z * sine).abs(), (x * sine + z * cosine).abs());
    if corner == 0.0 {
        x.max(z)
    } else {
        power(power(x, 2.0 / corner) + power(z, 2.0 / corner), 0.5 * corner)
    }
}

fn helix(p: DVec3, [n, f, r, major, s, corner, degrees]: [f64; 7]) -> f64 {
    let across = p.x.hypotenuse(p.z);
    let t = (n * p.z.angle_from(p.x) + n * f * p.y).rem_euclid(TAU);
    let m = section(across - major, (t - PI) / (s * f * n), corner, degrees);
    (major + across).min(m) - r
}

fn helix2(p: DVec3, [_, f, r, major, _, corner, degrees]: [f64; 7]) -> f64 {
    let (sine, cosine) = (f * p.y).sine_cosine();
    let (x, z) = (p.x - major * cosine, p.z - major * sine);
    section(x * cosine + z * sine, z * cosine - x * sine, corner, degrees) - r
}

fn ridged(p: DVec3, [h, lacunarity, octaves, offset, gain, g]: [f64; 6]) -> f64 {
    let generator = generator(g);
    let signal = |p: DVec3| (offset - (2.0 * noise(p, generator) - 1.0).abs()).powi(2);
    let (mut p, mut s) = (p, signal(p));
    let mut sum = s;
    for i in 1..octaves.clamp(1.0, 64.0) as i32 {
        p *= lacunarity;
        let weight = (s * gain).clamp(0.0, 1.0);
        s = weight * signal(p);
        sum += s * lacunarity.power(-f64::from(i) * h);
    }
    sum
}

fn hetero(p: DVec3, [h, lacunarity, octaves, offset, t, g]: [f64; 6]) -> f64 {
    let generator = generator(g);
    let signal = |p: DVec3| 2.0 * noise(p, generator) - 1.0 + offset;
    let (mut p, mut value) = (p, signal(p));
    let octaves = octaves.clamp(1.0, 64.0);
    let mut i = 1;
    p *= lacunarity;
    while f64::from(i) < octaves.floor() {
        value += signal(p) * lacunarity.power(-f64::from(i) * h) * power_of(value, t);
        p *= lacunarity;
        i += 1;
    }
    let rest = octaves - octaves.floor();
    if rest > 0.0 {
        let increment = signal(p) * lacunarity.power(-f64::from(i) * h) * power_of(value, t);
        value += rest * increment;
    }
    value
}

fn power_of(value: f64, exponent: f64) -> f64 {
    power(value, exponent)
}

fn ridge(p: DVec3, [lambda, octaves, omega, offset, ridge, g]: [f64; 6]) -> f64 {
    let generator = generator(g);
    let (mut p, mut amplitude, mut sum, mut total) = (p, 1.0, 0.0, 0.0);
    for _ in 0..octaves.clamp(1.0, 64.0) as u32 {
        let folded = (noise(p, generator) - ridge).abs() / ridge.max(1.0 - ridge);
        sum += amplitude * (folded - offset);
        total += amplitude;
        amplitude *= omega;
        p *= lambda;
    }
    sum / (total * offset.max(1.0 - offset))
}
