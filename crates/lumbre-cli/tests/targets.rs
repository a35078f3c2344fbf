//! What a render was asked for and did not reach, or cannot have, is said.

#![allow(clippy::unwrap_used, reason = "tests may panic")]

use std::fs;

use crate::files::{Folder, answer};

#[test]
fn an_instruction_set_that_there_is_not_is_a_usage_error() {
    let folder = Folder::new();
    folder.write("scene.pbrt", "WorldBegin\nShape \"sphere\"\n");
    for (value, status) in [("sse2", 2), ("AVX2", 2), ("neon", 0), ("scalar", 0), ("avx2", 0), ("", 0)] {
        let mut command = folder.command(&["info", "scene.pbrt"]);
        let (found, said) = answer(command.env("LUMBRE_SIMD", value).output().unwrap());
        assert_eq!(found, status, "{value}: {said}");
        let is_said = said.contains(&format!("(found \"{value}\"; expected scalar, neon, avx2 or avx512)"));
        assert_eq!(is_said, status == 2, "{said}");
    }
}

/// A lamp that paths meet now and then, in one of some hundred samples.
const RARE: &str = r#"
Film "rgb" "integer xresolution" 24 "integer yresolution" 18
LookAt 0 -3 1  0 0 .6  0 0 1
Camera "perspective" "float fov" 50
Integrator "path" "integer maxdepth" 4
WorldBegin
AttributeBegin
AreaLightSource "diffuse" "rgb L" [30 28 24]
Translate 0 0 1.6
Shape "sphere" "float radius" .25
AttributeEnd
AttributeBegin
Material "dielectric"
Translate 0 0 1.6
Shape "sphere" "float radius" .4
AttributeEnd
Material "diffuse" "rgb reflectance" [.6 .6 .6]
Shape "disk" "float radius" 8
"#;

#[test]
fn a_missed_noise_target_names_the_option_to_continue() {
    let folder = Folder::new();
    folder.write("scene.pbrt", RARE);
    let run = |more: &str| {
        let fixed = ["render", "scene.pbrt", "-o", "a.pfm", "--stats", "a.json", "--progress", "none"];
        let words: Vec<&str> = fixed.into_iter().chain(more.split_whitespace()).collect();
        let (status, said) = folder.lumbre(&words);
        let stats = fs::read_to_string(folder.path("a.json")).unwrap_or_else(|_| "{}".to_owned());
        let stats: serde_json::Value = serde_json::from_str(&stats).unwrap();
        (status, said, stats)
    };
    let (status, said, stats) = run("--noise 0.02 --spp 32");
    assert_eq!(status, 0, "{said}");
    assert!(said.contains("the target of 0.02 was not met (more --spp goes on)"), "{said}");
    assert_eq!(
        (&stats["noise_target"], &stats["noise_target_met"]),
        (&0.02.into(), &false.into()),
        "{stats}"
    );
    assert!(
        stats["noise"].as_f64().unwrap() > 0.02 && stats["noisy_pixels"].as_u64().unwrap() > 200,
        "{stats}"
    );
    let (_, said, _) = run("--noise 0.001 --time 3s");
    assert!(said.contains("the target of 0.001 was not met (more --time goes on)"), "{said}");
    // Without an end by number or time it is reached, also by more samples than 1024.
    let (_, said, stats) = run("--noise 0.1");
    assert!(!said.contains("target") && stats["noise_target_met"] == true, "{said} {stats}");
    assert!(stats["noise"].as_f64().unwrap() <= 0.1 && stats["most_spp"].as_u64().unwrap() > 1024, "{stats}");
    let (_, _, stats) = run("--noise 0.9 --min-spp 50");
    assert_eq!((&stats["spp"], &stats["noise_target_met"]), (&50.into(), &true.into()), "{stats}");
    let (_, _, stats) = run("--spp 4");
    assert!(stats["noise_target"].is_null() && stats["noise_target_met"].is_null(), "{stats}");
    assert_eq!(run("--min-spp 50").0, 2);
    assert_eq!(run("--noise 0.1 --min-spp 0").0, 2);
}

#[test]
fn light_that_is_brighter_than_a_sum_holds_is_clamped_and_said() {
    let folder = Folder::new();
    for (radiance, is_said) in [("1e11", false), ("1e19", true), ("3e38", true)] {
        let light = format!("LightSource \"infinite\" \"rgb L\" [{radiance} {radiance} {radiance}]\n");
        folder.write(
            "scene.pbrt",
            &(RARE.split("WorldBegin").next().unwrap().to_owned() + "WorldBegin\n" + &light),
        );
        let (status, said) = folder.lumbre(&["render", "scene.pbrt", "-o", "a.pfm", "--spp", "2"]);
        assert_eq!(status, 0, "{said}");
        assert!(!said.contains("not finite"), "{said}");
        assert_eq!(said.contains("864 samples brighter than 5.5e11"), is_said, "{radiance}: {said}");
        let most = lumbre::read_image(&folder.path("a.pfm")).unwrap().pixels()[100].g;
        assert!((1e10..6e11).contains(&most), "{most}");
    }
}
