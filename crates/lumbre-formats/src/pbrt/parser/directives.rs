//! The directives: their names, where each may appear, and their meaning.

use std::borrow::Cow;
use std::sync::Arc;

use lumbre_image::ColourSpace;
use lumbre_math::Transform;

use super::super::lexer::{TokenKind, parse_number};
use super::super::params::Params;
use super::super::source::{Result, SourcePosition};
use super::super::state::EntityKind;
use super::Parser;
use crate::Diagnostic;
use crate::diagnostic::quoted;

use Where::{Anywhere, Options, World};

/// Where a directive may appear.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Where {
    /// Before `WorldBegin`.
    Options,
    /// After `WorldBegin`.
    World,
    Anywhere,
}

/// Reads the arguments of a directive, and executes it.
type Handler<'b, 'd> = fn(&mut Parser<'b, 'd>, SourcePosition) -> Result<()>;

impl<'b, 'd> Parser<'b, 'd> {
    const DIRECTIVES: [(&'static str, Where, Handler<'b, 'd>); 42] = [
        ("Accelerator", Options, Self::accelerator),
        ("ActiveTransform", Anywhere, Self::active_transform),
        ("AreaLightSource", World, Self::area_light_source),
        ("Attribute", Anywhere, Self::attribute),
        ("AttributeBegin", World, Self::attribute_begin),
        ("AttributeEnd", World, Self::attribute_end),
        ("Camera", Options, Self::camera),
        ("ColorSpace", Anywhere, Self::color_space),
        ("ConcatTransform", Anywhere, Self::concat_transform),
        ("CoordSysTransform", Anywhere, Self::coord_sys_transform),
        ("CoordinateSystem", Anywhere, Self::coordinate_system),
        ("Film", Options, Self::film),
        ("Identity", Anywhere, Self::identity),
        ("Import", World, Self::import),
        ("Include", Anywhere, Self::include),
        ("Integrator", Options, Self::integrator),
        ("LightSource", World, Self::light_source),
        ("LookAt", Anywhere, Self::look_at),
        ("MakeNamedMaterial", World, Self::make_named_material),
        ("MakeNamedMedium", Anywhere, Self::make_named_medium),
        ("Material", World, Self::material),
        ("MediumInterface", Anywhere, Self::medium_interface),
        ("NamedMaterial", World, Self::named_material),
        ("ObjectBegin", World, Self::object_begin),
        ("ObjectEnd", World, Self::object_end),
        ("ObjectInstance", World, Self::object_instance),
        ("Option", Anywhere, Self::option),
        ("PixelFilter", Options, Self::pixel_filter),
        ("ReverseOrientation", World, Self::reverse_orientation),
        ("Rotate", Anywhere, Self::rotate),
        ("Sampler", Options, Self::sampler),
        ("Scale", Anywhere, Self::scale),
        ("Shape", World, Self::shape),
        // pbrt-v3; before WorldBegin there, too.
        ("SurfaceIntegrator", Options, Self::surface_integrator),
        ("Texture", World, Self::texture),
        ("Transform", Anywhere, Self::set_transform),
        ("TransformBegin", Anywhere, Self::transform_begin),
        ("TransformEnd", Anywhere, Self::transform_end),
        ("TransformTimes", Options, Self::transform_times),
        ("Translate", Anywhere, Self::translate),
        ("WorldBegin", Options, Self::world_begin),
        ("WorldEnd", World, Self::world_end),
    ];

    pub(in crate::pbrt) fn is_directive(name: &str) -> bool {
        Self::DIRECTIVES.iter().any(|(directive, ..)| *directive == name)
    }

    pub(super) fn directive(&mut self, name: &str, spot: SourcePosition) -> Result<()> {
        let Some((_, place, handler)) = Self::DIRECTIVES.iter().find(|(directive, ..)| *directive == name)
        else {
            let known = Self::DIRECTIVES.iter().map(|(directive, ..)| *directive);
            let files = &self.converter.files;
            self.converter.diagnostics.warn(&format!("unknown directive {}", quoted(name)), |unknown| {
                files.locate(spot, unknown.suggest(name, known))
            });
            return self.skip_arguments();
        };
        match place {
            Options if self.in_world => {
                return Err(spot.error(format!("{name} stands after WorldBegin; it belongs before it")));
            }
            World if !self.in_world => {
                return Err(spot.error(format!("{name} stands before WorldBegin; it belongs after it")));
            }
            _ => {}
        }
        handler(self, spot)
    }

    /// Skips the arguments of an unknown directive.
    fn skip_arguments(&mut self) -> Result<()> {
        while let Some(token) = self.peek()? {
            let raw = self.frames.last().expect("a file is being read").lexer.raw(token);
            let is_argument = token.kind != TokenKind::Bare
                || parse_number(raw).is_some()
                || matches!(raw, b"true" | b"false" | b"nan");
            if !is_argument {
                break;
            }
            self.peeked = None;
        }
        Ok(())
    }
}

// The settings before WorldBegin.
impl Parser<'_, '_> {
    fn option(&mut self, _spot: SourcePosition) -> Result<()> {
        let (name, at) = self.string("Option", "a name in quotes")?;
        let token = self.expect("a value")?;
        let value: Cow<'_, str> = match token.kind {
            TokenKind::String => self.top().lexer.string(token)?.into_owned().into(),
            TokenKind::Bare => self.bare(token).into(),
            _ => return self.unexpected(token, "wrong value of Option", "a word, a number or a string"),
        };
        // pbrt writes the bare name; a type before it is harmless.
        let name = name.split_ascii_whitespace().last().unwrap_or("").to_owned();
        self.converter.option(&name, at, &value)
    }

