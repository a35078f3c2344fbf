//! Objects: shapes, what is made of them, and what modifies them.

use std::rc::Rc;
use std::sync::Arc;

use lumbre_math::{DVec3, Transform};
use lumbre_scene::MeshDesc;
use lumbre_shading::pov::{InsideTest, Interior, PatternKind, Texture, Visibility};

use super::algebraic::{Algebraic, MAX_DEGREE};
use super::lights::LightStatement;
use super::textures::{layered, moved_interior};
use super::value::{Num, Value};
use super::{Parser, Result};
use crate::Diagnostic;
use crate::diagnostic::quoted;

/// An object.
#[derive(Clone, Debug)]
pub(super) struct Object {
    pub form: Form,
    /// Where it is, after everything that is written in it.
    pub transform: Transform,
    pub texture: Option<Arc<Texture>>,
    pub interior_texture: Option<Arc<Texture>>,
    pub interior: Option<Arc<Interior>>,
    pub visibility: Visibility,
    pub hollow: bool,
    pub double_illuminate: bool,
    pub uv_mapping: bool,
    pub inverse: bool,
    /// What it is cut off by, each in the object's own space before its transforms.
    pub clipped_by: Vec<Rc<Object>>,
    /// What bounds it: it is cut by them where `clipped_by` names them.
    pub bounded_by: Vec<Rc<Object>>,
}

/// What an object is.
#[derive(Clone, Debug)]
pub(super) enum Form {
    Sphere(DVec3, f64),
    Cuboid(DVec3, DVec3),
    /// From a point with a radius to another, closed or open.
    Cone {
        ends: [DVec3; 2],
        radii: [f64; 2],
        open: bool,
    },
    Torus(f64, f64),
    /// The unit normal and the distance along it.
    Plane(DVec3, f64),
    Disc {
        center: DVec3,
        normal: DVec3,
        radius: f64,
        hole: f64,
    },
    Triangle([DVec3; 3]),
    /// Triangles, and what they enclose.
    Mesh(Arc<MeshDesc>, Option<Arc<super::mesh_tree::Enclosure>>),
    /// The exponents of a superellipsoid.
    Superellipsoid(f64, f64),
    Poly(Arc<Algebraic>),
    Blob(Arc<super::blob::Blob>),
    Heights(Arc<super::heights::Heights>),
    Swept(Arc<super::swept::Swept>),
    Iso(Arc<super::iso::Iso>),
    Sweep(Arc<super::sweep::Sweep>),
    Julia(Arc<super::julia::Julia>),
    Group(Operation, Vec<Rc<Object>>),
    Light(Rc<LightStatement>),
    /// A group of lights that light only its objects.
    LightGroup(Vec<Rc<Object>>, bool),
    /// What is read over.
    Nothing,
}

/// What is made of several objects.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Operation {
    Union,
    Merge,
    Intersection,
    Difference,
}

impl Object {
    pub(super) fn new(form: Form) -> Self {
        Self {
            form,
            transform: Transform::IDENTITY,
            texture: None,
            interior_texture: None,
            interior: None,
            visibility: Visibility::default(),
            hollow: false,
            double_illuminate: false,
            uv_mapping: false,
            inverse: false,
            clipped_by: Vec::new(),
            bounded_by: Vec::new(),
        }
    }

    fn move_by(&mut self, map: &Arc<Transform>) {
        self.transform = **map * self.transform;
        // Textures in the coordinates of a surface stay on it.
        if !self.uv_mapping {
            self.texture = self.texture.take().map(|texture| texture.carried(map));
            self.interior_texture = self.interior_texture.take().map(|texture| texture.carried(map));
        }
        self.interior = self.interior.take().map(|interior| moved_interior(interior, map));
        if let Form::Light(light) = &self.form {
            self.form = Form::Light(Rc::new(light.moved(map)));
            self.transform = Transform::IDENTITY;
        }
    }
}

/// Superellipsoids of smaller exponents have this one: their edges are as sharp as can be told.
const MIN_EXPONENT: f64 = 1e-3;

