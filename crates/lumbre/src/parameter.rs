//! The parameters of a description that a [`crate::Setting`] can set.

use lumbre_image::Rgb;
use lumbre_math::{DVec3, Transform};
use lumbre_scene::{LightDesc, SceneDesc};
use lumbre_shading::Texture;

use crate::setting::{Range, Slot, each_material_slot};

/// A parameter of a description.
#[derive(Clone, Debug, PartialEq)]
#[non_exhaustive]
pub struct Parameter {
    /// The part of a setting before its `=`.
    pub path: String,
    /// Its owner, for display: `material Wood (principled)`.
    pub owner: String,
    /// The last word of the path.
    pub name: String,
    /// The values that it takes.
    pub kind: ParameterKind,
    /// Its value: one number, or three of a colour or a point; `None` for a texture.
    pub value: Option<Vec<f64>>,
}

/// The values that a [`Parameter`] takes.
#[derive(Clone, Copy, Debug, PartialEq)]
#[non_exhaustive]
pub enum ParameterKind {
    /// A number within these ends, both included.
    Number {
        /// The least.
        low: f64,
        /// The greatest; infinite if there is none.
        high: f64,
    },
    /// A linear colour in [0, 1].
    Colour,
    /// A linear colour from 0 up.
    Light,
    /// A point.
    Point,
    /// A factor from 0 up on the value of the file.
    Factor,
}

/// The parameters of materials that are used or named, and of lights, each once, without aliases.
pub fn parameters(desc: &SceneDesc) -> Vec<Parameter> {
    let mut all = Vec::new();
    for (index, material) in desc.materials.iter().enumerate() {
        let used = |shape: &lumbre_scene::ShapeDesc| shape.material.is_some_and(|id| id.0 as usize == index);
        let in_objects = desc.objects.iter().flat_map(|object| &object.shapes);
        if material.name.is_none() && !desc.shapes.iter().chain(in_objects).any(used) {
            continue;
        }
        let mut kind = material.material.kind.clone();
        let called = material.name.clone().unwrap_or_else(|| index.to_string());
        let owner = format!("material {called} ({})", kind.name());
        each_material_slot(&mut kind, &mut |names, slot| {
            let name = names[0];
            // `roughness` sets both.
            if matches!(name, "uroughness" | "vroughness") {
                return;
            }
            let (kind, value) = described(slot);
            let path = format!("material.{called}.{name}");
            all.push(Parameter { path, owner: owner.clone(), name: name.to_owned(), kind, value });
        });
    }
    for (index, light) in desc.lights.iter().enumerate() {
        let mut light = light;
        while let LightDesc::Moving { light: inner, .. } | LightDesc::Spectral { light: inner, .. } = light {
            light = inner;
        }
        let mut add = |kind_name: &str, name: &str, kind, value| {
            let owner = format!("light {index} ({kind_name})");
            let path = format!("light.{index}.{name}");
            all.push(Parameter { path, owner, name: name.to_owned(), kind, value: Some(value) });
        };
        match light {
            LightDesc::Point { from, intensity } => {
                add("point", "intensity", ParameterKind::Light, numbers(*intensity));
                add("point", "from", ParameterKind::Point, point(*from));
            }
            LightDesc::Spot { world_from_light, intensity, .. } => {
                add("spot", "intensity", ParameterKind::Light, numbers(*intensity));
                add("spot", "from", ParameterKind::Point, origin(world_from_light));
            }
            LightDesc::Goniometric { world_from_light, intensity, .. } => {
                add("goniometric", "intensity", ParameterKind::Light, numbers(*intensity));
                add("goniometric", "from", ParameterKind::Point, origin(world_from_light));
            }
            LightDesc::Projection { world_from_light, intensity, .. } => {
                add("projection", "intensity", ParameterKind::Light, numbers(*intensity));
                add("projection", "from", ParameterKind::Point, origin(world_from_light));
            }
            LightDesc::Distant { irradiance, .. } | LightDesc::Disc { irradiance, .. } => {
                add("distant", "irradiance", ParameterKind::Light, numbers(*irradiance));
            }
            LightDesc::Infinite { radiance, .. } | LightDesc::Portal { radiance, .. } => {
                add("infinite", "radiance", ParameterKind::Light, numbers(*radiance));
            }
            LightDesc::Pov(_) | LightDesc::Moving { .. } | LightDesc::Spectral { .. } => {}
        }
    }
    let in_objects = desc.objects.iter().flat_map(|object| &object.shapes);
    if desc.shapes.iter().chain(in_objects).any(|shape| shape.area_light.is_some()) {
        all.push(Parameter {
            path: "light.area.scale".to_owned(),
            owner: "shapes that shine".to_owned(),
            name: "scale".to_owned(),
            kind: ParameterKind::Factor,
            value: Some(vec![1.0]),
        });
    }
    all
}

