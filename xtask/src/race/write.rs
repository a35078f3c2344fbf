//! Scenes as files: meshes (.ply), the sky (.hdr), pbrt-v4 text, and JSON for the scripts of the other programs.

use std::fmt::Write as _;
use std::fs;
use std::path::Path;

use anyhow::Result;
use serde_json::{Value, json};

use super::scene::{Hair, Material, Mesh, Scene, Sky};

/// Writes `scene.pbrt`, `scene.json` and what they name into a folder.
pub(crate) fn write_scene(scene: &Scene, size: u32, folder: &Path) -> Result<()> {
    fs::create_dir_all(folder)?;
    for (i, object) in scene.objects.iter().enumerate() {
        fs::write(folder.join(mesh_name(i)), ply(&object.mesh))?;
    }
    if let Some(sky) = &scene.sky {
        fs::write(folder.join(SKY_NAME), hdr(sky))?;
    }
    if let Some(volume) = &scene.volume {
        fs::write(folder.join(HULL_NAME), ply(&volume.hull()))?;
        let bytes: Vec<u8> = volume.density.iter().flat_map(|density| density.to_le_bytes()).collect();
        fs::write(folder.join(DENSITY_NAME), bytes)?;
    }
    if let Some(hair) = &scene.hair {
        fs::write(folder.join(HAIR_NAME), strands(hair))?;
    }
    fs::write(folder.join("scene.pbrt"), pbrt(scene, size))?;
    fs::write(folder.join("scene.json"), serde_json::to_string_pretty(&description(scene, size))?)?;
    Ok(())
}

const SKY_NAME: &str = "sky.hdr";
const HULL_NAME: &str = "volume.ply";
const DENSITY_NAME: &str = "volume.f32";
const HAIR_NAME: &str = "hair.txt";

fn mesh_name(object: usize) -> String {
    format!("mesh-{object}.ply")
}

fn numbers(values: &[f64]) -> String {
    values.iter().map(f64::to_string).collect::<Vec<_>>().join(" ")
}

/// The scene in the language of pbrt-v4.
pub(crate) fn pbrt(scene: &Scene, size: u32) -> String {
    let camera = &scene.camera;
    // Film and camera of pbrt are left-handed: the mirror makes the picture the one of all other programs.
    let mut out = format!(
        "Film \"rgb\" \"integer xresolution\" {size} \"integer yresolution\" {size} \"string filename\" \"out.pfm\"\n\
         PixelFilter \"box\" \"float xradius\" 0.5 \"float yradius\" 0.5\n\
         Sampler \"zsobol\" \"integer pixelsamples\" 64\n\
         Integrator \"path\" \"integer maxdepth\" {}\n\
         Scale -1 1 1\n\
         LookAt {}  {}  0 1 0\n\
         Camera \"perspective\" \"float fov\" {}\n\
         WorldBegin\n",
        scene.bounces,
        numbers(&camera.eye),
        numbers(&camera.target),
        camera.fov
    );
    if scene.sky.is_some() {
        // Lumbre reads the picture with z up, -x in its middle and +y to the left of it.
        let _ = writeln!(
            out,
            "AttributeBegin\n  ConcatTransform [0 0 1 0  -1 0 0 0  0 1 0 0  0 0 0 1]\n  \
             LightSource \"infinite\" \"string filename\" \"{SKY_NAME}\"\nAttributeEnd"
        );
    }
    if let Some(volume) = &scene.volume {
        let [nx, ny, nz] = volume.cells;
        let scattering = volume.albedo.map(|albedo| volume.extinction * albedo);
        let absorption = volume.albedo.map(|albedo| volume.extinction * (1.0 - albedo));
        let density: Vec<String> = volume.density.iter().map(f32::to_string).collect();
        let _ = writeln!(
            out,
            "MakeNamedMedium \"volume\" \"string type\" \"uniformgrid\" \"integer nx\" {nx} \"integer ny\" {ny} \"integer nz\" {nz}\n  \
             \"point3 p0\" [{}] \"point3 p1\" [{}] \"rgb sigma_s\" [{}] \"rgb sigma_a\" [{}] \"float g\" {}\n  \
             \"float density\" [{}]\n\
             AttributeBegin\n  Material \"interface\"\n  MediumInterface \"volume\" \"\"\n  \
             Shape \"plymesh\" \"string filename\" \"{HULL_NAME}\"\nAttributeEnd",
            numbers(&volume.low),
            numbers(&volume.high),
            numbers(&scattering),
            numbers(&absorption),
            volume.g,
            density.join(" ")
        );
    }
    if let Some(hair) = &scene.hair {
        let [width0, width1] = hair.widths();
        let _ = writeln!(
            out,
            "AttributeBegin\n  Material \"hair\" \"rgb sigma_a\" [{}] \"float beta_m\" {} \"float beta_n\" {} \"float alpha\" {} \"float eta\" {}",
            numbers(&hair.sigma_a),
            hair.beta[0],
            hair.beta[1],
            hair.alpha,
            hair.eta
        );
        for strand in &hair.strands {
            let points: Vec<String> = strand.iter().map(|point| numbers(point)).collect();
            let _ = writeln!(
                out,
                "  Shape \"curve\" \"string type\" \"cylinder\" \"string basis\" \"bspline\" \"float width0\" {width0} \"float width1\" {width1} \"point3 P\" [{}]",
                points.join("  ")
            );
        }
        out.push_str("AttributeEnd\n");
    }
    for (i, material) in scene.materials.iter().enumerate() {
        let parameters = match material {
            Material::Diffuse { reflectance } => {
                format!("\"string type\" \"diffuse\" \"rgb reflectance\" [{}]", numbers(reflectance))
            }
            Material::Metal { reflectance, alpha } => format!(
                "\"string type\" \"conductor\" \"rgb reflectance\" [{}] \"float roughness\" {alpha} \"bool remaproughness\" false",
                numbers(reflectance)
            ),
            Material::Coated { reflectance, eta, alpha } => format!(
                "\"string type\" \"coateddiffuse\" \"rgb reflectance\" [{}] \"float eta\" {eta} \"float roughness\" {alpha} \
                 \"bool remaproughness\" false",
                numbers(reflectance)
            ),
            Material::Glass { eta } => format!("\"string type\" \"dielectric\" \"float eta\" {eta}"),
            Material::Principled { base, metallic, roughness } => format!(
                "\"string type\" \"principled\" \"rgb base_color\" [{}] \"float metallic\" {metallic} \"float roughness\" {roughness}",
                numbers(base)
            ),
        };
        let _ = writeln!(out, "MakeNamedMaterial \"m{i}\" {parameters}");
    }
    for (i, object) in scene.objects.iter().enumerate() {
        let _ = writeln!(out, "AttributeBegin\n  NamedMaterial \"m{}\"", object.material);
        if let Some(radiance) = &object.emission {
            let _ = writeln!(out, "  AreaLightSource \"diffuse\" \"rgb L\" [{}]", numbers(radiance));
        }
        let _ = writeln!(out, "  Shape \"plymesh\" \"string filename\" \"{}\"\nAttributeEnd", mesh_name(i));
    }
    out
}

