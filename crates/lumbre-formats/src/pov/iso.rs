//! Surfaces of functions, and fields of heights.

use std::sync::Arc;

use lumbre_geometry::{Aabb, Ray, Root, Roots};
use lumbre_image::{Bitmap, Channels, PixelData};
use lumbre_math::{DVec3, Elementary};
use lumbre_shading::pov::Function;

use super::heights::{Heights, LEVELS};
use super::lexer::Kind;
use super::objects::Form;
use super::palette::Indexed;
use super::{Parser, Result};
use crate::diagnostic::quoted;
use crate::{Diagnostic, Input};

/// Where a function of x, y and z is below a threshold, within a box or a sphere.
#[derive(Clone, Debug)]
pub(super) struct Iso {
    function: Arc<Function>,
    container: Container,
    threshold: f64,
    accuracy: f64,
    max_gradient: f64,
    open: bool,
}

#[derive(Clone, Debug)]
enum Container {
    Cuboid(DVec3, DVec3),
    Sphere(DVec3, f64),
}

impl Container {
    fn range(&self, ray: &Ray) -> Option<[f64; 2]> {
        match self {
            Self::Cuboid(low, high) => {
                let (a, b) = ((*low - ray.origin) / ray.direction, (*high - ray.origin) / ray.direction);
                let (near, far) = (a.min(b).max_element(), a.max(b).min_element());
                (near < far).then_some([near, far])
            }
            Self::Sphere(center, radius) => {
                let away = ray.origin - *center;
                let a = ray.direction.length_squared();
                let half = away.dot(ray.direction);
                let rest = half * half - a * (away.length_squared() - radius * radius);
                (rest > 0.0).then(|| [(-half - rest.sqrt()) / a, (-half + rest.sqrt()) / a])
            }
        }
    }

    fn contains(&self, p: DVec3) -> bool {
        match self {
            Self::Cuboid(low, high) => low.cmple(p).all() && p.cmple(*high).all(),
            Self::Sphere(center, radius) => (p - *center).length() <= *radius,
        }
    }

    fn normal(&self, p: DVec3) -> DVec3 {
        match self {
            Self::Cuboid(low, high) => {
                let q = (p - 0.5 * (*low + *high)) / (0.5 * (*high - *low));
                let size = q.abs();
                let axis = if size.x >= size.y && size.x >= size.z {
                    DVec3::X
                } else if size.y >= size.z {
                    DVec3::Y
                } else {
                    DVec3::Z
                };
                axis * q.dot(axis).signum()
            }
            Self::Sphere(center, _) => p - *center,
        }
    }
}

/// The part of roots on the container.
const ON_CONTAINER: u32 = 1;
/// A ray looks at the function at most so often.
const MAX_EVALUATIONS: u32 = 50_000;

impl Iso {
    fn value(&self, p: DVec3) -> f64 {
        self.function.value(&p.to_array()) - self.threshold
    }

    pub(super) fn contains(&self, p: DVec3) -> bool {
        self.container.contains(p) && self.value(p) < 0.0
    }

    pub(super) fn bounds(&self) -> Aabb {
        match &self.container {
            Container::Cuboid(min, max) => Aabb { min: *min, max: *max },
            Container::Sphere(center, radius) => {
                Aabb { min: *center - DVec3::splat(*radius), max: *center + DVec3::splat(*radius) }
            }
        }
    }

    pub(super) fn normal(&self, p: DVec3, root: &Root) -> DVec3 {
        if root.part == ON_CONTAINER {
            return self.container.normal(p);
        }
        let step = self.accuracy;
        let here = self.value(p);
        let slope = |axis: DVec3| self.value(p + axis * step) - here;
        DVec3::new(slope(DVec3::X), slope(DVec3::Y), slope(DVec3::Z))
    }

    pub(super) fn roots(&self, ray: &Ray, out: &mut Roots) {
        self.each_root(ray, &mut |root| {
            out.push(root);
            true
        });
    }

