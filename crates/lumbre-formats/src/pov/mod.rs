//! POV-Ray's scene language: its directives and macros, objects, textures, lights and cameras.
//!
//! A scene may read files beside it and in the folders of its library, and no others; what it writes stays in memory.

mod algebraic;
mod blob;
mod build;
mod built_ins;
mod camera;
mod curves;
mod directives;
mod expression;
mod files;
mod fractals;
mod functions;
mod heights;
mod images;
mod iso;
mod job;
mod julia;
mod lexer;
mod lights;
mod maps;
mod media;
mod mesh_tree;
mod meshes;
mod objects;
mod palette;
mod part_tree;
mod patches;
mod patterns;
mod settings;
mod solids;
mod source;
mod sweep;
mod swept;
mod text;
mod textures;
mod transforms;
mod value;
mod words;

use std::collections::HashMap;
use std::path::{Path, PathBuf};
use std::rc::Rc;

use lumbre_scene::SceneDesc;
use lumbre_shading::pov::Media;

use crate::{Budget, Diagnostic, Diagnostics, FormatError, Input};
use camera::CameraStatement;
use lexer::{Kind, Words};
use objects::Object;
use settings::{Fog, Settings, SkySphere};
use source::{Frame, Source};
use textures::Defaults;
use value::{Array, Names, Value};

pub use job::PovJob;

type Result<T> = std::result::Result<T, FormatError>;

/// Options of reading a POV-Ray scene.
#[derive(Clone, Debug, PartialEq)]
#[non_exhaustive]
pub struct PovOptions {
    /// Folders of files that scenes include, after the folder of the scene itself.
    pub library: Vec<PathBuf>,
    /// The value of `clock`.
    pub clock: f64,
    /// The values of `clock` in the first and in the last frame.
    pub clocks: [f64; 2],
    /// The numbers of the first and of the last frame; `None` for a still.
    pub frames: Option<[u32; 2]>,
    /// Numbers and texts that are declared before the scene is read.
    pub declares: Vec<(String, String)>,
    /// The value of `frame_number`.
    pub frame_number: u32,
    /// The value of `image_width`.
    pub width: u32,
    /// The value of `image_height`.
    pub height: u32,
}

impl Default for PovOptions {
    fn default() -> Self {
        Self {
            library: Vec::new(),
            clock: 0.0,
            clocks: [0.0, 1.0],
            frames: None,
            declares: Vec::new(),
            frame_number: 0,
            width: 640,
            height: 480,
        }
    }
}

/// The folders where Debian has POV-Ray's own files.
pub const SYSTEM_LIBRARY: [&str; 3] =
    ["/usr/share/povray-3.7/include", "/usr/share/povray/include", "/usr/share/fonts/truetype/povray"];

/// Reads a scene. `folder` is where the files lie that it includes.
///
/// # Errors
/// [`FormatError`] with the place, and the includes and macros that led to it.
pub fn pov_scene(
    input: &Input<'_>,
    folder: &Path,
    options: &PovOptions,
    budget: &Budget,
    diagnostics: &mut Diagnostics,
) -> Result<SceneDesc> {
    let text = crate::input::lossy_text(input);
    let mut parser = Parser::new(folder, options, budget, diagnostics);
    let source = parser.cut(&text, input.name())?;
    parser.enter(source)?;
    parser.scene()?;
    parser.build()
}

/// Reads a scene from a text, and gives what it wrote to its files, by their names.
///
/// # Errors
/// As for [`pov_scene`].
pub fn written_files(
    text: &str,
    name: &str,
    folder: &Path,
    options: &PovOptions,
    budget: &Budget,
    diagnostics: &mut Diagnostics,
) -> Result<HashMap<String, String>> {
    let mut parser = Parser::new(folder, options, budget, diagnostics);
    let source = parser.cut(text, name)?;
    parser.enter(source)?;
    parser.scene()?;
    Ok(parser.written)
}