impl Parser<'_, '_> {
    /// The object of a word, which comes next; `None` if it is the word of none.
    pub(super) fn object(&mut self) -> Result<Option<Object>> {
        let Some(word) = self.word()? else { return Ok(None) };
        let is_object = matches!(
            &*word,
            "sphere"
                | "box"
                | "cylinder"
                | "cone"
                | "torus"
                | "plane"
                | "disc"
                | "triangle"
                | "smooth_triangle"
                | "mesh"
                | "mesh2"
                | "superellipsoid"
                | "quadric"
                | "cubic"
                | "quartic"
                | "poly"
                | "polygon"
                | "blob"
                | "union"
                | "merge"
                | "intersection"
                | "difference"
                | "object"
                | "light_source"
                | "light_group"
                | "height_field"
                | "isosurface"
                | "text"
                | "lathe"
                | "sor"
                | "prism"
                | "sphere_sweep"
                | "bicubic_patch"
                | "julia_fractal"
                | "parametric"
                | "ovus"
        );
        if !is_object {
            return Ok(None);
        }
        self.depth += 1;
        self.budget.nesting(self.depth, "objects")?;
        self.budget.elements(1, "objects")?;
        self.budget.bytes(size_of::<Object>() as u64, "objects")?;
        self.peeked = None;
        let outer = self.declaring.take();
        self.expect(b'{')?;
        let mut object =
            if let Some(object) = self.named_object(&word)? { object } else { self.object_form(&word)? };
        self.modifiers(&mut object)?;
        self.declaring = outer;
        self.depth -= 1;
        Ok(Some(object))
    }

    /// The name of an object in the braces of a shape's word.
    fn named_object(&mut self, word: &str) -> Result<Option<Object>> {
        let Some(name) = self.word()? else { return Ok(None) };
        if super::words::is_reserved(&name) {
            return Ok(None);
        }
        let Some(cell) = self.lookup(&name).cloned() else {
            return if word == "object" { Err(self.undeclared(&name)) } else { Ok(None) };
        };
        let found = match &*cell.borrow() {
            Value::Object(object) => Some((**object).clone()),
            Value::Light(light) => Some(Object::new(Form::Light(Rc::clone(light)))),
            Value::Array(_) if word == "object" => None,
            _ => return Ok(None),
        };
        // `union { A B }` begins with the name of a part.
        if matches!(word, "union" | "merge" | "intersection" | "difference" | "light_group") {
            return Ok(None);
        }
        self.peeked = None;
        let value = match found {
            Some(object) => return Ok(Some(object)),
            None => cell.borrow().clone(),
        };
        match self.indexed(value)? {
            Value::Object(object) => Ok(Some((*object).clone())),
            other => Err(self.error(format!("an object is needed, not {}", other.name()))),
        }
    }