    /// Visits roots from the nearest on, while that returns true: what lies behind is not looked for.
    pub(super) fn each_root(&self, ray: &Ray, visit: &mut dyn FnMut(Root) -> bool) {
        let Some([near, far]) = self.container.range(ray) else { return };
        // The sides of the container that are inside of the surface.
        let on_container = |t: f64| {
            let is_root = !self.open && ray.contains(t) && self.value(ray.at(t)) < 0.0;
            is_root.then(|| Root { part: ON_CONTAINER, ..Root::at(t) })
        };
        if let Some(root) = on_container(near)
            && !visit(root)
        {
            return;
        }
        let (low, high) = (near.max(ray.t_min), far.min(ray.t_max));
        if low < high {
            let length = ray.direction.length();
            let slope = self.max_gradient * length;
            let least = self.accuracy / length;
            let at = |t: f64| self.value(ray.at(t));
            // Pieces, the nearest last.
            let mut pieces: Vec<[f64; 4]> = vec![[low, at(low), high, at(high)]];
            let mut evaluations = 0;
            while let Some([a, fa, b, fb]) = pieces.pop() {
                let changes = (fa < 0.0) != (fb < 0.0);
                // No slower than this it can have been at zero between.
                if !changes && fa.abs() + fb.abs() > slope * (b - a) {
                    continue;
                }
                if b - a < least || evaluations > MAX_EVALUATIONS {
                    if changes && !visit(Root::at(refined(&at, a, b, fa < 0.0))) {
                        return;
                    }
                    continue;
                }
                evaluations += 1;
                let middle = 0.5 * (a + b);
                let fm = at(middle);
                pieces.push([middle, fm, b, fb]);
                pieces.push([a, fa, middle, fm]);
            }
        }
        if let Some(root) = on_container(far) {
            visit(root);
        }
    }
}

/// The place where a function changes its sign.
fn refined(at: &impl Fn(f64) -> f64, mut a: f64, mut b: f64, begins_inside: bool) -> f64 {
    for _ in 0..24 {
        let middle = 0.5 * (a + b);
        if (at(middle) < 0.0) == begins_inside {
            a = middle;
        } else {
            b = middle;
        }
    }
    0.5 * (a + b)
}

impl Parser<'_, '_> {
    /// An isosurface, up to what modifies it.
    pub(super) fn isosurface(&mut self) -> Result<Form> {
        if !self.take_word("function")? {
            return Err(self.unexpected("function"));
        }
        let known = match self.peek()? {
            Some(Kind::Mark(b'{')) => None,
            _ => Some(()),
        };
        if known.is_some() {
            return Err(self.unexpected("a function in braces"));
        }
        let function = self.function_block(&["x", "y", "z"])?;
        let mut iso = Iso {
            function,
            container: Container::Cuboid(-DVec3::ONE, DVec3::ONE),
            threshold: 0.0,
            accuracy: 0.001,
            max_gradient: 1.1,
            open: false,
        };
        loop {
            let word = self.word()?;
            match word.as_deref() {
                Some("contained_by") => {
                    self.peeked = None;
                    iso.container = self.container()?;
                }
                Some("threshold") => {
                    self.peeked = None;
                    iso.threshold = self.finite()?;
                }
                Some("accuracy") => {
                    self.peeked = None;
                    iso.accuracy = self.finite()?.max(1e-9);
                }
                Some("max_gradient") => {
                    self.peeked = None;
                    iso.max_gradient = self.finite()?.abs();
                }
                Some("evaluate") => {
                    self.peeked = None;
                    iso.max_gradient = self.finite()?.abs();
                    self.comma()?;
                    self.float()?;
                    self.comma()?;
                    self.float()?;
                    // The function may be steeper than where it begins.
                    iso.max_gradient *= 2.0;
                }
                Some("open") => {
                    self.peeked = None;
                    iso.open = true;
                }
                Some("max_trace") => {
                    self.peeked = None;
                    self.float()?;
                }
                Some("all_intersections") => self.peeked = None,
                _ => return Ok(Form::Iso(Arc::new(iso))),
            }
        }
    }

    fn container(&mut self) -> Result<Container> {
        self.expect(b'{')?;
        let Some(word) = self.word()? else { return Err(self.unexpected("a box or a sphere")) };
        self.peeked = None;
        self.expect(b'{')?;
        let first = self.vector()?;
        self.comma()?;
        let container = match &*word {
            "box" => {
                let second = self.vector()?;
                Container::Cuboid(first.min(second), first.max(second))
            }
            "sphere" => Container::Sphere(first, self.finite()?.abs()),
            _ => return Err(self.error("what contains an isosurface is a box or a sphere")),
        };
        self.expect(b'}')?;
        self.expect(b'}')?;
        Ok(container)
    }
}

