//! The grammar: files and includes, directives and the rules on where they may stand, parameter lists.

use std::borrow::Cow;
use std::cell::Cell;
use std::collections::HashMap;
use std::path::{Path, PathBuf};
use std::rc::Rc;
use std::sync::Arc;

use lumbre_image::ColourSpace;
use lumbre_math::{DAffine3, DMat3, DMat4, DVec3, SingularTransformError, Transform};

use super::colour::rgb_from_xyz;
use super::convert::Converter;
use super::lexer::{Lexer, Token, TokenKind, parse_number, says_infinity};
use super::params::{Param, Params, Type, Values, Wants};
use super::source::{AtSpot, Fault, Result, Spot};
use super::state::{EntityKind, Scope, ScopeKind, State};
use crate::diagnostic::{number, quoted};
use crate::{Diagnostic, FormatError, Input};

/// Where a directive may stand.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Where {
    Options,
    World,
    Anywhere,
}

const DIRECTIVES: [(&str, Where); 42] = [
    ("Accelerator", Where::Options),
    ("ActiveTransform", Where::Anywhere),
    ("AreaLightSource", Where::World),
    ("Attribute", Where::Anywhere),
    ("AttributeBegin", Where::World),
    ("AttributeEnd", Where::World),
    ("Camera", Where::Options),
    ("ColorSpace", Where::Anywhere),
    ("ConcatTransform", Where::Anywhere),
    ("CoordSysTransform", Where::Anywhere),
    ("CoordinateSystem", Where::Anywhere),
    ("Film", Where::Options),
    ("Identity", Where::Anywhere),
    ("Import", Where::World),
    ("Include", Where::Anywhere),
    ("Integrator", Where::Options),
    ("LightSource", Where::World),
    ("LookAt", Where::Anywhere),
    ("MakeNamedMaterial", Where::World),
    ("MakeNamedMedium", Where::Anywhere),
    ("Material", Where::World),
    ("MediumInterface", Where::Anywhere),
    ("NamedMaterial", Where::World),
    ("ObjectBegin", Where::World),
    ("ObjectEnd", Where::World),
    ("ObjectInstance", Where::World),
    ("Option", Where::Anywhere),
    ("PixelFilter", Where::Options),
    ("ReverseOrientation", Where::World),
    ("Rotate", Where::Anywhere),
    ("Sampler", Where::Options),
    ("Scale", Where::Anywhere),
    ("Shape", Where::World),
    // pbrt-v3; it had them before WorldBegin too.
    ("SurfaceIntegrator", Where::Options),
    ("Texture", Where::World),
    ("Transform", Where::Anywhere),
    ("TransformBegin", Where::Anywhere),
    ("TransformEnd", Where::Anywhere),
    ("TransformTimes", Where::Options),
    ("Translate", Where::Anywhere),
    ("WorldBegin", Where::Options),
    ("WorldEnd", Where::World),
];

/// A file that is being read.
struct Frame<'b> {
    lexer: Lexer<Input<'b>>,
    // Its one true path, by which a cycle is known; `None` for what is not a file.
    canonical: Option<PathBuf>,
    // The state and the scopes to come back to, for `Import`.
    import: Option<Box<(State, usize)>>,
    is_top: bool,
}

/// Reads the scene language and hands each entity to the [`Converter`].
pub(super) struct Parser<'b, 'd> {
    frames: Vec<Frame<'b>>,
    peeked: Option<Token>,
    in_world: bool,
    state: State,
    scopes: Vec<Scope>,
    coordinate_systems: HashMap<String, [Transform; 2]>,
    pub converter: Converter<'b, 'd>,
}

impl<'b, 'd> Parser<'b, 'd> {
    pub fn new(mut converter: Converter<'b, 'd>) -> Self {
        let state = State::new(converter.default_material());
        Self {
            frames: vec![],
            peeked: None,
            in_world: false,
            state,
            scopes: vec![],
            coordinate_systems: HashMap::new(),
            converter,
        }
    }

