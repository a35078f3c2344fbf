//! Wavefront OBJ meshes with MTL materials (Wavefront Technologies, "Advanced Visualizer manual", appendices B1
//! and the MTL file format, version 4.2, 1995; vertex colours and PBR keys as later programs write them).

mod mtl;
mod scene;
mod words;

use std::cell::Cell;
use std::collections::hash_map::Entry;
use std::collections::{HashMap, HashSet};
use std::sync::Arc;

use lumbre_image::Rgb;
use lumbre_math::{DVec3, Elementary, Vec2, Vec3};
use lumbre_scene::MeshDesc;

use crate::budget::{Budget, BudgetVec};
use crate::diagnostic::{Diagnostic, Diagnostics, FormatError, Place, TextPlaces};
use crate::input::narrow_text;
use crate::origin::{is_without_area, origin_of, relative};
use crate::polygon;
use crate::thin::Thin;
use words::{Source, Word, Words};

pub use mtl::{MtlMaterial, MtlTexture, read_mtl};
pub(crate) use scene::obj_scene;
pub use scene::open_obj;

/// The contents of an OBJ file.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct ObjFile {
    /// The meshes, in the order of their first faces.
    pub meshes: Vec<ObjMesh>,
    /// Points and lines, by name and material.
    pub thin: Vec<ObjThin>,
    /// What all positions are relative to: zero, unless the whole model is far from there.
    pub origin: DVec3,
    /// The diagonal of the bounding box of all vertices.
    pub size: f64,
    /// The material libraries that it names, each with its first place.
    pub libraries: Vec<(String, Place)>,
}

/// The points and lines of an OBJ file with the same material.
#[derive(Clone, Debug, PartialEq)]
pub struct ObjThin {
    /// The material (`usemtl`), with the place of its first use here.
    pub material: Option<(String, Place)>,
    /// The points and lines themselves.
    pub thin: Thin,
}

/// The faces of an OBJ file with the same name, material and set of attributes.
#[derive(Clone, Debug, PartialEq)]
pub struct ObjMesh {
    /// The object (`o`) or, in a file without objects, the group (`g`); may be empty.
    pub name: String,
    /// The material (`usemtl`), with the place of its first use for this mesh.
    pub material: Option<(String, Place)>,
    /// Triangles only. Corners with different texture coordinate or normal are separate vertices.
    pub mesh: Arc<MeshDesc>,
}

/// Reads meshes from the bytes of an OBJ file. Material libraries are named, not opened: see [`open_obj`].
///
/// Vertex colours (`v x y z r g b`) are linear. Faces of a smoothing group (`s`) without normals get those of
/// smooth surfaces. Curves and surfaces are ignored with a warning. UTF-16 is read by its byte order mark.
///
/// # Errors
/// [`FormatError::Input`] with line and column; [`FormatError::Limit`]. When lenient, unusable faces are
/// dropped with a warning instead.
pub fn read_obj(
    bytes: &[u8],
    name: &Arc<str>,
    budget: &Budget,
    diagnostics: &mut Diagnostics,
) -> Result<ObjFile, FormatError> {
    let decoded = narrow_text(bytes, name, budget)?;
    let bytes = &*decoded;
    let places = TextPlaces::default();
    let source = Source { name, bytes, places: &places };
    let mut reader = Reader::new(source, budget, diagnostics);
    for line in source.lines() {
        let mut words = line.words();
        if let Some(keyword) = words.next() {
            reader.line(keyword, words).map_err(|e| e.or_at(|| source.place(keyword.start)))?;
        }
    }
    reader.finish().map_err(|e| e.or_at(|| Place::whole(name.clone())))
}

/// A corner of a face: position, texture coordinate, normal; `NONE` if absent.
type Corner = [u32; 3];

const NONE: u32 = u32::MAX;

/// What the faces of a mesh have in common; names by index.
#[derive(Clone, Copy, Default, PartialEq, Eq, Hash)]
struct Key {
    object: u32,
    group: u32,
    material: u32,
    has_uvs: bool,
    has_normals: bool,
    /// Whether these normals are made, those of a smoothing group.
    is_smoothed: bool,
}

struct Part<'a> {
    key: Key,
    /// The place of its material's name.
    material_at: usize,
    triangles: BudgetVec<'a, [Corner; 3]>,
    /// Few have any.
    thin: Option<Box<ThinPart<'a>>>,
}