/// A scene that is being read.
struct Parser<'a, 'b> {
    budget: &'b Budget,
    diagnostics: &'a mut Diagnostics,
    options: PovOptions,
    folder: PathBuf,
    library: Vec<PathBuf>,
    frames: Vec<Frame>,
    least_frames: usize,
    globals: Names,
    macro_count: usize,
    sources: HashMap<PathBuf, Rc<Source>>,
    words: Words,
    peeked: Option<Kind>,
    /// Where the last token stands.
    here: (Rc<str>, u32, u32),
    steps: u64,
    /// How deep expressions and objects are nested.
    depth: usize,
    /// The frame and the open directives of the declaration that is being read.
    declaring: Option<(usize, usize)>,
    streams: Vec<u32>,
    written: HashMap<String, String>,
    fonts: text::Fonts,
    mesh_trees: mesh_tree::MeshTrees,
    settings: Settings,
    defaults: Defaults,
    default_camera: CameraStatement,
    /// Whether the braces of a light were taken with it.
    light_is_closed: bool,
    /// Whether a texture of the object was just read, so that the next one is a layer on it.
    after_texture: bool,
    /// Whether what is read as a pigment is a density.
    is_density: bool,
    // The scene.
    camera: Option<CameraStatement>,
    objects: Vec<Rc<Object>>,
    background: Option<[f32; 3]>,
    sky: SkySphere,
    fogs: Vec<Fog>,
    /// What fills the air.
    air: Vec<Media>,
}

impl<'a, 'b> Parser<'a, 'b> {
    fn new(
        folder: &Path,
        options: &PovOptions,
        budget: &'b Budget,
        diagnostics: &'a mut Diagnostics,
    ) -> Self {
        let globals = options.declares.iter().map(|(name, value)| {
            let value = match value.parse() {
                Ok(number) => Value::Num(value::Num::float(number)),
                Err(_) => Value::Text(value.trim_matches('"').into()),
            };
            (Rc::from(&**name), Rc::new(std::cell::RefCell::new(value)))
        });
        Self {
            budget,
            diagnostics,
            options: options.clone(),
            folder: folder.to_owned(),
            library: options.library.clone(),
            frames: Vec::new(),
            least_frames: 1,
            globals: globals.collect(),
            macro_count: 0,
            sources: HashMap::new(),
            words: Words::default(),
            peeked: None,
            here: ("".into(), 1, 1),
            steps: 0,
            depth: 0,
            declaring: None,
            streams: Vec::new(),
            written: HashMap::new(),
            fonts: HashMap::new(),
            mesh_trees: HashMap::new(),
            settings: Settings::new(),
            defaults: Defaults::new(),
            default_camera: CameraStatement::DEFAULT,
            light_is_closed: false,
            after_texture: false,
            is_density: false,
            camera: None,
            objects: Vec::new(),
            background: None,
            sky: Vec::new(),
            fogs: Vec::new(),
            air: Vec::new(),
        }
    }

    /// Reads the statements of a scene to its end.
    fn scene(&mut self) -> Result<()> {
        while self.peek()?.is_some() {
            self.statement()?;
        }
        Ok(())
    }

    fn statement(&mut self) -> Result<()> {
        if self.take(b';')? {
            return Ok(());
        }
        if let Some(object) = self.object()? {
            self.objects.push(Rc::new(object));
            return Ok(());
        }
        let Some(word) = self.word()? else {
            return Err(self.unexpected("an object, a light, a camera or a directive"));
        };
        self.peeked = None;
        match &*word {
            "camera" => {
                let camera = self.camera_block(self.default_camera.clone())?;
                self.camera = Some(camera);
            }
            "global_settings" => self.global_settings()?,
            "default" => self.default_directive()?,
            "background" => {
                self.expect(b'{')?;
                let c = self.colour()?.as_colour().rgb;
                self.background = Some([c.r, c.g, c.b]);
                self.expect(b'}')?;
            }
            "fog" => {
                let fog = self.fog_block()?;
                self.fogs.push(fog);
            }
            "sky_sphere" => self.sky = self.sky_sphere_block()?,
            "media" => {
                let media = self.media_block()?;
                self.budget.bytes(size_of::<Media>() as u64, "media")?;
                self.air.push(media);
            }
            "rainbow" => {
                self.warn("rainbow is not rendered");
                self.expect(b'{')?;
                self.skip_to(b'}')?;
            }
            _ => {
                if words::is_reserved(&word) {
                    let wrong = Diagnostic::error("unexpected").found(crate::diagnostic::quoted(&word));
                    let wrong = wrong.expected("an object, a light, a camera or a directive");
                    return Err(self.diagnostic(wrong).into());
                }
                return Err(self.undeclared(&word));
            }
        }
        Ok(())
    }