impl Parser<'_, '_> {
    /// A field of heights over the unit square, up to what modifies it.
    pub(super) fn height_field(&mut self) -> Result<Form> {
        let (size, mut heights) = self.heights()?;
        let (mut is_smooth, mut water) = (false, 0.0);
        loop {
            if self.take_word("smooth")? {
                is_smooth = self.optional_bool()?;
            } else if self.take_word("water_level")? {
                water = self.finite()?;
            } else if self.take_word("hierarchy")? {
                self.optional_bool()?;
            } else {
                break;
            }
        }
        let count = u64::from(size[0]) * u64::from(size[1]);
        self.budget.elements(2 * count, "triangles of a height field")?;
        self.budget.bytes(16 * count, "ranges of a height field")?;
        // The first row of an image is at the far side.
        let width = size[0] as usize;
        let rows = heights.chunks(width).rev().flatten().copied();
        heights = rows.map(|level| level / LEVELS as f32).collect();
        Ok(Form::Heights(Arc::new(Heights::new(size, heights, water, is_smooth))))
    }

    /// Columns and rows, and heights in levels, row by row.
    fn heights(&mut self) -> Result<([u32; 2], Vec<f32>)> {
        if self.take_word("function")? {
            let width = self.whole(2.0, 65_536.0)?;
            self.comma()?;
            let height = self.whole(2.0, 65_536.0)?;
            let function = self.function_block(&["x", "y", "z"])?;
            let mut heights = self.budget.vec(u64::from(width) * u64::from(height), "heights")?;
            let step = |i: u32, n: u32| f64::from(i) / f64::from(n - 1);
            for y in 0..height {
                for x in 0..width {
                    let value = function.value(&[step(x, width), step(y, height), 0.0]);
                    heights.push((value.clamp(0.0, 1.0) * (LEVELS - 1.0)).floor() as f32);
                }
            }
            return Ok(([width, height], heights));
        }
        let mut kind = None;
        if let Some(Kind::Word(word)) = self.peek()?
            && &**word != "concat"
        {
            kind = Some(word.to_string());
            self.peeked = None;
        }
        let name = self.file_name()?;
        let Some(path) = self.find(&name) else {
            let wrong = Diagnostic::error("an image that is not there").found(quoted(&name));
            return Err(self.diagnostic(wrong).into());
        };
        let input = Input::open(&path, self.budget)?;
        if let Some(indexed) = Indexed::read(&input, self.budget)? {
            return self.indexed_heights(&indexed, kind.as_deref() == Some("pot"));
        }
        let file = crate::image::read_image(&input, input.name(), self.budget, self.diagnostics)?;
        let bitmap = &file.bitmap;
        let (width, height) = (bitmap.width(), bitmap.height());
        if width < 2 || height < 2 {
            return Err(self.error("the image of a height field has two columns and rows or more"));
        }
        let mut heights = self.budget.vec(u64::from(width) * u64::from(height), "heights")?;
        let is_png = kind.as_deref() == Some("png");
        for y in 0..height {
            for x in 0..width {
                heights.push(level(bitmap, x, y, is_png));
            }
        }
        Ok(([width, height], heights))
    }

    /// Heights by the indices of an image; the right half of a .pot has what is behind the point of the left one.
    fn indexed_heights(&mut self, image: &Indexed, is_pot: bool) -> Result<([u32; 2], Vec<f32>)> {
        let width = if is_pot { image.width / 2 } else { image.width };
        if width < 2 || image.height < 2 {
            return Err(self.error("the image of a height field has two columns and rows or more"));
        }
        let mut heights = self.budget.vec(u64::from(width) * u64::from(image.height), "heights")?;
        for row in image.indices.chunks_exact(image.width as usize) {
            let (whole, part) = row.split_at(width as usize);
            heights.extend((0..width as usize).map(|x| {
                let part = if is_pot { part[x] } else { 0 };
                f32::from(whole[x]) * 256.0 + f32::from(part)
            }));
        }
        Ok(([width, image.height], heights))
    }
}

/// The level of a pixel: numbers as they are stored, where red is the high byte and green the low one of what has
/// colours.
fn level(bitmap: &Bitmap, x: u32, y: u32, is_png: bool) -> f32 {
    let stored = bitmap.stored(x, y, 0);
    if !matches!(bitmap.channels(), Channels::Y | Channels::Ya) {
        return (stored * 255.0).rounded() * 256.0 + (bitmap.stored(x, y, 1) * 255.0).rounded();
    }
    if is_png && matches!(bitmap.data(), PixelData::U8(_)) {
        // POV-Ray weighs the three equal channels of such a pixel in single precision, and drops what is behind the
        // point.
        let gray = 255.0 * (0.297_f32 * stored + 0.589_f32 * stored + 0.114_f32 * stored);
        return gray.floor() * 257.0;
    }
    (stored * (LEVELS as f32 - 1.0)).rounded()
}