/// Points, and segments of lines with whether the line goes on; by position.
struct ThinPart<'a> {
    points: BudgetVec<'a, u32>,
    segments: BudgetVec<'a, ([u32; 2], bool)>,
}

/// A face to be read at the end, with its state.
#[derive(Clone)]
struct Later<'a> {
    keyword: Word<'a>,
    words: Words<'a>,
    state: Key,
    material_at: usize,
    counts: [usize; 3],
    smoothing: u32,
}

struct Reader<'a> {
    source: Source<'a>,
    budget: &'a Budget,
    diagnostics: &'a mut Diagnostics,
    positions: BudgetVec<'a, DVec3>,
    /// One per position once any has a colour.
    colours: BudgetVec<'a, Rgb>,
    uvs: BudgetVec<'a, Vec2>,
    normals: BudgetVec<'a, Vec3>,
    /// When lenient, positions that are not finite.
    unusable: Vec<u32>,
    /// Texture coordinates and normals that are not finite, by index, with where they stand.
    flaws: [BudgetVec<'a, (u32, usize)>; 2],
    /// Every name, 0 for none.
    names: Vec<Arc<str>>,
    numbers: HashMap<Arc<str>, u32>,
    /// The state for the next face.
    state: Key,
    material_at: usize,
    has_objects: bool,
    /// The smoothing group; 0 for none.
    smoothing: u32,
    /// The sums of normals of smooth surfaces, and their numbers by group and position.
    smooth_normals: BudgetVec<'a, DVec3>,
    smooth_numbers: HashMap<(u32, u32), u32>,
    parts: Vec<Part<'a>>,
    part_of: HashMap<Key, usize>,
    /// The part of the last face.
    current: Option<usize>,
    libraries: Vec<(String, Place)>,
    library_names: HashSet<String>,
    /// Faces with forward references.
    later: BudgetVec<'a, Later<'a>>,
    /// Set when everything is read: the counts to which negative indices of those faces are relative.
    at_end: Option<[usize; 3]>,
    /// Whether faces refer to missing texture coordinates, and normals.
    missing: [Cell<bool>; 2],
    /// The corners of one face, kept for their capacity.
    face: Vec<Corner>,
    places: Vec<Vec3>,
}

impl<'a> Reader<'a> {
    fn new(source: Source<'a>, budget: &'a Budget, diagnostics: &'a mut Diagnostics) -> Self {
        Self {
            source,
            budget,
            diagnostics,
            positions: BudgetVec::new(budget, "vertices"),
            colours: BudgetVec::new(budget, "colours"),
            uvs: BudgetVec::new(budget, "texture coordinates"),
            normals: BudgetVec::new(budget, "normals"),
            unusable: vec![],
            flaws: [BudgetVec::new(budget, "flaws"), BudgetVec::new(budget, "flaws")],
            names: vec!["".into()],
            numbers: HashMap::new(),
            state: Key::default(),
            material_at: 0,
            has_objects: false,
            smoothing: 0,
            smooth_normals: BudgetVec::new(budget, "normals"),
            smooth_numbers: HashMap::new(),
            parts: vec![],
            part_of: HashMap::new(),
            current: None,
            libraries: vec![],
            library_names: HashSet::new(),
            later: BudgetVec::new(budget, "faces"),
            at_end: None,
            missing: Default::default(),
            face: vec![],
            places: vec![],
        }
    }