    /// Reads one more top-level input to its end.
    pub fn read(&mut self, input: Input<'b>, canonical: Option<PathBuf>) -> Result<()> {
        let file = self.converter.files.add(input.name().clone(), None);
        let lexer = Lexer::new(input, file)?;
        self.frames.push(Frame { lexer, canonical, import: None, is_top: true });
        loop {
            let Some(token) = self.next()? else {
                if self.leave_file()? {
                    return Ok(());
                }
                continue;
            };
            let spot = self.spot(token);
            if token.kind == TokenKind::Bare {
                let name = self.bare(token);
                self.directive(&name, spot)?;
            } else {
                let wrong = Diagnostic::error("no directive before this").found(self.shown(token));
                return Err(spot.wrong(wrong.expected("a directive such as Shape")));
            }
        }
    }

    /// After the last input: what is open is an error, and what was put off is done.
    pub fn finish(&mut self) -> Result<()> {
        if let Some(scope) = self.scopes.pop() {
            return Err(scope.spot.error(format!("{} without its {}", scope.kind.begin(), scope.kind.end())));
        }
        if !self.in_world {
            let spot = Spot { file: 0, line: 1, column: 1 };
            return Err(spot.error("the scene has no WorldBegin"));
        }
        self.converter.finish()
    }

    // Tokens.