fn described(slot: Slot<'_>) -> (ParameterKind, Option<Vec<f64>>) {
    let number = |Range(low, high): Range| {
        let high = if high >= 1e30 { f64::INFINITY } else { high };
        ParameterKind::Number { low, high }
    };
    let constant = |texture: &Texture<f32>| match texture {
        Texture::Constant(value) | Texture::Spectrum { value, .. } => Some(vec![f64::from(*value)]),
        _ => None,
    };
    match slot {
        Slot::Colour(texture) => {
            let value = match &**texture {
                Texture::Constant(colour) | Texture::Spectrum { value: colour, .. } => Some(numbers(*colour)),
                _ => None,
            };
            (ParameterKind::Colour, value)
        }
        Slot::Light(light) => (ParameterKind::Light, Some(numbers(*light))),
        Slot::Number(texture, range) => (number(range), constant(texture)),
        Slot::Roughness(roughness) => (number(Range(0.0, 1e30)), constant(&roughness.u)),
        Slot::Plain(value, range) => (number(range), Some(vec![f64::from(*value)])),
        Slot::Double(value, range) => (number(range), Some(vec![*value])),
        Slot::Point(at) => (ParameterKind::Point, Some(point(*at))),
    }
}

fn numbers(colour: Rgb) -> Vec<f64> {
    colour.to_array().map(f64::from).to_vec()
}

/// Where a light stands.
fn origin(world_from_light: &Transform) -> Vec<f64> {
    point(world_from_light.point(DVec3::ZERO))
}

fn point(point: DVec3) -> Vec<f64> {
    point.to_array().to_vec()
}

#[cfg(test)]
mod tests {
    use std::str::FromStr;

    use lumbre_formats::{Budget, Diagnostics, pbrt};

    use super::*;
    use crate::Setting;

    #[test]
    fn every_parameter_that_is_listed_can_be_set_to_what_it_is() {
        let text = "LookAt 0 -9 2 0 0 0 0 0 1 Camera \"perspective\" WorldBegin
            LightSource \"point\" \"rgb I\" [1 2 3] LightSource \"spot\" \"point3 from\" [1 2 3] LightSource \"distant\" LightSource \"infinite\"
            MakeNamedMaterial \"the.wood\" \"string type\" \"coateddiffuse\" \"rgb reflectance\" [.2 .3 .4]
            MakeNamedMaterial \"paint\" \"string type\" \"principled\"
            AreaLightSource \"diffuse\" NamedMaterial \"the.wood\" Shape \"sphere\"";
        let mut read = Diagnostics::new();
        let mut desc =
            pbrt::read_bytes("a.pbrt", text.as_bytes(), None, &Budget::default(), &mut read).unwrap();
        let found = parameters(&desc);
        let path = |path: &str| found.iter().find(|parameter| parameter.path == path);
        assert_eq!(path("light.0.intensity").unwrap().kind, ParameterKind::Light);
        let value = path("material.the.wood.reflectance").unwrap().value.clone().unwrap();
        assert!((value[1] - 0.3).abs() < 1e-6, "{value:?}");
        assert!(found.len() > 20, "{}", found.len());
        for parameter in &found {
            let value = parameter.value.clone().unwrap();
            let value: Vec<String> = value.iter().map(f64::to_string).collect();
            let text = format!("{}={}", parameter.path, value.join(","));
            Setting::from_str(&text).and_then(|setting| setting.apply(&mut desc)).unwrap();
        }
    }
}