    fn object_form(&mut self, word: &str) -> Result<Object> {
        let form = match word {
            "sphere" => {
                let center = self.vector()?;
                self.comma()?;
                Form::Sphere(center, self.finite()?)
            }
            "box" => {
                let low = self.vector()?;
                self.comma()?;
                Form::Cuboid(low, self.vector()?)
            }
            "cylinder" => {
                let ends = self.two_points()?;
                self.comma()?;
                let radius = self.finite()?;
                let open = self.take_word("open")?;
                Form::Cone { ends, radii: [radius, radius], open }
            }
            "cone" => {
                let from = self.vector()?;
                self.comma()?;
                let first = self.finite()?;
                self.comma()?;
                let to = self.vector()?;
                self.comma()?;
                let second = self.finite()?;
                let open = self.take_word("open")?;
                Form::Cone { ends: [from, to], radii: [first, second], open }
            }
            "torus" => {
                let major = self.finite()?;
                self.comma()?;
                Form::Torus(major, self.finite()?)
            }
            "plane" => {
                let normal = self.vector()?;
                self.comma()?;
                let distance = self.finite()?;
                match normal.try_normalize() {
                    Some(unit) => Form::Plane(unit, distance),
                    None => return Err(self.error("a plane whose normal has a length of 0")),
                }
            }
            "disc" => {
                let center = self.vector()?;
                self.comma()?;
                let normal = self.vector()?;
                self.comma()?;
                let radius = self.finite()?;
                let hole = if self.take(b',')? { self.finite()? } else { 0.0 };
                Form::Disc { center, normal: normal.normalize_or(DVec3::Y), radius, hole }
            }
            "triangle" => {
                let mut corners = [DVec3::ZERO; 3];
                for corner in &mut corners {
                    *corner = self.vector()?;
                    self.comma()?;
                }
                Form::Triangle(corners)
            }
            "smooth_triangle" => self.smooth_triangle()?,
            "mesh" => return self.mesh(),
            "mesh2" => return self.mesh2(),
            "polygon" => self.polygon()?,
            "superellipsoid" => {
                let [e, n, ..] = self.expression()?.promoted(2);
                if !(e >= 0.0 && n >= 0.0) {
                    return Err(self.error("a superellipsoid has two exponents that are not negative"));
                }
                Form::Superellipsoid(e.max(MIN_EXPONENT), n.max(MIN_EXPONENT))
            }
            "quadric" => self.quadric()?,
            "cubic" => self.poly(3)?,
            "quartic" => self.poly(4)?,
            "poly" => {
                let degree = self.whole(0.0, 99.0)?;
                self.comma()?;
                if !(2..=MAX_DEGREE).contains(&degree) {
                    return Err(self.error("the degree of a poly is from 2 to 15"));
                }
                self.poly(degree)?
            }
            "blob" => return self.blob(),
            "prism" => self.prism()?,
            "lathe" => self.lathe()?,
            "sor" => self.sor()?,
            "text" => self.text()?,
            "bicubic_patch" => self.bicubic_patch()?,
            "isosurface" => self.isosurface()?,
            "sphere_sweep" => self.sphere_sweep()?,
            "julia_fractal" => self.julia_fractal()?,
            "height_field" => self.height_field()?,
            "union" | "merge" | "intersection" | "difference" => {
                let operation = match word {
                    "union" => Operation::Union,
                    "merge" => Operation::Merge,
                    "intersection" => Operation::Intersection,
                    _ => Operation::Difference,
                };
                let parts = self.parts()?;
                Form::Group(operation, parts)
            }
            "light_source" => {
                let light = self.light_body()?;
                // Its brace is taken: the rest of what modifies an object has none.
                return Ok(Object::new(Form::Light(Rc::new(light))));
            }
            "light_group" => {
                // Lights of no group light it only where `global_lights` says so.
                Form::LightGroup(self.parts()?, false)
            }
            "object" => match self.object()? {
                Some(inner) => return Ok(inner),
                None => return Err(self.unexpected("an object")),
            },
            _ => return self.skipped(word),
        };
        Ok(Object::new(form))
    }

    /// An object that is not rendered, up to its closing brace, which stays.
    fn skipped(&mut self, word: &str) -> Result<Object> {
        self.warn(&format!("the object {word} is not rendered"));
        let mut open = 0_u32;
        loop {
            use super::lexer::Kind;
            match self.peek()? {
                Some(Kind::Mark(b'}')) if open == 0 => return Ok(Object::new(Form::Nothing)),
                Some(Kind::Mark(b'{')) => open += 1,
                Some(Kind::Mark(b'}')) => open -= 1,
                None => return Err(self.error("the scene ends in an object")),
                _ => {}
            }
            self.peeked = None;
        }
    }

    fn two_points(&mut self) -> Result<[DVec3; 2]> {
        let from = self.vector()?;
        self.comma()?;
        Ok([from, self.vector()?])
    }

    /// Objects, one after another.
    fn parts(&mut self) -> Result<Vec<Rc<Object>>> {
        let mut parts = Vec::new();
        loop {
            self.comma()?;
            if let Some(object) = self.object()? {
                parts.push(Rc::new(object));
                continue;
            }
            let Some(name) = self.word()? else { break };
            let is_object = |value: &Value| match value {
                Value::Object(_) | Value::Light(_) => true,
                Value::Array(array) => matches!(array.elements.first(), Some(Value::Object(_))),
                _ => false,
            };
            if !self.lookup(&name).is_some_and(|cell| is_object(&cell.borrow())) {
                break;
            }
            self.peeked = None;
            match self.known(&name)? {
                Some(Value::Object(object)) => parts.push(object),
                Some(Value::Light(light)) => parts.push(Rc::new(Object::new(Form::Light(light)))),
                _ => return Err(self.unexpected("an object")),
            }
        }
        Ok(parts)
    }