    #[inline]
    fn line(&mut self, keyword: Word<'a>, words: Words<'a>) -> Result<(), FormatError> {
        match keyword.bytes {
            b"v" => self.position(keyword, words),
            b"vt" => {
                let ([u, v, _], count, word) = self.numbers(keyword, words)?;
                if count == 0 || count > 3 {
                    return Err(self.wrong_count(keyword, count, "1 to 3").into());
                }
                let uv = Vec2::new(u as f32, v as f32);
                if !uv.is_finite() {
                    self.flaws[0].push((self.uvs.len() as u32, word.start))?;
                }
                Ok(self.uvs.push(if uv.is_finite() { uv } else { Vec2::ZERO })?)
            }
            b"vn" => {
                let (n, count, word) = self.numbers(keyword, words)?;
                if count != 3 {
                    return Err(self.wrong_count(keyword, count, "3").into());
                }
                let n = DVec3::from(n).as_vec3();
                if !n.is_finite() {
                    self.flaws[1].push((self.normals.len() as u32, word.start))?;
                }
                Ok(self.normals.push(if n.is_finite() { n } else { Vec3::ZERO })?)
            }
            b"f" | b"fo" => self.face(keyword, words),
            b"usemtl" => {
                let (at, name) = words.rest();
                self.state.material = self.number_of(&name)?;
                self.material_at = at;
                Ok(())
            }
            b"o" => {
                self.state.object = self.number_of(&words.rest().1)?;
                self.has_objects = true;
                Ok(())
            }
            b"g" => {
                self.state.group = self.number_of(&words.rest().1)?;
                Ok(())
            }
            b"mtllib" => {
                let (at, name) = words.rest();
                self.budget.elements(1, "material files")?;
                if name.is_empty() {
                    self.diagnostics.warn("mtllib without a name", |said| said.at(self.source.place(at)));
                } else if self.library_names.insert(name.clone().into_owned()) {
                    self.budget.bytes(2 * name.len() as u64 + 128, "material files")?;
                    self.libraries.push((name.into_owned(), self.source.place(at)));
                }
                Ok(())
            }
            b"s" => {
                let group = { words }.next().map_or(&b"off"[..], |word| word.bytes);
                let number = std::str::from_utf8(group).ok().and_then(|text| text.parse::<u32>().ok());
                self.smoothing = number.unwrap_or(u32::from(group == b"on"));
                Ok(())
            }
            b"l" | b"p" => self.thin(keyword, words),
            b"vp" | b"cstype" | b"deg" | b"bmat" | b"step" | b"curv" | b"curv2" | b"surf" | b"parm"
            | b"trim" | b"hole" | b"scrv" | b"sp" | b"end" | b"con" | b"ctech" | b"stech" => {
                self.pass_over(keyword, "free-form curves and surfaces are not supported, and left out");
                Ok(())
            }
            // Display hints for other programs.
            b"mg" | b"bevel" | b"c_interp" | b"d_interp" | b"lod" | b"usemap" | b"maplib" | b"shadow_obj"
            | b"trace_obj" | b"mm_color" | b"vw" => Ok(()),
            _ => {
                let known = ["v", "vt", "vn", "f", "usemtl", "mtllib"];
                let text = String::from_utf8_lossy(&keyword.bytes[..keyword.bytes.len().min(64)]);
                let source = self.source;
                self.diagnostics.warn("line with an unknown keyword is left out", |said| {
                    Diagnostic { severity: said.severity, ..source.wrong(keyword, said.message) }
                        .suggest(&text, known)
                });
                Ok(())
            }
        }
    }

    fn pass_over(&mut self, keyword: Word<'_>, what: &str) {
        let source = self.source;
        self.diagnostics.warn(what, |said| said.at(source.place(keyword.start)));
    }

    fn wrong_count(&self, keyword: Word<'_>, count: usize, expected: &str) -> Diagnostic {
        let name = String::from_utf8_lossy(keyword.bytes);
        let wrong = Diagnostic::error(format!("wrong number of values after {name}"));
        wrong.at(self.source.place(keyword.start)).found(count).expected(expected)
    }

    /// The first numbers of a line, their count, and the first word for messages.
    #[inline]
    fn numbers<const N: usize>(
        &self,
        keyword: Word<'a>,
        words: Words<'a>,
    ) -> Result<([f64; N], usize, Word<'a>), FormatError> {
        let mut numbers = [0.0; N];
        let mut count = 0;
        let mut first = keyword;
        for word in words {
            if count == 0 {
                first = word;
            }
            let number = self.source.number(word)?;
            if let Some(slot) = numbers.get_mut(count) {
                *slot = number;
            }
            count += 1;
        }
        Ok((numbers, count, first))
    }

    fn position(&mut self, keyword: Word<'a>, words: Words<'a>) -> Result<(), FormatError> {
        let ([x, y, z, a, b, c, d], count, first) = self.numbers::<7>(keyword, words)?;
        let colour = match count {
            // A weight, which only curves use.
            3 | 4 => None,
            6 => Some(Rgb::from([a, b, c].map(|c| c as f32))),
            7 => Some(Rgb::from([b, c, d].map(|c| c as f32))),
            _ => return Err(self.wrong_count(keyword, count, "3, 4, 6 or 7").into()),
        };
        let mut position = DVec3::new(x, y, z);
        if self.positions.len() >= NONE as usize {
            return Err(Diagnostic::error("more vertices than a mesh can have")
                .at(self.source.place(first.start))
                .into());
        }
        if !position.as_vec3().is_finite() {
            let number = self.positions.len() + 1;
            let wrong = Diagnostic::error(format!("vertex {number} is not finite"))
                .at(self.source.place(first.start));
            if !self.diagnostics.is_lenient() {
                let [x, y, z] = position.as_vec3().to_array();
                return Err(wrong.found(format!("({x}, {y}, {z})")).into());
            }
            self.budget.bytes(4, "vertices")?;
            self.unusable.push(self.positions.len() as u32);
            position = DVec3::NAN;
        }
        if let Some(colour) = colour {
            // Earlier ones are white.
            while self.colours.len() < self.positions.len() {
                self.colours.push(Rgb::WHITE)?;
            }
            let colour = self.finite_or_zero(colour, Rgb::is_finite, first, WRONG_COLOUR);
            self.colours.push(colour)?;
        } else if !self.colours.is_empty() {
            self.colours.push(Rgb::WHITE)?;
        }
        self.budget.elements(1, "vertices")?;
        Ok(self.positions.push(position)?)
    }