    /// What an identifier, an element of an array or an argument may be.
    fn value(&mut self) -> Result<Value> {
        if self.is_text()? {
            return Ok(Value::Text(self.string()?.into()));
        }
        if let Some(object) = self.object()? {
            return Ok(match object.form {
                objects::Form::Light(light) => Value::Light(light),
                _ => Value::Object(Rc::new(object)),
            });
        }
        let Some(word) = self.word()? else { return Ok(Value::Num(self.expression()?)) };
        if let Some(map) = self.map(&word)? {
            return Ok(Value::Map(map));
        }
        if let Some(value) = self.block_value(&word)? {
            return Ok(value);
        }
        if words::is_reserved(&word) {
            return Ok(Value::Num(self.expression()?));
        }
        let Some(cell) = self.lookup(&word).cloned() else { return Err(self.undeclared(&word)) };
        let known = cell.borrow().clone();
        match known {
            Value::Num(_) => Ok(Value::Num(self.expression()?)),
            // A call, or the function itself.
            Value::Function(_) | Value::Spline(_) if self.raw_ahead(0) == Some(&Kind::Mark(b'(')) => {
                Ok(Value::Num(self.expression()?))
            }
            Value::Array(array) => {
                let is_number = matches!(array.elements.first(), Some(Value::Num(_)))
                    || array.elements.iter().any(|element| matches!(element, Value::Num(_)));
                if is_number && self.raw_ahead(0) == Some(&Kind::Mark(b'[')) {
                    return self.number_or_part(&array);
                }
                self.peeked = None;
                self.indexed(Value::Array(array))
            }
            Value::Dictionary(_) => {
                self.peeked = None;
                let value = self.indexed(known)?;
                Ok(value)
            }
            other => {
                self.peeked = None;
                Ok(other)
            }
        }
    }

    /// A part of an array, or an expression that begins with an element.
    fn number_or_part(&mut self, array: &Rc<Array>) -> Result<Value> {
        // A part has fewer indices than there are dimensions: as many brackets as follow at once.
        let mut ahead = 0;
        let mut indices = 0;
        while self.raw_ahead(ahead) == Some(&Kind::Mark(b'[')) {
            let mut open = 0_usize;
            loop {
                match self.raw_ahead(ahead) {
                    Some(Kind::Mark(b'[')) => open += 1,
                    Some(Kind::Mark(b']')) => open -= 1,
                    None => break,
                    _ => {}
                }
                ahead += 1;
                if open == 0 {
                    break;
                }
            }
            indices += 1;
            if self.raw_ahead(ahead).is_none() {
                break;
            }
        }
        if indices < array.sizes.len() {
            self.peeked = None;
            return self.indexed(Value::Array(Rc::clone(array)));
        }
        Ok(Value::Num(self.expression()?))
    }