    /// What modifies an object, up to its closing brace.
    pub(super) fn modifiers(&mut self, object: &mut Object) -> Result<()> {
        if matches!(object.form, Form::Light(_)) && self.light_is_closed {
            self.light_is_closed = false;
            return Ok(());
        }
        while !self.take(b'}')? {
            if self.take(b',')? || self.take(b';')? {
                continue;
            }
            if let Some(map) = self.transform()? {
                object.move_by(&map);
                continue;
            }
            let Some(word) = self.word()? else { return Err(self.unexpected("what modifies an object")) };
            self.peeked = None;
            match &*word {
                "texture" => {
                    self.expect(b'{')?;
                    let texture = self.texture_body(b'}')?;
                    // Textures that follow each other are layers.
                    let below = if self.after_texture { object.texture.take() } else { None };
                    object.texture = Some(layered(below, texture));
                    self.after_texture = true;
                    continue;
                }
                "pigment" | "normal" | "finish" => self.part_of_texture(&word, object)?,
                "interior_texture" => {
                    self.expect(b'{')?;
                    object.interior_texture = Some(self.texture_body(b'}')?);
                }
                "material" => {
                    let material = self.material_block()?;
                    object.texture = material.texture.or(object.texture.take());
                    object.interior_texture = material.interior_texture.or(object.interior_texture.take());
                    object.interior = material.interior.or(object.interior.take());
                }
                "interior" => object.interior = Some(self.interior_block()?),
                "clipped_by" => self.clipped_by(object)?,
                // A hint, unless the object is clipped by it.
                "bounded_by" => {
                    let bounds = self.clips(object)?;
                    object.bounded_by.extend(bounds);
                }
                "inverse" => object.inverse = !object.inverse,
                "hollow" => object.hollow = self.optional_bool()?,
                "no_shadow" => object.visibility.no_shadow = self.optional_bool()?,
                "no_image" => object.visibility.no_image = self.optional_bool()?,
                "no_reflection" => object.visibility.no_reflection = self.optional_bool()?,
                "double_illuminate" => object.double_illuminate = self.optional_bool()?,
                "global_lights" if matches!(object.form, Form::LightGroup(..)) => {
                    let on = self.optional_bool()?;
                    if let Form::LightGroup(_, global) = &mut object.form {
                        *global = on;
                    }
                }
                "uv_mapping" => object.uv_mapping = self.optional_bool()?,
                "no_radiosity" | "sturm" | "hierarchy" | "cutaway_textures" | "split_union" | "evaluate"
                | "smooth" => {
                    self.optional_bool()?;
                }
                "photons" | "radiosity" => {
                    self.expect(b'{')?;
                    self.skip_to(b'}')?;
                }
                "open" => {}
                "uv_vectors" => {
                    while self.is_mark(b'<')? {
                        self.vector()?;
                        self.comma()?;
                    }
                }
                "water_level" | "tolerance" => {
                    self.float()?;
                }
                _ => {
                    let wrong = Diagnostic::error("unexpected in an object").found(quoted(&word));
                    return Err(self.diagnostic(wrong).into());
                }
            }
            self.after_texture = false;
        }
        self.after_texture = false;
        Ok(())
    }

    fn part_of_texture(&mut self, word: &str, object: &mut Object) -> Result<()> {
        let known = object.texture.take().unwrap_or_else(|| self.defaults.texture());
        object.texture = Some(self.changed_texture(word, &known)?);
        Ok(())
    }

    fn clipped_by(&mut self, object: &mut Object) -> Result<()> {
        let clips = self.clips(object)?;
        object.clipped_by.extend(clips);
        Ok(())
    }

    /// The objects in the braces of `clipped_by` or `bounded_by`, of which either may name the other.
    fn clips(&mut self, object: &Object) -> Result<Vec<Rc<Object>>> {
        self.expect(b'{')?;
        let named = if self.take_word("bounded_by")? {
            Some(object.bounded_by.clone())
        } else if self.take_word("clipped_by")? {
            Some(object.clipped_by.clone())
        } else {
            None
        };
        let clips = match named {
            Some(named) => named,
            None => {
                // In the object's own space, so that later transforms move both.
                let inverse = object.transform.inverse();
                let moved = |part: Rc<Object>| {
                    Rc::new(Object { transform: inverse * part.transform, ..(*part).clone() })
                };
                self.parts()?.into_iter().map(moved).collect()
            }
        };
        self.expect(b'}')?;
        Ok(clips)
    }

