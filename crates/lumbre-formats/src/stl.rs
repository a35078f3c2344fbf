//! STL meshes, text and binary (3D Systems, "Stereolithography interface specification", 1989), with the
//! colours that later programs store in the attribute bytes.

use std::collections::HashMap;
use std::path::Path;
use std::sync::Arc;

use lumbre_image::{Rgb, srgb_to_linear};
use lumbre_math::{DVec3, Vec3};
use lumbre_scene::{MeshDesc, SceneDesc, ShapeDesc, UpAxis};

use crate::budget::{Budget, BudgetVec};
use crate::diagnostic::{Diagnostic, Diagnostics, FormatError, Place, quoted_bytes};
use crate::input::{Input, refuse_wide};
use crate::origin::{Spread, placed, relative};
use crate::ply::scene_of_meshes;

/// A solid of an STL file.
#[derive(Clone, Debug, PartialEq)]
pub struct StlSolid {
    /// Its name; empty where it has none.
    pub name: String,
    /// What its positions are relative to: zero, unless all of a text are far from there.
    pub origin: DVec3,
    /// Its facets. Corners at exactly the same position (and of the same colour) are one vertex.
    pub mesh: MeshDesc,
}

/// Reads the STL file `path` as a scene, each solid a shape with the default material; z is up.
///
/// # Errors
/// As for [`Input::open`] and [`read_stl`].
pub fn open_stl(
    path: &Path,
    budget: &Budget,
    diagnostics: &mut Diagnostics,
) -> Result<SceneDesc, FormatError> {
    stl_scene(Input::open(path, budget)?, budget, diagnostics)
}

/// [`open_stl`] of a file that is open.
pub(crate) fn stl_scene(
    input: Input<'_>,
    budget: &Budget,
    diagnostics: &mut Diagnostics,
) -> Result<SceneDesc, FormatError> {
    let solids = read_stl(&input, input.name(), budget, diagnostics)?;
    let world_from_object = placed(solids.first().map_or(DVec3::ZERO, |solid| solid.origin));
    // Solids without facets show nothing.
    let shown = solids.into_iter().map(|solid| solid.mesh).filter(|mesh| !mesh.triangles.is_empty());
    let mut scene = scene_of_meshes(shown, UpAxis::Z);
    scene.shapes.iter_mut().for_each(|shape| shape.world_from_object = world_from_object);
    Ok(scene)
}

/// Reads the solids from the bytes of an STL file: one if it is binary, any number if it is text.
///
/// A file whose size matches its count of facets is binary, even if it starts with `solid`. The facets' corners
/// determine their orientation; a contradicting normal gives a warning. Colours are read as VisCAM and
/// SolidView write them (bit 15 set), or as Materialise Magics does (`COLOR=` in the header, bit 15 clear).
///
/// # Errors
/// [`FormatError::Input`] with the line and column, or the byte and path such as `/facet/3`;
/// [`FormatError::Limit`]. When lenient, facets that are not finite are dropped with a warning instead, and a
/// wrong count gives a warning; as do, always, bytes after the last facet that are too few for another.
pub fn read_stl(
    bytes: &[u8],
    name: &Arc<str>,
    budget: &Budget,
    diagnostics: &mut Diagnostics,
) -> Result<Vec<StlSolid>, FormatError> {
    refuse_wide(bytes, name)?;
    let whole = || Place::whole(name.clone());
    let count = bytes.get(80..84).map(|b| u32::from_le_bytes([b[0], b[1], b[2], b[3]]));
    let is_binary_by_size = count.is_some_and(|n| 84 + 50 * u64::from(n) == bytes.len() as u64);
    let text = bytes.strip_prefix(b"\xEF\xBB\xBF").unwrap_or(bytes).trim_ascii_start();
    let says_solid = text.get(..5).is_some_and(|word| word.eq_ignore_ascii_case(b"solid"));
    // A binary file of the wrong size may start with `solid` too; its numbers contain zero bytes, text does
    // not.
    let is_text = !is_binary_by_size && says_solid && !bytes[..bytes.len().min(1024)].contains(&0);
    let solids = if is_text {
        Text { bytes, at: 0, origin: DVec3::ZERO, name, budget, diagnostics }.read()
    } else {
        binary(bytes, count, is_binary_by_size, name, budget, diagnostics).map(|solid| vec![solid])
    };
    solids.map_err(|e| e.or_at(whole))
}

