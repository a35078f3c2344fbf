//! Lights.

use std::sync::Arc;

use lumbre_math::Transform;
use lumbre_scene::pov::{PovArea, PovCone, PovLight};

use super::objects::Object;
use super::{Parser, Result};

/// A light, with what looks like it.
#[derive(Clone, Debug)]
pub(super) struct LightStatement {
    pub light: PovLight,
    pub looks_like: Option<Box<Object>>,
}

impl LightStatement {
    pub(super) fn moved(&self, map: &Transform) -> Self {
        let mut moved = self.clone();
        let light = &mut moved.light;
        light.point_at = map.point(light.point_at);
        light.from = map.point(light.from);
        if let Some(area) = &mut light.area {
            area.sides = area.sides.map(|side| map.vector(side));
        }
        if let Some(object) = &mut moved.looks_like {
            object.transform = *map * object.transform;
        }
        moved
    }
}

impl Parser<'_, '_> {
    /// A light, up to its closing brace, which is taken.
    pub(super) fn light_body(&mut self) -> Result<LightStatement> {
        let from = self.vector()?;
        self.comma()?;
        let colour = self.rgb()?;
        let mut statement = LightStatement { light: PovLight::new(from, colour), looks_like: None };
        while !self.take(b'}')? {
            if self.take(b',')? {
                continue;
            }
            if let Some(map) = self.transform()? {
                statement = statement.moved(&map);
                continue;
            }
            let Some(word) = self.word()? else { return Err(self.unexpected("what modifies a light")) };
            self.peeked = None;
            self.light_modifier(&word, &mut statement)?;
        }
        self.light_is_closed = true;
        Ok(statement)
    }

    fn light_modifier(&mut self, word: &str, statement: &mut LightStatement) -> Result<()> {
        let light = &mut statement.light;
        match word {
            "color" | "colour" | "rgb" => light.colour = self.rgb()?,
            "spotlight" => {
                light.cone = Some(PovCone { is_cylinder: false, radius: 30.0, falloff: 45.0, tightness: 0.0 })
            }
            "cylinder" => {
                light.cone = Some(PovCone { is_cylinder: true, radius: 0.75, falloff: 1.0, tightness: 0.0 })
            }
            "point_at" => light.point_at = self.vector()?,
            "radius" | "falloff" | "tightness" => {
                let value = self.finite()?;
                if let Some(cone) = &mut light.cone {
                    match word {
                        "radius" => cone.radius = value,
                        "falloff" => cone.falloff = value,
                        _ => cone.tightness = value,
                    }
                }
            }
            "parallel" => light.is_parallel = true,
            "shadowless" => light.shadowless = true,
            "fade_distance" => light.fade_distance = self.finite()?,
            "fade_power" => light.fade_power = self.finite()?,
            "area_light" => {
                let first = self.vector()?;
                self.comma()?;
                let second = self.vector()?;
                self.comma()?;
                let n = self.whole(1.0, 1000.0)?;
                self.comma()?;
                let m = self.whole(1.0, 1000.0)?;
                light.area = Some(PovArea {
                    sides: [first, second],
                    counts: [n, m],
                    adaptive: 100,
                    jitter: false,
                    circular: false,
                    orient: false,
                    illumination: false,
                });
            }
            "adaptive" => {
                let level = self.whole(0.0, 100.0)?;
                if let Some(area) = &mut light.area {
                    area.adaptive = level;
                }
            }
            "jitter" | "circular" | "orient" | "area_illumination" => {
                let on = self.optional_bool()?;
                if let Some(area) = &mut light.area {
                    match word {
                        "jitter" => area.jitter = on,
                        "circular" => area.circular = on,
                        "orient" => area.orient = on,
                        _ => area.illumination = on,
                    }
                }
            }
            "looks_like" => {
                self.expect(b'{')?;
                let object = match self.object()? {
                    Some(object) => object,
                    None => self.named_part()?,
                };
                self.expect(b'}')?;
                let mut object = object;
                object.transform = Transform::translate(light.from) * object.transform;
                let shift = Arc::new(Transform::translate(light.from));
                object.texture = object.texture.map(|texture| texture.carried(&shift));
                object.visibility.no_shadow = true;
                statement.looks_like = Some(Box::new(object));
            }
            "projected_through" | "photons" => {
                self.warn(&format!("{word} of a light is not rendered"));
                self.expect(b'{')?;
                self.skip_to(b'}')?;
            }
            "media_interaction" => light.media_interaction = self.optional_bool()?,
            "media_attenuation" => light.media_attenuation = self.optional_bool()?,
            _ => return Err(self.error(format!("{word} has no meaning for a light"))),
        }
        Ok(())
    }

    fn named_part(&mut self) -> Result<Object> {
        use super::value::Value;
        let Some(name) = self.word()? else { return Err(self.unexpected("an object")) };
        match self.lookup(&name).map(|cell| cell.borrow().clone()) {
            Some(Value::Object(object)) => {
                self.peeked = None;
                let mut object = (*object).clone();
                while let Some(map) = self.transform()? {
                    object.transform = *map * object.transform;
                }
                Ok(object)
            }
            _ => Err(self.unexpected("an object")),
        }
    }
}