/// The scene as the scripts read it.
fn description(scene: &Scene, size: u32) -> Value {
    let material = |material: &Material| match material {
        Material::Diffuse { reflectance } => json!({"kind": "diffuse", "reflectance": reflectance}),
        Material::Metal { reflectance, alpha } => {
            json!({"kind": "metal", "reflectance": reflectance, "alpha": alpha})
        }
        Material::Coated { reflectance, eta, alpha } => {
            json!({"kind": "coated", "reflectance": reflectance, "eta": eta, "alpha": alpha})
        }
        Material::Glass { eta } => json!({"kind": "glass", "eta": eta}),
        Material::Principled { base, metallic, roughness } => {
            json!({"kind": "principled", "base": base, "metallic": metallic, "roughness": roughness})
        }
    };
    let objects = scene.objects.iter().enumerate();
    json!({
        "size": size,
        "bounces": scene.bounces,
        "camera": {"eye": scene.camera.eye, "target": scene.camera.target, "fov": scene.camera.fov},
        "materials": scene.materials.iter().map(material).collect::<Vec<_>>(),
        "objects": objects
            .map(|(i, o)| {
                let is_smooth = !o.mesh.normals.is_empty();
                json!({"ply": mesh_name(i), "material": o.material, "emission": o.emission, "smooth": is_smooth})
            })
            .collect::<Vec<_>>(),
        "hair": scene.hair.as_ref().map(|hair| {
            json!({
                "strands": HAIR_NAME,
                "sigma_a": hair.sigma_a,
                "beta": hair.beta,
                "alpha": hair.alpha,
                "eta": hair.eta,
            })
        }),
        "sky": scene.sky.as_ref().map(|_| SKY_NAME),
        "volume": scene.volume.as_ref().map(|volume| {
            json!({
                "hull": HULL_NAME,
                "density": DENSITY_NAME,
                "cells": volume.cells,
                "low": volume.low,
                "high": volume.high,
                "extinction": volume.extinction,
                "albedo": volume.albedo,
                "g": volume.g,
            })
        }),
    })
}

/// Strands as Mitsuba reads them: a control point with its radius a line, and an empty line between strands.
fn strands(hair: &Hair) -> String {
    let mut out = String::new();
    for strand in &hair.strands {
        let steps = (strand.len() - 1) as f64;
        for (i, point) in strand.iter().enumerate() {
            let _ = writeln!(out, "{} {}", numbers(point), hair.radius(i as f64 / steps));
        }
        out.push('\n');
    }
    out
}

/// The mesh as a binary, little-endian .ply.
fn ply(mesh: &Mesh) -> Vec<u8> {
    let normals = ["", "property float nx\nproperty float ny\nproperty float nz\n"];
    let mut out = format!(
        "ply\nformat binary_little_endian 1.0\nelement vertex {}\nproperty float x\nproperty float y\nproperty float z\n{}\
         element face {}\nproperty list uchar int vertex_indices\nend_header\n",
        mesh.points.len(),
        normals[usize::from(!mesh.normals.is_empty())],
        mesh.faces.len()
    )
    .into_bytes();
    for (i, point) in mesh.points.iter().enumerate() {
        let normal = mesh.normals.get(i).into_iter().flatten();
        point.iter().chain(normal).for_each(|x| out.extend(x.to_le_bytes()));
    }
    for face in &mesh.faces {
        out.push(3);
        face.iter().for_each(|i| out.extend(i.to_le_bytes()));
    }
    out
}

/// The sky as a Radiance picture without run lengths: eight bits a channel and an exponent for all three.
fn hdr(sky: &Sky) -> Vec<u8> {
    let mut out =
        format!("#?RADIANCE\nFORMAT=32-bit_rle_rgbe\n\n-Y {} +X {}\n", sky.height, sky.width).into_bytes();
    for pixel in &sky.pixels {
        let largest = pixel.iter().copied().fold(f64::MIN_POSITIVE, f64::max);
        let exponent = largest.log2().floor() as i32 + 1;
        let scale = 256.0 / f64::from(exponent).exp2();
        out.extend(pixel.map(|x| (x * scale) as u8));
        out.push((exponent + 128).clamp(0, 255) as u8);
    }
    out
}