fn binary(
    bytes: &[u8],
    count: Option<u32>,
    size_is_right: bool,
    name: &Arc<str>,
    budget: &Budget,
    diagnostics: &mut Diagnostics,
) -> Result<StlSolid, FormatError> {
    let place = |at: usize, path: String| Place::binary(name.clone(), at as u64, path);
    let Some(count) = count else {
        let wrong = Diagnostic::error("not an STL file").at(Place::whole(name.clone()));
        let wrong = wrong.found(format!("{} bytes", bytes.len()));
        return Err(wrong.expected("\"solid\", or at least 84 bytes").into());
    };
    let held = (bytes.len() - 84) / 50;
    if !size_is_right {
        let wrong = if held < count as usize {
            Diagnostic::error("file is truncated")
                .because(format!("{count} facets announced, {held} present"))
        } else {
            Diagnostic::error("count of facets does not fit the size of the STL file")
                .found(format!("{count} facets in {} bytes", bytes.len()))
                .expected(format!("{} bytes, or {held} facets", 84 + 50 * u64::from(count)))
        };
        let wrong = wrong.at(place(80, "/count".into()));
        // A partial facet at the end is ignored: editors append a line break.
        if held != count as usize && !diagnostics.is_lenient() {
            return Err(wrong.into());
        }
        diagnostics.push(Diagnostic { severity: crate::Severity::Warning, ..wrong });
    }
    let count = held.min(count as usize);
    budget.elements(count as u64, "facets")?;
    let header = &bytes[..80];
    let magics = header.windows(6).position(|w| w == b"COLOR=").and_then(|at| header.get(at + 6..at + 9));
    let of_all = magics.map(|c| Rgb::new(byte(c[0]), byte(c[1]), byte(c[2])));
    let facets = bytes[84..84 + count * 50].chunks_exact(50);
    let attribute = |facet: &[u8]| u16::from_le_bytes([facet[48], facet[49]]);
    let has_colours = of_all.is_some() || facets.clone().any(|facet| attribute(facet) & 0x8000 != 0);
    let mut mesh = Welded::new(budget, has_colours);
    mesh.triangles.reserve(count)?;
    for (index, facet) in facets.enumerate() {
        let vector = |i: usize| {
            let number = |j: usize| {
                let at = 12 * i + 4 * j;
                f32::from_le_bytes([facet[at], facet[at + 1], facet[at + 2], facet[at + 3]])
            };
            Vec3::new(number(0), number(1), number(2))
        };
        let corners = [vector(1), vector(2), vector(3)];
        let at = 84 + 50 * index;
        if let Some(wrong) = corners.iter().position(|c| !c.is_finite()) {
            let c = corners[wrong];
            let wrong = place(at + 12 + 12 * wrong, format!("/facet/{index}/vertex/{wrong}"));
            not_finite(c, format!("facet {index}"), || wrong, diagnostics)?;
            continue;
        }
        check_normal(vector(0), corners, || place(at, format!("/facet/{index}/normal")), diagnostics);
        let colour = colour(attribute(facet), of_all);
        mesh.facet(corners, colour)?;
    }
    let title = header.strip_prefix(b"solid").map(|rest| rest.split(|&b| b == 0).next().unwrap_or_default());
    let title = String::from_utf8_lossy(title.unwrap_or_default()).trim().to_owned();
    Ok(StlSolid { name: title, origin: DVec3::ZERO, mesh: mesh.finish()? })
}

/// A byte in sRGB as linear light.
fn byte(b: u8) -> f32 {
    srgb_to_linear(f32::from(b) / 255.0)
}

/// The colour of a facet from its attribute; grey if it has none. `of_all` is set in files of Materialise
/// Magics.
fn colour(attribute: u16, of_all: Option<Rgb>) -> Rgb {
    let five = |shift: u16| srgb_to_linear(f32::from(attribute >> shift & 31) / 31.0);
    let is_marked = attribute & 0x8000 != 0;
    match of_all {
        Some(of_all) if is_marked => of_all,
        Some(_) => Rgb::new(five(0), five(5), five(10)),
        None if is_marked => Rgb::new(five(10), five(5), five(0)),
        None => Rgb::splat(0.5),
    }
}