    fn color_space(&mut self, _spot: SourcePosition) -> Result<()> {
        let (name, at) = self.string("ColorSpace", "a name in quotes")?;
        self.state.space = ColourSpace::from_name(&name).ok_or_else(|| {
            let names = ColourSpace::NAMES;
            let wrong = Diagnostic::error("unknown colour space").found(quoted(&name));
            at.wrong(wrong.suggest(&name, names).expected(names.join(", ")))
        })?;
        Ok(())
    }

    fn camera(&mut self, spot: SourcePosition) -> Result<()> {
        let (ty, params) = self.entity("Camera", "camera", None, spot)?;
        let camera_from_world = self.state.ctm;
        let world_from_camera = camera_from_world.map(|t| t.inverse());
        self.coordinate_systems.insert("camera".to_owned(), world_from_camera);
        self.converter.camera(&ty, params, &world_from_camera, self.state.media[1])
    }

    fn film(&mut self, spot: SourcePosition) -> Result<()> {
        let (ty, params) = self.entity("Film", "film", None, spot)?;
        self.converter.film(&ty, params, self.state.space)
    }

    fn sampler(&mut self, spot: SourcePosition) -> Result<()> {
        let (ty, params) = self.entity("Sampler", "sampler", None, spot)?;
        self.converter.sampler(&ty, params)
    }

    fn pixel_filter(&mut self, spot: SourcePosition) -> Result<()> {
        let (ty, params) = self.entity("PixelFilter", "filter", None, spot)?;
        self.converter.filter(&ty, params)
    }

    fn integrator(&mut self, spot: SourcePosition) -> Result<()> {
        let (ty, params) = self.entity("Integrator", "integrator", None, spot)?;
        self.converter.integrator(&ty, params)
    }

    fn surface_integrator(&mut self, spot: SourcePosition) -> Result<()> {
        self.converter.upgraded(spot);
        let (ty, params) = self.entity("SurfaceIntegrator", "integrator", None, spot)?;
        self.converter.integrator(&ty, params)
    }

    fn accelerator(&mut self, spot: SourcePosition) -> Result<()> {
        let (ty, params) = self.entity("Accelerator", "accelerator", None, spot)?;
        self.converter.accelerator(&ty, params)
    }

    fn world_begin(&mut self, _spot: SourcePosition) -> Result<()> {
        self.in_world = true;
        self.state.ctm = [Transform::IDENTITY; 2];
        self.state.active = [true; 2];
        self.coordinate_systems.insert("world".to_owned(), self.state.ctm);
        Ok(())
    }

