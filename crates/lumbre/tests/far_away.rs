//! A scene far from the origin is the same picture as at the origin, up to the rounding of where its parts stand.

#![allow(clippy::unwrap_used, reason = "tests may panic")]

use lumbre::Scene;
use lumbre::formats::{Budget, Diagnostics, Limits, pbrt};
use lumbre::image::Image;

fn picture(text: &str) -> Image {
    let mut diagnostics = Diagnostics::new();
    let budget = Budget::new(Limits::default());
    let desc = pbrt::read_bytes("far.pbrt", text.as_bytes(), None, &budget, &mut diagnostics).unwrap();
    assert_eq!(diagnostics.lines(), Vec::<String>::new());
    let scene = Scene::from_description(desc).unwrap();
    let picture = scene.render(&scene.options()).unwrap();
    assert_eq!(picture.stats().dropped, 0);
    picture.image().clone()
}

fn scene([x, y, z]: [f64; 3]) -> Image {
    picture(&format!(
        r#"Film "rgb" "integer xresolution" 48 "integer yresolution" 36
        Sampler "sobol" "integer pixelsamples" 16
        PixelFilter "box"
        LookAt {} {} {}  {x} {y} {}  0 0 1
        Camera "perspective" "float fov" 45
        WorldBegin
        Translate {x} {y} {z}
        LightSource "infinite" "rgb L" [0.3 0.4 0.5]
        LightSource "point" "point3 from" [2 -3 5] "rgb I" [30 28 25]
        AttributeBegin
          AreaLightSource "diffuse" "rgb L" [4 4 4]
          Shape "sphere" "point3 center" [-3 1 4] "float radius" 0.5
        AttributeEnd
        Material "diffuse" "rgb reflectance" [0.7 0.4 0.2]
        Shape "disk" "float radius" 6
        Shape "torus" "point3 center" [0 0 1] "float majorradius" 1.5
        Shape "box" "point3 p0" [-3 -2 0] "point3 p1" [-2 -1 1.25]
        Shape "cone" "point3 p0" [2 2 0] "point3 p1" [2 2 2] "float radius" 0.75 "bool caps" true
        Material "dielectric"
        Shape "sphere" "point3 center" [1.5 -2 0.75] "float radius" 0.75
        Material "conductor" "float roughness" 0.1
        Shape "trianglemesh" "integer indices" [0 1 2 0 2 3]
          "point3 P" [-2.5 3 0 2.5 3 0 2.5 3.5 3 -2.5 3.5 3]
        Shape "bilinearmesh" "point3 P" [2.5 -3 0 4 -3 0.5 2.5 -1 1 4 -1 0]"#,
        x + 1.0,
        y - 9.0,
        z + 5.0,
        z + 0.75
    ))
}

/// The share of pixels that differ by more than 1 %, and the largest difference of the channels' means.
fn difference(a: &Image, b: &Image) -> (f64, f64) {
    let mut other = 0;
    let mut sums = [[0.0; 3]; 2];
    for (p, q) in a.pixels().iter().zip(b.pixels()) {
        let (p, q) = (p.to_array(), q.to_array());
        other += usize::from((0..3).any(|c| (p[c] - q[c]).abs() > 0.01 * (p[c].abs() + q[c].abs() + 0.01)));
        for c in 0..3 {
            sums[0][c] += f64::from(p[c]);
            sums[1][c] += f64::from(q[c]);
        }
    }
    let means = (0..3).map(|c| (sums[1][c] / sums[0][c] - 1.0).abs()).fold(0.0, f64::max);
    (other as f64 / a.pixels().len() as f64, means)
}

#[test]
fn a_scene_far_away_is_the_picture_of_the_scene_at_the_origin() {
    let near = scene([0.0; 3]);
    let brightest = near.pixels().iter().map(|p| p.max_component()).fold(0.0, f32::max);
    assert!(brightest > 0.5, "{brightest}");
    // Whole numbers stay what they are after the move: only roundings of hits differ, and the paths that they part.
    for (at, share, mean) in [([1e5, -2e5, 3e5], 0.02, 2e-3), ([-1e6, 2e6, 1e6], 0.05, 4e-3)] {
        let (other, means) = difference(&near, &scene(at));
        println!("{at:?}: {other} of the pixels, {means} of the mean");
        assert!(other <= share && means <= mean, "{at:?}: {other} of the pixels, {means} of the mean");
    }
}