    fn top(&mut self) -> &mut Frame<'b> {
        self.frames.last_mut().expect("a file is being read")
    }

    /// The next token; an included file that ends goes on in the one that included it, as its text stood there.
    fn next(&mut self) -> Result<Option<Token>> {
        if let Some(token) = self.peeked.take() {
            return Ok(Some(token));
        }
        loop {
            let frame = self.top();
            let token = frame.lexer.next()?;
            if token.is_some() || frame.is_top || frame.import.is_some() {
                return Ok(token);
            }
            self.frames.pop();
        }
    }

    fn peek(&mut self) -> Result<Option<Token>> {
        self.peeked = self.next()?;
        Ok(self.peeked)
    }

    fn spot(&mut self, token: Token) -> Spot {
        self.top().lexer.spot(token)
    }

    fn shown(&mut self, token: Token) -> String {
        self.top().lexer.shown(token)
    }

    fn bare(&mut self, token: Token) -> String {
        String::from_utf8_lossy(self.top().lexer.raw(token)).into_owned()
    }

    /// The next token, which must be there.
    fn expect(&mut self, what: &str) -> Result<Token> {
        match self.next()? {
            Some(token) => Ok(token),
            None => {
                let spot = self.top().lexer.end_spot();
                Err(spot.wrong(Diagnostic::error("the file ends too early").expected(what)))
            }
        }
    }

    fn unexpected<T>(&mut self, token: Token, what: &str, expected: &str) -> Result<T> {
        let wrong = Diagnostic::error(what).found(self.shown(token)).expected(expected);
        Err(self.spot(token).wrong(wrong))
    }

    /// A string with its place.
    fn string(&mut self, directive: &str, expected: &str) -> Result<(String, Spot)> {
        let token = self.expect(expected)?;
        if token.kind != TokenKind::String {
            return self.unexpected(token, &format!("wrong argument of {directive}"), expected);
        }
        let spot = self.spot(token);
        let text = self.top().lexer.string(token)?;
        Ok((text.into_owned(), spot))
    }

    /// `N` numbers, in brackets or not.
    fn numbers<const N: usize>(&mut self, directive: &str) -> Result<[f64; N]> {
        let what = format!("wrong argument of {directive}");
        let plural = if N == 1 { "number" } else { "numbers" };
        let expected = format!("{N} {plural}");
        let mut numbers = [0.0; N];
        let mut token = self.expect(&expected)?;
        let bracketed = token.kind == TokenKind::Open;
        if bracketed {
            token = self.expect(&expected)?;
        }
        for (i, number) in numbers.iter_mut().enumerate() {
            if i > 0 {
                token = self.expect(&expected)?;
            }
            let value =
                if token.kind == TokenKind::Bare { parse_number(self.top().lexer.raw(token)) } else { None };
            match value {
                Some(v) if v.is_finite() => *number = v,
                Some(_) => return self.unexpected(token, &what, "a finite number"),
                None => return self.unexpected(token, &what, &expected),
            }
        }
        if bracketed {
            let token = self.expect("]")?;
            if token.kind != TokenKind::Close {
                return self.unexpected(token, &what, "]");
            }
        }
        Ok(numbers)
    }

    // Parameters.

    /// The parameter list that follows.
    fn params(&mut self) -> Result<Vec<Param>> {
        let mut params = vec![];
        while let Some(token) = self.peek()? {
            if token.kind != TokenKind::String {
                break;
            }
            self.peeked = None;
            params.push(self.param(token)?);
        }
        Ok(params)
    }

    fn param(&mut self, declaration: Token) -> Result<Param> {
        let spot = self.spot(declaration);
        let text = self.top().lexer.string(declaration)?.into_owned();
        let mut words = text.split_ascii_whitespace();
        let (type_name, name) = match (words.next(), words.next(), words.next()) {
            (Some(ty), Some(name), None) => (ty, name),
            _ => {
                let wrong = Diagnostic::error("wrong declaration of a parameter").found(quoted(&text));
                return Err(spot.wrong(wrong.expected("a type and a name such as \"float radius\"")));
            }
        };
        let Some((ty, old)) = Type::from_name(type_name) else {
            let wrong = Diagnostic::error(format!("unknown type of parameter {}", quoted(name)));
            let wrong = wrong.found(quoted(type_name)).suggest(type_name, Type::names());
            return Err(spot.wrong(wrong.expected(Type::names().collect::<Vec<_>>().join(", "))));
        };
        if old {
            self.converter.upgraded(spot);
        }
        let mut values = self.values(ty, name)?;
        let mut space = self.state.space;
        if type_name == "xyz" {
            if let Values::Numbers(numbers) = &mut values {
                let triples = numbers.chunks_exact_mut(3);
                triples.for_each(|c| c.copy_from_slice(&rgb_from_xyz([c[0], c[1], c[2]])));
            }
            space = ColourSpace::REC709;
        }
        self.converter.budget.elements(values.len() as u64 + 1, "parameters").at(spot)?;
        Ok(Param { ty, name: name.into(), spot, values, space, used: Cell::new(false) })
    }

    fn values(&mut self, ty: Type, name: &str) -> Result<Values> {
        let expected = match ty.wants() {
            Wants::Bools => "true or false",
            Wants::Integers => "integer",
            Wants::Strings => "string",
            Wants::Numbers => ty.name(),
            Wants::NumbersOrStrings => "numbers or a string",
        };
        let mut token = self.expect(&format!("a value for parameter {}", quoted(name)))?;
        let bracketed = token.kind == TokenKind::Open;
        if bracketed {
            token = self.expect("]")?;
        }
        let mut values = match ty.wants() {
            Wants::Bools => Values::Bools(vec![]),
            Wants::Integers => Values::Integers(vec![]),
            Wants::Strings => Values::Strings(vec![]),
            Wants::NumbersOrStrings if token.kind == TokenKind::String => Values::Strings(vec![]),
            _ => Values::Numbers(vec![]),
        };
        loop {
            if bracketed && token.kind == TokenKind::Close {
                return Ok(values);
            }
            if !self.value(token, &mut values)? {
                let what = format!("wrong value for parameter {}", quoted(name));
                return self.unexpected(token, &what, expected);
            }
            if !bracketed {
                return Ok(values);
            }
            token = self.expect("]")?;
        }
    }

    /// Adds the value that `token` is; answers whether it is one.
    fn value(&mut self, token: Token, values: &mut Values) -> Result<bool> {
        let lexer = &mut self.frames.last_mut().expect("a file is being read").lexer;
        match (values, token.kind) {
            (Values::Numbers(v), TokenKind::Bare) => {
                let raw = lexer.raw(token);
                match parse_number(raw) {
                    Some(number) if number.is_finite() || says_infinity(raw) => v.push(number),
                    _ => return Ok(false),
                }
            }
            (Values::Integers(v), TokenKind::Bare) => match parse_number(lexer.raw(token)) {
                Some(n) if n.fract() == 0.0 && f64::from(i32::MIN) <= n && n <= f64::from(i32::MAX) => {
                    v.push(n as i32);
                }
                _ => return Ok(false),
            },
            (Values::Strings(v), TokenKind::String) => v.push(lexer.string(token)?.into_owned()),
            (Values::Bools(v), TokenKind::Bare) => match lexer.raw(token) {
                b"true" => v.push(true),
                b"false" => v.push(false),
                _ => return Ok(false),
            },
            // As pbrt-v3 writes them.
            (Values::Bools(v), TokenKind::String) => {
                match &*lexer.string(token)? {
                    "true" => v.push(true),
                    "false" => v.push(false),
                    _ => return Ok(false),
                }
                let spot = lexer.spot(token);
                self.converter.upgraded(spot);
            }
            _ => return Ok(false),
        }
        Ok(true)
    }

    /// A type in quotes, then a parameter list.
    fn entity(
        &mut self,
        directive: &str,
        noun: &str,
        kind: Option<EntityKind>,
        spot: Spot,
    ) -> Result<(String, Params)> {
        let (ty, _) = self.string(directive, "a type in quotes")?;
        let own = self.params()?;
        let defaults = kind.map(|k| self.state.defaults_for(k)).unwrap_or_default();
        let owner = format!("{noun} {}", quoted(&ty));
        Ok((ty, Params::new(owner, spot, own, defaults)))
    }

    // Directives.

    fn directive(&mut self, name: &str, spot: Spot) -> Result<()> {
        let Some((_, place)) = DIRECTIVES.iter().find(|(directive, _)| *directive == name) else {
            let known = DIRECTIVES.iter().map(|(directive, _)| *directive);
            let files = &self.converter.files;
            self.converter.diagnostics.warn(&format!("unknown directive {}", quoted(name)), |unknown| {
                files.locate(spot, unknown.suggest(name, known))
            });
            return self.skip_arguments();
        };
        match place {
            Where::Options if self.in_world => {
                return Err(spot.error(format!("{name} stands after WorldBegin; it belongs before it")));
            }
            Where::World if !self.in_world => {
                return Err(spot.error(format!("{name} stands before WorldBegin; it belongs after it")));
            }
            _ => {}
        }
        match name {
            "Identity" => {
                for (ctm, active) in self.state.ctm.iter_mut().zip(self.state.active) {
                    if active {
                        *ctm = Transform::IDENTITY;
                    }
                }
                Ok(())
            }
            "Translate" => {
                let [x, y, z] = self.numbers("Translate")?;
                self.transform(spot, Ok(Transform::translate(DVec3::new(x, y, z))), "Translate")
            }
            "Scale" => {
                let [x, y, z] = self.numbers("Scale")?;
                self.transform(spot, Transform::scale(DVec3::new(x, y, z)), "Scale")
            }
            "Rotate" => {
                let [degrees, x, y, z] = self.numbers("Rotate")?;
                self.transform(spot, Transform::rotate(DVec3::new(x, y, z), degrees), "Rotate")
            }
            "LookAt" => self.look_at(spot),
            "Transform" => {
                let matrix = self.numbers::<16>("Transform")?;
                let new = Transform::from_matrix(DMat4::from_cols_array(&matrix));
                let new = new.map_err(|_| singular(spot, "Transform"))?;
                for (ctm, active) in self.state.ctm.iter_mut().zip(self.state.active) {
                    if active {
                        *ctm = new;
                    }
                }
                Ok(())
            }
            "ConcatTransform" => {
                let matrix = self.numbers::<16>("ConcatTransform")?;
                self.transform(
                    spot,
                    Transform::from_matrix(DMat4::from_cols_array(&matrix)),
                    "ConcatTransform",
                )
            }
            "CoordinateSystem" => {
                let (name, _) = self.string("CoordinateSystem", "a name in quotes")?;
                self.coordinate_systems.insert(name, self.state.ctm);
                Ok(())
            }
            "CoordSysTransform" => {
                let (name, at) = self.string("CoordSysTransform", "a name in quotes")?;
                match self.coordinate_systems.get(&name) {
                    Some(ctm) => self.state.ctm = *ctm,
                    None => {
                        let wrong =
                            Diagnostic::warning(format!("unknown coordinate system {}", quoted(&name)));
                        let wrong = wrong.suggest(&name, self.coordinate_systems.keys().map(String::as_str));
                        self.converter.warn(at, wrong);
                    }
                }
                Ok(())
            }
            "ActiveTransform" => {
                let expected = "StartTime, EndTime or All";
                let token = self.expect(expected)?;
                self.state.active = match self.top().lexer.raw(token) {
                    b"StartTime" => [true, false],
                    b"EndTime" => [false, true],
                    b"All" => [true, true],
                    _ => return self.unexpected(token, "wrong argument of ActiveTransform", expected),
                };
                Ok(())
            }
            "TransformTimes" => {
                let [start, end] = self.numbers::<2>("TransformTimes")?;
                if start >= end {
                    let wrong = Diagnostic::error("the motion ends before it starts").found(number(end));
                    return Err(spot.wrong(wrong.expected(format!("more than {}", number(start)))));
                }
                self.converter.transform_times = [start, end];
                Ok(())
            }
            "ColorSpace" => {
                let (name, at) = self.string("ColorSpace", "a name in quotes")?;
                self.state.space = ColourSpace::from_name(&name).ok_or_else(|| {
                    let names = ColourSpace::NAMES;
                    let wrong = Diagnostic::error("unknown colour space").found(quoted(&name));
                    at.wrong(wrong.suggest(&name, names).expected(names.join(", ")))
                })?;
                Ok(())
            }
            "ReverseOrientation" => {
                self.state.reverse_orientation = !self.state.reverse_orientation;
                Ok(())
            }
            "Option" => self.option(),
            "Camera" => {
                let (ty, params) = self.entity("Camera", "camera", None, spot)?;
                let camera_from_world = self.state.ctm;
                let world_from_camera = camera_from_world.map(|t| t.inverse());
                self.coordinate_systems.insert("camera".to_owned(), world_from_camera);
                self.converter.camera(&ty, params, &world_from_camera)
            }
            "Film" => {
                let (ty, params) = self.entity("Film", "film", None, spot)?;
                self.converter.film(&ty, params, self.state.space)
            }
            "Sampler" => {
                let (ty, params) = self.entity("Sampler", "sampler", None, spot)?;
                self.converter.sampler(&ty, params)
            }
            "PixelFilter" => {
                let (ty, params) = self.entity("PixelFilter", "filter", None, spot)?;
                self.converter.filter(&ty, params)
            }
            "Integrator" | "SurfaceIntegrator" => {
                if name == "SurfaceIntegrator" {
                    self.converter.upgraded(spot);
                }
                let (ty, params) = self.entity(name, "integrator", None, spot)?;
                self.converter.integrator(&ty, params)
            }
            "Accelerator" => {
                let (ty, params) = self.entity("Accelerator", "accelerator", None, spot)?;
                self.converter.accelerator(&ty, params)
            }
            "WorldBegin" => {
                self.in_world = true;
                self.state.ctm = [Transform::IDENTITY; 2];
                self.state.active = [true; 2];
                self.coordinate_systems.insert("world".to_owned(), self.state.ctm);
                Ok(())
            }
            "WorldEnd" => {
                self.converter.upgraded(spot);
                Ok(())
            }
            "AttributeBegin" => self.open(ScopeKind::Attribute, spot),
            "AttributeEnd" => self.close(ScopeKind::Attribute, spot),
            "TransformBegin" => {
                if !self.in_world {
                    self.converter.upgraded(spot);
                }
                self.open(ScopeKind::Transform, spot)
            }
            "TransformEnd" => self.close(ScopeKind::Transform, spot),
            "Attribute" => self.attribute(spot),
            "ObjectBegin" => {
                let (name, at) = self.string("ObjectBegin", "a name in quotes")?;
                self.converter.begin_object(&name, spot, at)?;
                self.open(ScopeKind::Object, spot)
            }
            "ObjectEnd" => {
                self.close(ScopeKind::Object, spot)?;
                self.converter.end_object();
                Ok(())
            }
            "ObjectInstance" => {
                let (name, at) = self.string("ObjectInstance", "a name in quotes")?;
                self.converter.instance(&name, spot, at, &self.state.ctm)
            }
            "Shape" => {
                let (ty, params) = self.entity("Shape", "shape", Some(EntityKind::Shape), spot)?;
                self.converter.shape(&ty, params, &self.state)
            }
            "Material" => {
                let (ty, params) = self.entity("Material", "material", Some(EntityKind::Material), spot)?;
                self.state.material = self.converter.material(&ty, params)?;
                Ok(())
            }
            "MakeNamedMaterial" => {
                let (name, at) = self.string("MakeNamedMaterial", "a name in quotes")?;
                let own = self.params()?;
                let defaults = self.state.defaults_for(EntityKind::Material);
                let params = Params::new(format!("material {}", quoted(&name)), spot, own, defaults);
                self.converter.named_material(&name, at, params)
            }
            "NamedMaterial" => {
                let (name, at) = self.string("NamedMaterial", "a name in quotes")?;
                self.state.material = Some(self.converter.material_named(&name, at));
                Ok(())
            }
            "Texture" => {
                let (name, _) = self.string("Texture", "a name in quotes")?;
                let (value, value_at) = self.string("Texture", "\"float\" or \"spectrum\"")?;
                let (ty, params) = self.entity("Texture", "texture", Some(EntityKind::Texture), spot)?;
                self.converter.texture(&name, (&value, value_at), &ty, params, self.state.ctm[0])
            }
            "LightSource" => {
                let (ty, params) = self.entity("LightSource", "light", Some(EntityKind::Light), spot)?;
                self.light_stays(spot);
                self.converter.light(&ty, params, &self.state)
            }
            "AreaLightSource" => {
                let (ty, params) = self.entity("AreaLightSource", "light", Some(EntityKind::Light), spot)?;
                self.state.area_light = self.converter.area_light(&ty, params, &self.state)?.map(Arc::new);
                Ok(())
            }
            "MakeNamedMedium" => {
                let (name, at) = self.string("MakeNamedMedium", "a name in quotes")?;
                let own = self.params()?;
                let defaults = self.state.defaults_for(EntityKind::Medium);
                let params = Params::new(format!("medium {}", quoted(&name)), spot, own, defaults);
                self.converter.medium(&name, at, params)
            }
            "MediumInterface" => {
                let (inside, at) = self.string("MediumInterface", "a name in quotes")?;
                let outside = match self.peek()? {
                    Some(token) if token.kind == TokenKind::String => {
                        Some(self.string("MediumInterface", "a name in quotes")?)
                    }
                    _ => None,
                };
                let names = [Some((inside, at)), outside].into_iter().flatten();
                self.converter.medium_interface(spot, names.collect());
                Ok(())
            }
            "Include" | "Import" => self.include(name, spot),
            _ => unreachable!("every directive of the table has its arm"),
        }
    }

    /// Leaves out what follows an unknown directive.
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

    fn transform(
        &mut self,
        spot: Spot,
        by: std::result::Result<Transform, SingularTransformError>,
        directive: &str,
    ) -> Result<()> {
        let by = by.map_err(|_| singular(spot, directive))?;
        for (ctm, active) in self.state.ctm.iter_mut().zip(self.state.active) {
            if !active {
                continue;
            }
            let new = *ctm * by;
            // A chain of scales, each of them fine, may pass the range of numbers.
            let regular = |t: &DAffine3| t.is_finite() && t.matrix3 != DMat3::ZERO;
            if !regular(new.affine()) || !regular(new.inverse_affine()) {
                return Err(singular(spot, directive));
            }
            *ctm = new;
        }
        Ok(())
    }

    fn look_at(&mut self, spot: Spot) -> Result<()> {
        let [ex, ey, ez, lx, ly, lz, ux, uy, uz] = self.numbers("LookAt")?;
        let (eye, target, up) = (DVec3::new(ex, ey, ez), DVec3::new(lx, ly, lz), DVec3::new(ux, uy, uz));
        if eye == target {
            return Err(spot.error("LookAt from a point to itself: eye and target are equal"));
        }
        // Scaled first, so that no square overflows or vanishes.
        let unit = |v: DVec3| (v / v.abs().max_element()).normalize();
        let forward = unit(target - eye);
        if up == DVec3::ZERO {
            return Err(spot.error("LookAt with a zero up vector"));
        }
        let right = unit(up).cross(forward);
        if !forward.is_finite() || !right.is_finite() || right.length() < 1e-12 {
            return Err(spot.error("LookAt with its up vector along the line of sight"));
        }
        let right = unit(right);
        let axes = DMat3::from_cols(right, forward.cross(right), forward);
        let turn = Transform::from_affine(DAffine3::from_mat3(axes));
        let camera_from_world = turn.map(|turn| (Transform::translate(eye) * turn).inverse());
        self.transform(spot, camera_from_world, "LookAt")
    }

    /// Says that a light which is no shape does not move, where it should.
    fn light_stays(&mut self, spot: Spot) {
        if self.state.ctm[0] != self.state.ctm[1] {
            let message = "the motion of this light is left out: it stays where it starts";
            self.converter.warn(spot, Diagnostic::warning(message));
        }
    }

    fn open(&mut self, kind: ScopeKind, spot: Spot) -> Result<()> {
        self.converter.budget.nesting(self.scopes.len() + 1, kind.begin()).at(spot)?;
        self.scopes.push(Scope { kind, spot, saved: self.state.clone() });
        Ok(())
    }

    fn close(&mut self, kind: ScopeKind, spot: Spot) -> Result<()> {
        let base = self.frames.iter().rev().find_map(|f| f.import.as_ref()).map_or(0, |import| import.1);
        let Some(scope) = self.scopes.pop_if(|scope| scope.kind == kind) else {
            return Err(match self.scopes.last() {
                None => spot.error(format!("{} without {}", kind.end(), kind.begin())),
                Some(open) => {
                    let at = open.spot;
                    let message = format!("{} inside {}", kind.end(), open.kind.begin());
                    let found = format!("{} at {}", open.kind.begin(), self.converter.files.place(at));
                    let wrong = Diagnostic::error(message).found(found);
                    spot.wrong(wrong.expected(open.kind.end()))
                }
            });
        };
        if self.scopes.len() < base {
            return Err(
                spot.error(format!("{} in an imported file closes what its importer opened", kind.end()))
            );
        }
        // pbrt-v3's saves the transform alone; pbrt-v4 takes it for AttributeBegin.
        if kind == ScopeKind::Transform && self.converter.is_upgraded() {
            self.state.ctm = scope.saved.ctm;
            self.state.active = scope.saved.active;
        } else {
            self.state = scope.saved;
        }
        Ok(())
    }

    fn attribute(&mut self, spot: Spot) -> Result<()> {
        let names = EntityKind::NAMES.map(|(name, _)| name);
        let (kind, at) = self.string("Attribute", "a kind in quotes")?;
        let params = self.params()?;
        let Some((_, kind)) = EntityKind::NAMES.iter().find(|(name, _)| *name == kind) else {
            let wrong = Diagnostic::error("unknown kind of Attribute").found(quoted(&kind));
            return Err(at.wrong(wrong.suggest(&kind, names).expected(names.join(", "))));
        };
        let defaults = Rc::make_mut(&mut self.state.defaults[*kind as usize]);
        for param in params {
            let param = Rc::new(param);
            match defaults.iter().position(|p| p.name == param.name) {
                Some(same) => defaults[same] = param,
                None if defaults.len() < MAX_DEFAULTS => defaults.push(param),
                None => {
                    let message = format!("more than {MAX_DEFAULTS} different names in Attribute");
                    return Err(spot.error(message));
                }
            }
        }
        Ok(())
    }

    fn option(&mut self) -> Result<()> {
        let (name, at) = self.string("Option", "a name in quotes")?;
        let token = self.expect("a value")?;
        let value: Cow<'_, str> = match token.kind {
            TokenKind::String => self.top().lexer.string(token)?.into_owned().into(),
            TokenKind::Bare => self.bare(token).into(),
            _ => return self.unexpected(token, "wrong value of Option", "a word, a number or a string"),
        };
        // pbrt writes the bare name; a type before it does no harm.
        let name = name.split_ascii_whitespace().last().unwrap_or("").to_owned();
        self.converter.option(&name, at, &value)
    }

    // Files.

    fn include(&mut self, directive: &str, spot: Spot) -> Result<()> {
        let (name, at) = self.string(directive, "a file name in quotes")?;
        let path = self.converter.resolve(&name, at)?;
        let canonical = path.canonicalize().ok();
        let cycle = self.frames.iter().any(|f| f.canonical.is_some() && f.canonical == canonical);
        if cycle {
            return Err(at.wrong(Diagnostic::error("a file includes itself").found(quoted(&name))));
        }
        self.converter.budget.nesting(self.frames.len() + 1, directive).at(at)?;
        let input = Input::open(&path, self.converter.budget).map_err(|e| match e {
            FormatError::Io { action, source, path } => {
                let message = format!("{action} {}: {source}", quoted(&path.display().to_string()));
                at.error(message)
            }
            FormatError::Limit { source, .. } => Fault::Limit(at, source),
            other => other.into(),
        })?;
        let file = self.converter.files.add(input.name().clone(), Some(spot));
        let lexer = Lexer::new(input, file)?;
        let import = (directive == "Import").then(|| Box::new((self.state.clone(), self.scopes.len())));
        self.frames.push(Frame { lexer, canonical, import, is_top: false });
        Ok(())
    }

    /// Ends the file that is being read; answers whether it was a top-level one.
    fn leave_file(&mut self) -> Result<bool> {
        let Some(frame) = self.frames.pop() else { return Ok(true) };
        if let Some((state, depth)) = frame.import.map(|import| *import) {
            if let Some(scope) = self.scopes.get(depth) {
                let message = format!("{} without its {}", scope.kind.begin(), scope.kind.end());
                return Err(scope.spot.error(message));
            }
            self.state = state;
        }
        Ok(frame.is_top)
    }
}

/// `Attribute` may set so many different names for one kind of entity.
const MAX_DEFAULTS: usize = 1024;

fn singular(spot: Spot, directive: &str) -> Fault {
    spot.error(format!("{directive} makes a transform that cannot be inverted"))
}

/// The path of the file `name` that a scene in `directory` asks for: there if there is one, else the name as given.
pub(super) fn resolve(directory: &Path, name: &str) -> PathBuf {
    let beside = directory.join(name);
    if beside.exists() { beside } else { PathBuf::from(name) }
}