fn not_finite(
    p: Vec3,
    facet: String,
    place: impl FnOnce() -> Place,
    diagnostics: &mut Diagnostics,
) -> Result<(), FormatError> {
    if diagnostics.is_lenient() {
        diagnostics
            .warn("facet with a vertex that is not finite is left out", |said| said.at(place()).found(facet));
        return Ok(());
    }
    let wrong = Diagnostic::error(format!("{facet} has a vertex that is not finite")).at(place());
    Err(wrong.found(format!("({}, {}, {})", p.x, p.y, p.z)).into())
}

fn check_normal(
    said: Vec3,
    [a, b, c]: [Vec3; 3],
    place: impl FnOnce() -> Place,
    diagnostics: &mut Diagnostics,
) {
    let turned = (b - a).cross(c - a);
    if said.dot(turned) < -0.5 * said.length() * turned.length() {
        diagnostics
            .warn("normal of a facet points against its corners, which decide", |said| said.at(place()));
    }
}

/// A mesh whose equal corners are merged.
struct Welded<'b> {
    budget: &'b Budget,
    positions: BudgetVec<'b, Vec3>,
    colours: BudgetVec<'b, Rgb>,
    triangles: BudgetVec<'b, [u32; 3]>,
    known: HashMap<[u32; 6], u32>,
    has_colours: bool,
    known_charged: u64,
}

impl<'b> Welded<'b> {
    fn new(budget: &'b Budget, has_colours: bool) -> Self {
        Self {
            budget,
            positions: BudgetVec::new(budget, "vertices"),
            colours: BudgetVec::new(budget, "colours"),
            triangles: BudgetVec::new(budget, "triangles"),
            known: HashMap::new(),
            has_colours,
            known_charged: 0,
        }
    }

    fn facet(&mut self, corners: [Vec3; 3], colour: Rgb) -> Result<(), FormatError> {
        let mut triangle = [0; 3];
        for (corner, p) in triangle.iter_mut().zip(corners) {
            // Adding 0 turns -0 into 0.
            let p = p + Vec3::ZERO;
            let colour_bits = if self.has_colours { colour.to_array().map(f32::to_bits) } else { [0; 3] };
            let [x, y, z] = p.to_array().map(f32::to_bits);
            let [r, g, b] = colour_bits;
            if self.known.len() == self.known.capacity() {
                // The size after the next growth: doubled, each entry with its key, number and mark.
                let bytes = (self.known.capacity().max(3) as u64 * 2 + 8) * 29;
                self.budget.bytes(bytes, "vertices")?;
                self.budget.release(self.known_charged);
                self.known_charged = bytes;
            }
            *corner = match self.known.entry([x, y, z, r, g, b]) {
                std::collections::hash_map::Entry::Occupied(known) => *known.get(),
                std::collections::hash_map::Entry::Vacant(new) => {
                    let number = u32::try_from(self.positions.len())
                        .map_err(|_| Diagnostic::error("more vertices than a mesh can have"))?;
                    self.positions.push(p)?;
                    if self.has_colours {
                        self.colours.push(colour)?;
                    }
                    *new.insert(number)
                }
            };
        }
        Ok(self.triangles.push(triangle)?)
    }

    fn finish(self) -> Result<MeshDesc, FormatError> {
        self.budget.release(self.known_charged);
        let colours = self.has_colours.then(|| self.colours.into_vec());
        Ok(MeshDesc {
            positions: self.positions.into_vec(),
            triangles: self.triangles.into_vec(),
            colours,
            ..MeshDesc::default()
        })
    }
}

struct Text<'a> {
    bytes: &'a [u8],
    at: usize,
    origin: DVec3,
    name: &'a Arc<str>,
    budget: &'a Budget,
    diagnostics: &'a mut Diagnostics,
}

impl<'a> Text<'a> {
    fn place(&self, at: usize) -> Place {
        Place::of_offset(self.name.clone(), self.bytes, at)
    }

    fn word(&mut self) -> Option<(usize, &'a [u8])> {
        let rest = &self.bytes[self.at..];
        let start = rest.iter().position(|b| !b.is_ascii_whitespace())?;
        let length = rest[start..].iter().position(u8::is_ascii_whitespace).unwrap_or(rest.len() - start);
        let at = self.at + start;
        self.at = at + length;
        Some((at, &self.bytes[at..at + length]))
    }