    fn quadric(&mut self) -> Result<Form> {
        let mut v = [DVec3::ZERO; 3];
        for v in &mut v {
            *v = self.vector()?;
            self.comma()?;
        }
        let j = self.finite()?;
        let [square, mixed, linear] = v;
        // In falling powers of x, then y, then z.
        let terms =
            [square.x, mixed.x, mixed.y, linear.x, square.y, mixed.z, linear.y, square.z, linear.z, j];
        Ok(Form::Poly(Arc::new(Algebraic::new(2, Arc::from(terms)))))
    }

    fn poly(&mut self, degree: u32) -> Result<Form> {
        let count = ((degree + 1) * (degree + 2) * (degree + 3) / 6) as usize;
        self.expect(b'<')?;
        let mut terms = Vec::with_capacity(count);
        while !self.take(b'>')? {
            if terms.len() == count {
                return Err(self.error("too many coefficients"));
            }
            terms.push(self.finite()?);
            self.comma()?;
        }
        if terms.len() != count {
            let wrong = Diagnostic::error("too few coefficients").found(terms.len()).expected(count);
            return Err(self.diagnostic(wrong).into());
        }
        Ok(Form::Poly(Arc::new(Algebraic::new(degree, terms.into()))))
    }

    /// `object { … }` as a pattern: 1 inside of the object, 0 outside. What it names stands behind the object, before
    /// the brace that closes it.
    pub(super) fn inside_pattern(&mut self) -> Result<PatternKind> {
        self.expect(b'{')?;
        let object = match self.object()? {
            Some(object) => Rc::new(object),
            None => self.object_argument()?,
        };
        let region = super::solids::Region::of(&object, &Transform::IDENTITY);
        Ok(PatternKind::Inside(InsideTest(Arc::new(move |p| region.contains(p)))))
    }

    /// The object of a name, for functions that ask about it.
    fn object_argument(&mut self) -> Result<Rc<Object>> {
        let Some(name) = self.word()? else { return Err(self.unexpected("the name of an object")) };
        let Some(cell) = self.lookup(&name).cloned() else { return Err(self.undeclared(&name)) };
        self.peeked = None;
        let value = cell.borrow().clone();
        match self.indexed(value)? {
            Value::Object(object) => Ok(object),
            other => Err(self.error(format!("an object is needed, not {}", other.name()))),
        }
    }

    /// `inside`, `trace`, `min_extent` and `max_extent`.
    pub(super) fn of_object(&mut self, word: &str) -> Result<Num> {
        self.expect(b'(')?;
        let object = self.object_argument()?;
        let value = match word {
            "inside" => {
                self.comma()?;
                let p = self.vector()?;
                Num::float(f64::from(u8::from(super::solids::contains(&object, p))))
            }
            "trace" => {
                self.comma()?;
                let from = self.vector()?;
                self.comma()?;
                let direction = self.vector()?;
                let hit = super::solids::trace(&mut self.mesh_trees, &object, from, direction);
                if self.take(b',')? {
                    let Some(name) = self.word()? else { return Err(self.unexpected("an identifier")) };
                    let Some(cell) = self.lookup(&name).cloned() else { return Err(self.undeclared(&name)) };
                    self.peeked = None;
                    let normal = hit.map_or(DVec3::ZERO, |(_, normal)| normal);
                    *cell.borrow_mut() = Value::Num(Num::vector(normal));
                }
                Num::vector(hit.map_or(DVec3::ZERO, |(point, _)| point))
            }
            _ => {
                let bounds = super::solids::bounds(&object);
                let far = 1e10;
                let (low, high) = bounds.map_or((DVec3::splat(-far), DVec3::splat(far)), |b| (b.min, b.max));
                Num::vector(if word == "min_extent" { low } else { high })
            }
        };
        self.expect(b')')?;
        Ok(value)
    }
}