    #[inline]
    fn finite_or_zero<T: Copy + Default>(
        &mut self,
        v: T,
        is_finite: impl FnOnce(T) -> bool,
        at: Word<'_>,
        what: &str,
    ) -> T {
        if is_finite(v) {
            return v;
        }
        let source = self.source;
        self.diagnostics.warn(what, |said| said.at(source.place(at.start)));
        T::default()
    }

    fn number_of(&mut self, name: &str) -> Result<u32, FormatError> {
        if name.is_empty() {
            return Ok(0);
        }
        if let Some(&number) = self.numbers.get(name) {
            return Ok(number);
        }
        self.budget.bytes(name.len() as u64 + 96, "names")?;
        let number = self.names.len() as u32;
        let name: Arc<str> = name.into();
        self.names.push(name.clone());
        self.numbers.insert(name, number);
        Ok(number)
    }

    /// Reads the corners of an element into `face`; false where it waits for what comes later, or is passed over with
    /// what `dropped` says of the reason.
    fn read_face(
        &mut self,
        keyword: Word<'a>,
        words: Words<'a>,
        dropped: impl FnOnce(&'static str) -> &'static str,
    ) -> Result<bool, FormatError> {
        self.face.clear();
        let mut face = std::mem::take(&mut self.face);
        let read = self.corners(words.clone(), &mut face);
        self.face = face;
        match read {
            Ok(()) => return Ok(true),
            Err(Unusable::No(e)) => return Err(e),
            Err(Unusable::Later) => {
                let (state, material_at, counts) = (self.state, self.material_at, self.counts());
                let smoothing = self.smoothing;
                self.later.push(Later { keyword, words, state, material_at, counts, smoothing })?;
            }
            Err(Unusable::Drop(what)) => self.pass_over(keyword, dropped(what)),
        }
        Ok(false)
    }

    fn face(&mut self, keyword: Word<'a>, words: Words<'a>) -> Result<(), FormatError> {
        if !self.read_face(keyword, words, |what| what)? {
            return Ok(());
        }
        if self.face.len() < 3 {
            self.pass_over(keyword, "face with fewer than three vertices is left out");
            return Ok(());
        }
        let is_unusable = |c: &Corner| self.unusable.binary_search(&c[0]).is_ok();
        if !self.unusable.is_empty() && self.face.iter().any(is_unusable) {
            self.pass_over(keyword, "face with a vertex that is not finite is left out");
            return Ok(());
        }
        let has = |slot: usize| self.face.iter().all(|c| c[slot] != NONE);
        let is_smoothed = self.smoothing != 0 && !has(2);
        let key = Key { has_uvs: has(1), has_normals: has(2) || is_smoothed, is_smoothed, ..self.state };
        if is_smoothed {
            self.number_smooth_normals()?;
        }
        let part = match self.current {
            Some(current) if self.parts[current].key == key => current,
            _ => self.part(key)?,
        };
        self.current = Some(part);
        let part = &mut self.parts[part];
        if let [a, b, c] = self.face[..] {
            part.triangles.push([a, b, c])?;
            if is_smoothed {
                add_normals(&self.positions, &mut self.smooth_normals, [a, b, c]);
            }
            return Ok(());
        }
        // The positions of its corners, and the triangulation.
        let _while_cut = self.budget.hold(self.face.len() as u64 * 160, "corners of a face")?;
        self.places.clear();
        let first = self.positions[self.face[0][0] as usize];
        self.places.extend(self.face.iter().map(|c| relative(self.positions[c[0] as usize], first)));
        let Some(triangles) = polygon::triangulate(&self.places) else {
            let wrong = Diagnostic::error("face too large and winding to be cut into triangles")
                .at(self.source.place(keyword.start));
            return Err(wrong.found(format!("{} corners", self.face.len())).into());
        };
        for t in triangles {
            let corners = t.map(|i| self.face[i]);
            part.triangles.push(corners)?;
            if is_smoothed {
                add_normals(&self.positions, &mut self.smooth_normals, corners);
            }
        }
        Ok(())
    }

    /// Numbers the normals of a face by its smoothing group and positions.
    fn number_smooth_normals(&mut self) -> Result<(), FormatError> {
        for corner in &mut self.face {
            let next = self.smooth_normals.len() as u32;
            corner[2] = *match self.smooth_numbers.entry((self.smoothing, corner[0])) {
                Entry::Occupied(entry) => entry.into_mut(),
                Entry::Vacant(entry) => {
                    self.budget.bytes(48, "normals")?;
                    self.smooth_normals.push(DVec3::ZERO)?;
                    entry.insert(next)
                }
            };
        }
        Ok(())
    }

    /// `p v …`, a point for each vertex, or `l v …`, a line through all of them.
    fn thin(&mut self, keyword: Word<'a>, words: Words<'a>) -> Result<(), FormatError> {
        let dropped = |_| "point or line with a vertex that does not exist is left out";
        if !self.read_face(keyword, words, dropped)? {
            return Ok(());
        }
        let is_unusable = |c: &Corner| self.unusable.binary_search(&c[0]).is_ok();
        if !self.unusable.is_empty() && self.face.iter().any(is_unusable) {
            self.pass_over(keyword, "point or line with a vertex that is not finite is left out");
            return Ok(());
        }
        // Names of objects and groups do not matter to them.
        let part = self.part(Key { material: self.state.material, ..Key::default() })?;
        self.current = None;
        let budget = self.budget;
        let thin = self.parts[part].thin.get_or_insert_with(|| {
            let points = BudgetVec::new(budget, "points");
            Box::new(ThinPart { points, segments: BudgetVec::new(budget, "lines") })
        });
        if keyword.bytes == b"p" {
            for corner in &self.face {
                thin.points.push(corner[0])?;
            }
            return Ok(());
        }
        for (i, ends) in self.face.windows(2).enumerate() {
            thin.segments.push(([ends[0][0], ends[1][0]], i + 2 < self.face.len()))?;
        }
        Ok(())
    }

    fn part(&mut self, key: Key) -> Result<usize, FormatError> {
        if let Some(&part) = self.part_of.get(&key) {
            return Ok(part);
        }
        self.budget.elements(1, "meshes")?;
        // Its memory to the end, in addition to that of its shape.
        let each = size_of::<Part<'_>>()
            + size_of::<(Key, usize)>()
            + size_of::<ObjMesh>()
            + size_of::<MeshDesc>()
            + self.names[key.material as usize].len()
            + self.names[key.object.max(key.group) as usize].len()
            + 64;
        self.budget.bytes(each as u64, "meshes")?;
        let part = self.parts.len();
        let triangles = BudgetVec::new(self.budget, "triangles");
        self.parts.push(Part { key, material_at: self.material_at, triangles, thin: None });
        self.part_of.insert(key, part);
        Ok(part)
    }

    fn corners(&self, words: Words<'a>, face: &mut Vec<Corner>) -> Result<(), Unusable> {
        let mut room = self.budget.hold(0, "corners of a face")?;
        for word in words {
            if face.len() == face.capacity() {
                room.grow((face.len().max(16) * size_of::<Corner>()) as u64, "corners of a face")?;
            }
            face.push(self.corner(word)?);
        }
        Ok(())
    }

    /// `v`, `v/vt`, `v//vn` or `v/vt/vn`, each counted from 1, or backwards from -1.
    #[inline]
    fn corner(&self, word: Word<'a>) -> Result<Corner, Unusable> {
        let mut corner = [NONE; 3];
        let mut start = 0;
        for (slot, index) in corner.iter_mut().enumerate() {
            let rest = &word.bytes[start..];
            let length = rest.iter().position(|&b| b == b'/').unwrap_or(rest.len());
            if slot == 0 || length > 0 {
                *index =
                    self.index(Word { start: word.start + start, bytes: &rest[..length] }, slot, word)?;
            }
            start += length + 1;
            if length == rest.len() {
                return Ok(corner);
            }
        }
        Err(self.source.wrong(word, "wrong corner of a face").expected("v, v/vt, v//vn or v/vt/vn").into())
    }

    #[inline]
    fn index(&self, digits: Word<'a>, slot: usize, corner: Word<'a>) -> Result<u32, Unusable> {
        let count = self.counts()[slot];
        // Most have a few digits.
        let plain = digits.bytes.len() < 10
            && !digits.bytes.is_empty()
            && digits.bytes.iter().all(u8::is_ascii_digit);
        if plain {
            let index = digits.bytes.iter().fold(0usize, |n, d| n * 10 + usize::from(d - b'0'));
            if 0 < index && index <= count {
                return Ok(index as u32 - 1);
            }
        }
        let what = ["vertex", "texture coordinate", "normal"][slot];
        let text = String::from_utf8_lossy(digits.bytes);
        let Ok(index) = text.parse::<i64>() else {
            let overflows =
                text.len() > 1 && text.trim_start_matches(['-', '+']).bytes().all(|b| b.is_ascii_digit());
            if overflows && !text.trim_start_matches(['-', '+']).is_empty() {
                return self.absent(digits, what, count);
            }
            let wrong = self.source.wrong(corner, "wrong corner of a face");
            return Err(wrong.expected("v, v/vt, v//vn or v/vt/vn").into());
        };
        let from = self.at_end.map_or(count, |counts| counts[slot]);
        let counted = if index < 0 { from as i64 + 1 + index } else { index };
        if 1 <= counted && counted <= count as i64 {
            return Ok(counted as u32 - 1);
        }
        if self.at_end.is_none() && counted > 0 {
            return Err(Unusable::Later);
        }
        if slot > 0 && count == 0 && index > 0 {
            // All of them are missing: the surface is complete without them.
            self.missing[slot - 1].set(true);
            return Ok(NONE);
        }
        self.absent(digits, what, count)
    }

    /// The numbers of positions, texture coordinates and normals.
    #[inline]
    fn counts(&self) -> [usize; 3] {
        [self.positions.len(), self.uvs.len(), self.normals.len()]
    }

    #[cold]
    fn absent(&self, digits: Word<'a>, what: &str, count: usize) -> Result<u32, Unusable> {
        if self.diagnostics.is_lenient() {
            return Err(Unusable::Drop("face with a vertex that does not exist is left out"));
        }
        let wrong = Diagnostic::error(format!("face with a {what} that does not exist"))
            .at(self.source.place(digits.start));
        let wrong = wrong.found(String::from_utf8_lossy(&digits.bytes[..digits.bytes.len().min(24)]));
        Err(match count {
            0 => wrong.expected(format!("none, as there is no {what}")),
            1 => wrong.expected("1 or -1"),
            _ => wrong.expected(format!("1 to {count}, or -{count} to -1")),
        }
        .into())
    }

    /// Says what is not finite: a warning where a face that has an area uses it, else a note.
    fn say_flaws(&mut self) -> Result<(), FormatError> {
        let counts = [self.uvs.len(), self.normals.len()];
        for (of, what) in [WRONG_UV, WRONG_NORMAL].into_iter().enumerate() {
            if self.flaws[of].is_empty() {
                continue;
            }
            let _while_said = self.budget.hold(counts[of] as u64, "flaws")?;
            let mut is_seen = vec![false; counts[of]];
            let made = self.parts.iter().filter(|part| !(of == 1 && part.key.is_smoothed));
            for corners in made.flat_map(|part| part.triangles.iter()) {
                let [a, b, c] = corners.map(|corner| self.positions[corner[0] as usize]);
                if (b - a).cross(c - a) == DVec3::ZERO {
                    continue;
                }
                for corner in corners.iter().filter(|corner| corner[1 + of] != NONE) {
                    is_seen[corner[1 + of] as usize] = true;
                }
            }
            for &(index, at) in self.flaws[of].iter() {
                let placed = |said: Diagnostic| said.at(self.source.place(at));
                if is_seen[index as usize] {
                    self.diagnostics.warn(what, placed);
                } else {
                    self.diagnostics.note(&format!("{what}: no face with an area has it"), placed);
                }
            }
        }
        Ok(())
    }

    fn finish(mut self) -> Result<ObjFile, FormatError> {
        let later = std::mem::replace(&mut self.later, BudgetVec::new(self.budget, "faces"));
        for face in later.iter() {
            self.at_end = Some(face.counts);
            (self.state, self.material_at) = (face.state, face.material_at);
            self.smoothing = face.smoothing;
            let is_thin = matches!(face.keyword.bytes, b"p" | b"l");
            let read = if is_thin { Self::thin } else { Self::face };
            read(&mut self, face.keyword, face.words.clone())
                .map_err(|e| e.or_at(|| self.source.place(face.keyword.start)))?;
        }
        self.say_flaws()?;
        for (missing, what) in self.missing.iter().zip(["texture coordinates", "normals"]) {
            if missing.get() {
                let said = Diagnostic::warning(format!("faces name {what}, and the file has none"));
                self.diagnostics.push(said.at(Place::whole(self.source.name.clone())));
            }
        }
        if self.parts.is_empty() && self.positions.is_empty() {
            let wrong = Diagnostic::error("not an OBJ file, or one without vertices");
            return Err(wrong
                .at(Place::whole(self.source.name.clone()))
                .expected("lines such as v 1 2 3")
                .into());
        }
        if self.parts.is_empty() {
            let found = format!("{} vertices", self.positions.len());
            let said = Diagnostic::warning("OBJ file without faces, points and lines")
                .at(Place::whole(self.source.name.clone()));
            self.diagnostics.push(said.found(found));
        }
        // No more names and parts come: their tables make room for meshes.
        (self.numbers, self.part_of) = Default::default();
        // The vertex of the current mesh last made from each position.
        let count = self.positions.len() as u64;
        let _scratch = self.budget.hold(count * 4, "vertices")?;
        let mut newest = vec![0u32; self.positions.len()];
        let parts = std::mem::take(&mut self.parts);
        let origin = origin_of(&self.positions);
        let (mut meshes, mut thin) = (Vec::with_capacity(parts.len()), vec![]);
        for part in parts {
            let key = part.key;
            let object = if self.has_objects { key.object } else { key.group };
            let material = (key.material != 0).then(|| {
                (self.names[key.material as usize].to_string(), self.source.place(part.material_at))
            });
            if !part.triangles.is_empty() {
                let mesh = self.mesh(&part.triangles, key, origin, &mut newest)?;
                meshes.push(ObjMesh {
                    name: self.names[object as usize].to_string(),
                    material: material.clone(),
                    mesh: Arc::new(mesh),
                });
            }
            if let Some(part) = part.thin {
                let made = self.points_and_lines(&part, origin)?;
                if !made.is_empty() {
                    thin.push(ObjThin { material, thin: made });
                }
            }
        }
        if !meshes.is_empty() && meshes.iter().all(|mesh| is_without_area(&mesh.mesh)) {
            let said = Diagnostic::warning("all faces are without area: nothing of them is seen");
            self.diagnostics.push(said.at(Place::whole(self.source.name.clone())));
        }
        let used = self.positions.iter().filter(|p| p.is_finite());
        let low = used.clone().copied().fold(DVec3::INFINITY, DVec3::min);
        let high = used.copied().fold(DVec3::NEG_INFINITY, DVec3::max);
        let size = if low.x <= high.x { (high - low).length() } else { 0.0 };
        Ok(ObjFile { meshes, thin, origin, size, libraries: self.libraries })
    }

    fn points_and_lines(&self, part: &ThinPart<'_>, origin: DVec3) -> Result<Thin, FormatError> {
        let count = (part.points.len() + 2 * part.segments.len()) as u64;
        let mut positions = self.budget.vec(count, "vertices")?;
        let colour_count = if self.colours.is_empty() { 0 } else { count };
        let mut colours = self.budget.vec(colour_count, "colours")?;
        let mut points = self.budget.vec(part.points.len() as u64, "points")?;
        let mut segments = self.budget.vec(part.segments.len() as u64, "lines")?;
        let mut vertex = |position: u32| {
            positions.push(relative(self.positions[position as usize], origin));
            colours.extend(self.colours.get(position as usize));
            positions.len() as u32 - 1
        };
        points.extend(part.points.iter().map(|&point| vertex(point)));
        segments.extend(part.segments.iter().map(|&(ends, goes_on)| (ends.map(&mut vertex), goes_on)));
        let colours = (!self.colours.is_empty()).then_some(colours);
        Ok(Thin { positions, colours, points, segments })
    }

    /// Makes a vertex for each distinct corner.
    fn mesh(
        &self,
        corners: &[[Corner; 3]],
        key: Key,
        origin: DVec3,
        newest: &mut [u32],
    ) -> Result<MeshDesc, FormatError> {
        /// Vertices of one position form a chain; a long one continues in a table.
        const LONGEST_CHAIN: usize = 16;
        let mut vertices: BudgetVec<'_, Corner> = BudgetVec::new(self.budget, "vertices");
        let mut older: BudgetVec<'_, u32> = BudgetVec::new(self.budget, "vertices");
        let mut table: HashMap<Corner, u32> = HashMap::new();
        let mut triangles = BudgetVec::new(self.budget, "triangles");
        triangles.reserve(corners.len())?;
        let mut vertex_of = |mut corner: Corner| -> Result<u32, FormatError> {
            // An attribute of only some corners of a face is ignored.
            corner[1] = if key.has_uvs { corner[1] } else { NONE };
            corner[2] = if key.has_normals { corner[2] } else { NONE };
            let position = corner[0] as usize;
            // An entry from another mesh points at a vertex of another position, or at none.
            let is_ours = vertices.get(newest[position] as usize).is_some_and(|v| v[0] == corner[0]);
            let mut length = 0;
            let mut next = if is_ours { newest[position] } else { NONE };
            while next != NONE {
                if vertices[next as usize] == corner {
                    return Ok(next);
                }
                length += 1;
                next = older[next as usize];
            }
            let number = vertices.len() as u32;
            if length >= LONGEST_CHAIN {
                if let Some(&found) = table.get(&corner) {
                    return Ok(found);
                }
                self.budget.bytes(48, "vertices")?;
                table.insert(corner, number);
                older.push(NONE)?;
            } else {
                older.push(if is_ours { newest[position] } else { NONE })?;
                newest[position] = number;
            }
            vertices.push(corner)?;
            Ok(number)
        };
        for &[a, b, c] in corners {
            triangles.push([vertex_of(a)?, vertex_of(b)?, vertex_of(c)?])?;
        }
        self.budget.release(table.len() as u64 * 48);
        let count = vertices.len() as u64;
        let mut positions = self.budget.vec(count, "vertices")?;
        positions.extend(vertices.iter().map(|v| relative(self.positions[v[0] as usize], origin)));
        let mut mesh = MeshDesc { positions, triangles: triangles.into_vec(), ..MeshDesc::default() };
        if key.has_uvs {
            let mut uvs = self.budget.vec(count, "texture coordinates")?;
            uvs.extend(vertices.iter().map(|v| self.uvs[v[1] as usize]));
            mesh.uvs = Some(uvs);
        }
        if key.has_normals {
            let mut normals = self.budget.vec(count, "normals")?;
            let made = |i: u32| self.smooth_normals[i as usize].normalize_or_zero().as_vec3();
            let normal = |i: u32| if key.is_smoothed { made(i) } else { self.normals[i as usize] };
            normals.extend(vertices.iter().map(|v| normal(v[2])));
            mesh.normals = Some(normals);
        }
        if !self.colours.is_empty() {
            let mut colours = self.budget.vec(count, "colours")?;
            colours.extend(vertices.iter().map(|v| self.colours[v[0] as usize]));
            mesh.colours = Some(colours);
        }
        Ok(mesh)
    }
}

/// Adds the normal of a triangle to those of its corners, weighted by its angles, so that it does not matter how a
/// face is cut (G. Thürmer and C. Wüthrich, "Computing vertex normals from polygonal facets", Journal of Graphics
/// Tools, 1998).
fn add_normals(positions: &[DVec3], normals: &mut [DVec3], corners: [Corner; 3]) {
    let [a, b, c] = corners.map(|corner| positions[corner[0] as usize]);
    let Some(normal) = (b - a).cross(c - a).try_normalize() else { return };
    for (i, corner) in corners.iter().enumerate() {
        let [here, left, right] = [0, 1, 2].map(|k| [a, b, c][(i + k) % 3]);
        let (to_left, to_right) = (left - here, right - here);
        let angle = to_left.cross(to_right).length().angle_from(to_left.dot(to_right));
        normals[corner[2] as usize] += angle * normal;
    }
}

const WRONG_UV: &str = "texture coordinate that is not finite, taken for 0";
const WRONG_NORMAL: &str = "normal that is not finite, taken for 0";
const WRONG_COLOUR: &str = "colour that is not finite, taken for 0";

/// Why a face cannot be used: the file is invalid, or the face is to be dropped, or to be read at the end.
enum Unusable {
    No(FormatError),
    Drop(&'static str),
    /// It refers to elements that are not read yet.
    Later,
}

impl<E: Into<FormatError>> From<E> for Unusable {
    fn from(error: E) -> Self {
        Self::No(error.into())
    }
}