    /// The next word, which must be one of these; returns its index.
    fn expect(&mut self, words: &[&str]) -> Result<usize, FormatError> {
        let expected = words.join(" or ");
        let Some((at, word)) = self.word() else {
            let wrong = Diagnostic::error("file is truncated").at(self.place(self.bytes.len()));
            return Err(wrong.expected(expected).into());
        };
        words.iter().position(|w| word.eq_ignore_ascii_case(w.as_bytes())).ok_or_else(|| {
            let wrong = Diagnostic::error("unexpected word in STL file").at(self.place(at));
            wrong.found(quoted_bytes(word)).expected(expected).into()
        })
    }

    fn vector(&mut self) -> Result<(usize, DVec3), FormatError> {
        let mut numbers = [0f64; 3];
        let mut first = self.at;
        for (i, number) in numbers.iter_mut().enumerate() {
            let Some((at, word)) = self.word() else {
                let wrong = Diagnostic::error("file is truncated").at(self.place(self.bytes.len()));
                return Err(wrong.expected("a number").into());
            };
            first = if i == 0 { at } else { first };
            let parsed = std::str::from_utf8(word).ok().and_then(|w| w.parse().ok());
            *number = parsed.ok_or_else(|| {
                FormatError::from(
                    Diagnostic::error("not a number").at(self.place(at)).found(quoted_bytes(word)),
                )
            })?;
        }
        Ok((first, DVec3::from(numbers)))
    }

    fn rest_of_line(&mut self) -> String {
        let rest = &self.bytes[self.at..];
        let length = rest.iter().position(|&b| b == b'\n' || b == b'\r').unwrap_or(rest.len());
        self.at += length;
        String::from_utf8_lossy(&rest[..length]).trim().to_owned()
    }

    fn read(mut self) -> Result<Vec<StlSolid>, FormatError> {
        if self.bytes.starts_with(b"\xEF\xBB\xBF") {
            self.at = 3;
        }
        self.origin = self.far_origin();
        let mut solids = vec![];
        while self.bytes[self.at..].iter().any(|b| !b.is_ascii_whitespace()) {
            self.expect(&["solid"])?;
            let title = self.rest_of_line();
            self.budget.elements(1, "solids")?;
            // Its mesh is moved to its shape, while others are where they were.
            let each = size_of::<StlSolid>() + size_of::<ShapeDesc>() + size_of::<MeshDesc>() + title.len();
            self.budget.bytes(each as u64, "solids")?;
            let mesh = self.solid()?;
            self.rest_of_line();
            solids.push(StlSolid { name: title, origin: self.origin, mesh });
        }
        Ok(solids)
    }

    /// The origin of all vertices, which are looked at ahead where the first is far from zero in many digits.
    fn far_origin(&mut self) -> DVec3 {
        const NEAR: f64 = 256.0;
        let start = self.at;
        let mut spread = Spread::NOTHING;
        while let Some((_, word)) = self.word() {
            if !word.eq_ignore_ascii_case(b"vertex") {
                continue;
            }
            let Ok((_, p)) = self.vector() else { break };
            spread = spread.with(p);
            if p.abs().max_element() < NEAR {
                spread = Spread::NOTHING;
                break;
            }
        }
        self.at = start;
        spread.origin()
    }

    fn solid(&mut self) -> Result<MeshDesc, FormatError> {
        let mut mesh = Welded::new(self.budget, false);
        let mut index = 0u64;
        while self.expect(&["facet", "endsolid"])? == 0 {
            self.budget.elements(1, "facets")?;
            self.expect(&["normal"])?;
            let (normal_at, normal) = self.vector()?;
            self.expect(&["outer"])?;
            self.expect(&["loop"])?;
            let mut corners = [DVec3::ZERO; 3];
            let mut starts = [0; 3];
            for (corner, start) in corners.iter_mut().zip(&mut starts) {
                self.expect(&["vertex"])?;
                (*start, *corner) = self.vector()?;
            }
            self.expect(&["endloop"])?;
            self.expect(&["endfacet"])?;
            let (name, bytes) = (self.name, self.bytes);
            let place = |at| Place::of_offset(name.clone(), bytes, at);
            match corners.iter().position(|c| !c.as_vec3().is_finite()) {
                Some(i) => {
                    let corner = corners[i].as_vec3();
                    not_finite(corner, format!("facet {index}"), || place(starts[i]), self.diagnostics)?;
                }
                None => {
                    let corners = corners.map(|corner| relative(corner, self.origin));
                    check_normal(normal.as_vec3(), corners, || place(normal_at), self.diagnostics);
                    mesh.facet(corners, Rgb::WHITE)?;
                }
            }
            index += 1;
        }
        mesh.finish()
    }
}