    fn world_end(&mut self, spot: SourcePosition) -> Result<()> {
        self.converter.upgraded(spot);
        Ok(())
    }
}

// The contents of the world.
impl Parser<'_, '_> {
    fn reverse_orientation(&mut self, _spot: SourcePosition) -> Result<()> {
        self.state.reverse_orientation = !self.state.reverse_orientation;
        Ok(())
    }

    fn shape(&mut self, spot: SourcePosition) -> Result<()> {
        let (ty, params) = self.entity("Shape", "shape", Some(EntityKind::Shape), spot)?;
        self.converter.shape(&ty, params, &self.state)
    }

    fn object_instance(&mut self, spot: SourcePosition) -> Result<()> {
        let (name, at) = self.string("ObjectInstance", "a name in quotes")?;
        self.converter.instance(&name, spot, at, &self.state.ctm)
    }

    fn material(&mut self, spot: SourcePosition) -> Result<()> {
        let (ty, params) = self.entity("Material", "material", Some(EntityKind::Material), spot)?;
        self.state.material = self.converter.material(&ty, params)?;
        Ok(())
    }

    fn make_named_material(&mut self, spot: SourcePosition) -> Result<()> {
        let (name, at) = self.string("MakeNamedMaterial", "a name in quotes")?;
        let own = self.params()?;
        let defaults = self.state.defaults_for(EntityKind::Material);
        let params = Params::new(format!("material {}", quoted(&name)), spot, own, defaults);
        self.converter.named_material(&name, at, params)
    }

    fn named_material(&mut self, _spot: SourcePosition) -> Result<()> {
        let (name, at) = self.string("NamedMaterial", "a name in quotes")?;
        self.state.material = Some(self.converter.material_named(&name, at)?);
        Ok(())
    }

    fn texture(&mut self, spot: SourcePosition) -> Result<()> {
        let (name, _) = self.string("Texture", "a name in quotes")?;
        let (value, value_at) = self.string("Texture", "\"float\" or \"spectrum\"")?;
        let (ty, params) = self.entity("Texture", "texture", Some(EntityKind::Texture), spot)?;
        self.converter.texture(&name, (&value, value_at), &ty, params, self.state.ctm[0])
    }

    fn light_source(&mut self, spot: SourcePosition) -> Result<()> {
        let (ty, params) = self.entity("LightSource", "light", Some(EntityKind::Light), spot)?;
        self.light_stays(spot);
        self.converter.light(&ty, params, &self.state)
    }

    fn area_light_source(&mut self, spot: SourcePosition) -> Result<()> {
        let (ty, params) = self.entity("AreaLightSource", "light", Some(EntityKind::Light), spot)?;
        self.state.area_light = self.converter.area_light(&ty, params, &self.state)?.map(Arc::new);
        Ok(())
    }

    /// Warns that a light other than a shape does not move.
    fn light_stays(&mut self, spot: SourcePosition) {
        if self.state.ctm[0] != self.state.ctm[1] {
            let message = "the motion of this light is left out: it stays where it starts";
            self.converter.warn(spot, Diagnostic::warning(message));
        }
    }

    fn make_named_medium(&mut self, spot: SourcePosition) -> Result<()> {
        let (name, at) = self.string("MakeNamedMedium", "a name in quotes")?;
        let own = self.params()?;
        let defaults = self.state.defaults_for(EntityKind::Medium);
        let params = Params::new(format!("medium {}", quoted(&name)), spot, own, defaults);
        self.converter.medium(&name, at, params, &self.state.ctm)
    }

    fn medium_interface(&mut self, _: SourcePosition) -> Result<()> {
        let (inside, at) = self.string("MediumInterface", "a name in quotes")?;
        let inside = self.converter.medium_of_side(&inside, at)?;
        let outside = match self.peek()? {
            Some(token) if token.kind == TokenKind::String => {
                let (outside, at) = self.string("MediumInterface", "a name in quotes")?;
                self.converter.medium_of_side(&outside, at)?
            }
            _ => inside,
        };
        self.state.media = [inside, outside];
        Ok(())
    }
}
