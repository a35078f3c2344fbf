//! The mesh, textures and environment of scenes/mesh, made from formulas.

use std::f64::consts::{PI, TAU};
use std::fs;
use std::io::Write;

use anyhow::Result;
use lumbre::image::{Image, Rgb};
use xtask::command::root;

/// Writes every generated file under scenes/.
pub(crate) fn write() -> Result<()> {
    let folder = root().join("scenes").join("mesh").join("parts");
    fs::create_dir_all(&folder)?;
    fs::write(folder.join("vase.ply"), vase()?)?;
    let save = |name: &str, image: &Image| {
        lumbre::write_image(&folder.join(name), image, &lumbre::SaveOptions::default())
    };
    save("tiles.png", &picture(512, 512, tile_colour))?;
    // A normal map holds numbers, not light: the file's transfer function must give back what is stored.
    save("tiles-normal.png", &picture(512, 512, |u, v| tile_normal(u, v).map(decode_srgb)))?;
    save("dusk.hdr", &picture(256, 128, dusk))?;
    Ok(())
}

fn decode_srgb(encoded: f32) -> f32 {
    if encoded <= 0.04045 { encoded / 12.92 } else { ((encoded + 0.055) / 1.055).powf(2.4) }
}

/// An image of a function of (u, v), the origin at the lower left.
fn picture(width: u32, height: u32, at: impl Fn(f64, f64) -> Rgb) -> Image {
    let pixel = |i: u32| {
        let (x, y) = (i % width, i / width);
        at((f64::from(x) + 0.5) / f64::from(width), 1.0 - (f64::from(y) + 0.5) / f64::from(height))
    };
    Image::from_pixels(width, height, (0..width * height).map(pixel).collect())
        .expect("as many pixels as the image has")
}

/// Radius and height of the vase's outline, from the foot over the lip to the inside.
const OUTLINE: [(f64, f64); 15] = [
    (0.0, 0.0),
    (0.42, 0.0),
    (0.5, 0.03),
    (0.47, 0.12),
    (0.62, 0.35),
    (0.86, 0.75),
    (0.9, 1.1),
    (0.72, 1.5),
    (0.42, 1.8),
    (0.34, 2.02),
    (0.42, 2.25),
    (0.5, 2.32),
    (0.46, 2.34),
    (0.3, 2.02),
    (0.3, 1.8),
];

/// A point of the outline by a Catmull–Rom spline, `s` in [0, 1].
fn outline(s: f64) -> (f64, f64) {
    let last = OUTLINE.len() - 1;
    let x = s * last as f64;
    let i = (x as usize).min(last - 1);
    let f = x - i as f64;
    let point = |k: isize| OUTLINE[(i as isize + k).clamp(0, last as isize) as usize];
    let spline = |a: f64, b: f64, c: f64, d: f64| {
        0.5 * (2.0 * b
            + (c - a) * f
            + (2.0 * a - 5.0 * b + 4.0 * c - d) * f * f
            + (3.0 * b - a - 3.0 * c + d) * f * f * f)
    };
    let (a, b, c, d) = (point(-1), point(0), point(1), point(2));
    (spline(a.0, b.0, c.0, d.0).max(0.0), spline(a.1, b.1, c.1, d.1))
}

/// The vase as a binary PLY of quads with normals and texture coordinates.
fn vase() -> Result<Vec<u8>> {
    const AROUND: u32 = 96;
    const ALONG: u32 = 112;
    let mut out = Vec::new();
    write!(
        out,
        "ply\nformat binary_little_endian 1.0\ncomment a vase, made by cargo xtask assets\nelement vertex {}\n",
        (AROUND + 1) * (ALONG + 1)
    )?;
    for property in ["x", "y", "z", "nx", "ny", "nz", "u", "v"] {
        writeln!(out, "property float {property}")?;
    }
    write!(out, "element face {}\nproperty list uchar int vertex_indices\nend_header\n", AROUND * ALONG)?;
    for j in 0..=ALONG {
        let s = f64::from(j) / f64::from(ALONG);
        let (radius, height) = outline(s);
        let (before, after) = (outline((s - 1e-4).max(0.0)), outline((s + 1e-4).min(1.0)));
        let (dr, dz) = (after.0 - before.0, after.1 - before.1);
        let length = dr.hypot(dz);
        for i in 0..=AROUND {
            let u = f64::from(i) / f64::from(AROUND);
            let (sin, cos) = (u * TAU).sin_cos();
            let (nr, nz) = (dz / length, -dr / length);
            for value in [radius * cos, radius * sin, height, nr * cos, nr * sin, nz, 4.0 * u, 2.5 * s] {
                out.extend((value as f32).to_le_bytes());
            }
        }
    }
    for j in 0..ALONG {
        for i in 0..AROUND {
            let at = |di: u32, dj: u32| ((j + dj) * (AROUND + 1) + i + di) as i32;
            out.push(4);
            for corner in [at(0, 0), at(1, 0), at(1, 1), at(0, 1)] {
                out.extend(corner.to_le_bytes());
            }
        }
    }
    Ok(out)
}