    /// What is in braces behind a word: textures and their parts, cameras, functions, arrays.
    fn block_value(&mut self, word: &Rc<str>) -> Result<Option<Value>> {
        let take = |parser: &mut Self| {
            parser.peeked = None;
        };
        Ok(Some(match &**word {
            "texture" => {
                let mut texture = None;
                while !self.ends_here()? && self.take_word("texture")? {
                    self.expect(b'{')?;
                    let next = self.texture_body(b'}')?;
                    texture = Some(textures::layered(texture, next));
                }
                match texture {
                    Some(texture) => Value::Texture(texture),
                    None => return Err(self.unexpected("a texture")),
                }
            }
            "pigment" => {
                take(self);
                self.expect(b'{')?;
                Value::Pigment(self.pigment_body(None, b'}')?)
            }
            "normal" => {
                take(self);
                self.expect(b'{')?;
                Value::Normal(self.normal_body(None, b'}')?)
            }
            "finish" => {
                take(self);
                let base = (*self.defaults.layer.finish).clone();
                Value::Finish(Rc::new(self.finish_block(base)?))
            }
            "interior" => {
                take(self);
                Value::Interior(self.interior_block()?)
            }
            "material" => {
                take(self);
                Value::Material(Rc::new(self.material_block()?))
            }
            "transform" | "translate" | "rotate" | "scale" | "matrix" => match self.transform()? {
                Some(map) => Value::Transform(map),
                None => return Ok(None),
            },
            "camera" => {
                take(self);
                camera::shared(self.camera_block(self.default_camera.clone())?)
            }
            "fog" => {
                take(self);
                settings::shared(self.fog_block()?)
            }
            "sky_sphere" => {
                take(self);
                Value::SkySphere(Rc::new(self.sky_sphere_block()?))
            }
            "function" => {
                take(self);
                Value::Function(self.function()?)
            }
            "spline" => {
                take(self);
                Value::Spline(self.spline_block()?)
            }
            "array" => {
                take(self);
                Value::Array(Rc::new(self.array()?))
            }
            "dictionary" => {
                take(self);
                self.dictionary()?
            }
            "media" => {
                take(self);
                Value::Media(Rc::new(self.media_block()?))
            }
            "density" => {
                take(self);
                Value::Density(self.density_block()?)
            }
            "rainbow" => {
                take(self);
                self.expect(b'{')?;
                self.skip_to(b'}')?;
                Value::Ignored("a rainbow")
            }
            _ => return Ok(None),
        }))
    }

    /// An array, whose word was taken.
    fn array(&mut self) -> Result<Array> {
        self.take_word("mixed")?;
        let mut sizes: Vec<usize> = Vec::new();
        while !self.ends_here()? && self.take(b'[')? {
            let size = self.float()?;
            self.expect(b']')?;
            if !(1.0..=1e9).contains(&size) || sizes.len() == 5 {
                return Err(self.error("an array has up to five dimensions, each of 1 or more"));
            }
            sizes.push(size as usize);
        }
        if sizes.is_empty() {
            // By what it holds.
            let mut elements = Vec::new();
            self.expect(b'{')?;
            while !self.take(b'}')? {
                self.budget.bytes(size_of::<Value>() as u64, "arrays")?;
                elements.push(self.value()?);
                self.comma()?;
            }
            return Ok(Array { sizes: vec![elements.len()], elements });
        }
        let count =
            sizes.iter().try_fold(1_u64, |count, &size| count.checked_mul(size as u64)).unwrap_or(u64::MAX);
        let mut elements = self.budget.vec(count, "arrays")?;
        elements.resize(count as usize, Value::Nothing);
        let mut array = Array { sizes, elements };
        if !self.ends_here()? && self.is_mark(b'{')? {
            self.array_values(&mut array, 0, 0)?;
        }
        Ok(array)
    }

    fn array_values(&mut self, array: &mut Array, dimension: usize, offset: usize) -> Result<()> {
        self.expect(b'{')?;
        let stride: usize = array.sizes[dimension + 1..].iter().product();
        for i in 0..array.sizes[dimension] {
            if self.is_mark(b'}')? {
                break;
            }
            let at = offset + i * stride;
            if dimension + 1 < array.sizes.len() {
                self.array_values(array, dimension + 1, at)?;
            } else {
                array.elements[at] = self.value()?;
            }
            self.comma()?;
        }
        self.expect(b'}')
    }

    fn dictionary(&mut self) -> Result<Value> {
        let mut entries: HashMap<Rc<str>, Value> = HashMap::new();
        if !self.ends_here()? && self.take(b'{')? {
            while !self.take(b'}')? {
                let key: Rc<str> = if self.take(b'[')? {
                    let key = self.string()?.into();
                    self.expect(b']')?;
                    key
                } else {
                    let Some(key) = self.word()? else { return Err(self.unexpected("a key")) };
                    self.peeked = None;
                    key
                };
                self.expect(b':')?;
                self.budget.bytes(size_of::<Value>() as u64 + 32, "dictionaries")?;
                let value = self.value()?;
                entries.insert(key, value);
                self.comma()?;
            }
        }
        Ok(Value::Dictionary(Rc::new(entries)))
    }
}