/// How much of each ink lies at a point of a tile: blue, ochre.
fn inks(u: f64, v: f64) -> (f64, f64) {
    let (x, y) = (2.0 * u.fract() - 1.0, 2.0 * v.fract() - 1.0);
    let (r, angle) = (x.hypot(y), y.atan2(x));
    let edge = |distance: f64| (0.5 - distance / 0.02).clamp(0.0, 1.0);
    let petals = edge(r - 0.62 * (0.45 + 0.55 * (4.0 * angle).cos().abs()));
    let heart = edge(r - 0.2);
    let ring = edge((r - 0.8).abs() - 0.035);
    let corner = edge(0.36 - (1.0 - x.abs()).hypot(1.0 - y.abs())).min(1.0);
    let border = edge(x.abs().max(y.abs()).mul_add(-1.0, 0.955));
    let corners = 1.0 - corner;
    ((petals * (1.0 - heart)).max(ring).max(border), heart.max(corners * (1.0 - border)))
}

fn tile_colour(u: f64, v: f64) -> Rgb {
    let (blue, ochre) = inks(u, v);
    Rgb::new(0.8, 0.77, 0.69)
        .lerp(Rgb::new(0.82, 0.42, 0.07), ochre as f32)
        .lerp(Rgb::new(0.03, 0.11, 0.36), blue as f32)
}

/// A glaze that stands a little proud where there is ink, as a tangent-space normal in [0, 1].
fn tile_normal(u: f64, v: f64) -> Rgb {
    let height = |u: f64, v: f64| {
        let (blue, ochre) = inks(u.rem_euclid(1.0), v.rem_euclid(1.0));
        0.004 * (blue + ochre)
    };
    let step = 1.0 / 256.0;
    let du = (height(u + step, v) - height(u - step, v)) / (2.0 * step);
    let dv = (height(u, v + step) - height(u, v - step)) / (2.0 * step);
    let length = (du * du + dv * dv + 1.0).sqrt();
    Rgb::new((0.5 - 0.5 * du / length) as f32, (0.5 - 0.5 * dv / length) as f32, (0.5 + 0.5 / length) as f32)
}

/// The sky at dusk by longitude `u` and latitude `v` (0 straight down): a low sun, a warm horizon, a dark ground.
fn dusk(u: f64, v: f64) -> Rgb {
    let elevation = (v - 0.5) * PI;
    let azimuth = (u - 0.32) * TAU;
    let cosine = elevation.cos() * azimuth.cos() * 0.24f64.cos() + elevation.sin() * 0.24f64.sin();
    let from_sun = cosine.clamp(-1.0, 1.0).acos();
    let up = elevation.sin();
    let horizon = (-(up.max(0.0) * 5.0)).exp();
    let warm = (-from_sun * 1.3).exp();
    let sky =
        Rgb::new(0.24, 0.42, 0.85).lerp(Rgb::new(1.9, 0.85, 0.34), (horizon * (0.35 + 0.65 * warm)) as f32);
    let glow = Rgb::new(5.0, 2.6, 1.1) * (-(from_sun / 0.16).powi(2)).exp() as f32;
    let sun = Rgb::new(420.0, 290.0, 160.0) * if from_sun < 0.045 { 1.0 } else { 0.0 };
    let ground = Rgb::new(0.07, 0.055, 0.045);
    if up > 0.0 { sky + glow + sun } else { ground }
}
