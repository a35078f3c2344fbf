//! MIP maps: filtered image lookups.

use std::sync::Arc;

use lumbre_image::{Bitmap, Channels, Encoding, PixelData, f32_to_half, unit_to_u8, unit_to_u16};
use lumbre_math::{Elementary, Vec2};

use crate::Spectrum;

/// How an image continues beyond its edges.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Wrap {
    /// Repeats.
    #[default]
    Repeat,
    /// Repeats the last texel.
    Clamp,
    /// Zero.
    Black,
    /// As an equal-area octahedral map of the sphere.
    OctahedralSphere,
    /// Separately for each axis.
    Axes([AxisWrap; 2]),
}

/// How an image continues beyond two opposite edges.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum AxisWrap {
    /// Repeats.
    #[default]
    Repeat,
    /// Repeats the last texel.
    Clamp,
    /// Repeats, mirrored every other time.
    Mirror,
}

impl AxisWrap {
    /// `s` reduced to the vicinity of the image.
    fn within_reach(self, s: f32) -> f32 {
        match self {
            Self::Repeat => s - s.floor(),
            Self::Clamp => s.clamp(-4.0, 5.0),
            Self::Mirror => s - 2.0 * (0.5 * s).floor(),
        }
    }

    /// The texel index within an image of this size.
    fn texel(self, i: i64, size: i64) -> i64 {
        match self {
            Self::Repeat => i.rem_euclid(size),
            Self::Clamp => i.clamp(0, size - 1),
            Self::Mirror => {
                let i = i.rem_euclid(2 * size);
                if i < size { i } else { 2 * size - 1 - i }
            }
        }
    }
}

/// The texture filter.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub enum ImageFilter {
    /// The nearest texel.
    Point,
    /// Bilinear between four texels.
    #[default]
    Bilinear,
    /// Trilinear: bilinear in two levels.
    Trilinear,
    /// Elliptically weighted average (Heckbert 1989), with this maximal anisotropy, at most 64.
    Ewa(f32),
}

/// Options of image lookups.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct MipMapOptions {
    /// How the image continues beyond its edges.
    pub wrap: Wrap,
    /// The texture filter.
    pub filter: ImageFilter,
}

/// A pyramid of images, each half as large as the one before and in the same number format.
#[derive(Debug)]
pub struct MipMap {
    // The finest first, the last of a single texel.
    levels: Vec<Arc<Bitmap>>,
    // Whether any texel has an alpha other than 1.
    has_coverage: bool,
    options: MipMapOptions,
}

/// A texel value: a colour or a number.
trait Texel: Copy + std::ops::Add<Output = Self> + std::ops::Mul<f32, Output = Self> {
    const ZERO: Self;
    fn fetch(map: &MipMap, level: usize, x: u32, y: u32) -> Self;
}

impl Texel for Spectrum {
    const ZERO: Self = Spectrum::BLACK;
    fn fetch(map: &MipMap, level: usize, x: u32, y: u32) -> Self {
        map.levels[level].rgb(x, y)
    }
}

impl Texel for f32 {
    const ZERO: Self = 0.0;
    fn fetch(map: &MipMap, level: usize, x: u32, y: u32) -> Self {
        if map.has_coverage {
            return map.levels[level].alpha(x, y);
        }
        map.levels[level].rgb(x, y).average()
    }
}

impl MipMap {
    /// The pyramid of an image. The finest level is the image itself; the coarser ones are area averages, which
    /// take another third of its memory.
    pub fn new(bitmap: Arc<Bitmap>, options: MipMapOptions) -> Self {
        let has_coverage = bitmap.channels().alpha().is_some_and(|c| {
            (0..bitmap.height()).any(|y| (0..bitmap.width()).any(|x| bitmap.stored(x, y, c) != 1.0))
        });
        let mut levels = vec![bitmap];
        while let Some(smaller) = half_size(levels.last().expect("there is a finest level")) {
            levels.push(Arc::new(smaller));
        }
        Self { levels, has_coverage, options }
    }

    /// The image itself.
    pub fn bitmap(&self) -> &Arc<Bitmap> {
        &self.levels[0]
    }

    /// The number of levels, at least 1.
    pub fn level_count(&self) -> usize {
        self.levels.len()
    }

    /// A level as an image, 0 the finest.
    pub fn level(&self, level: usize) -> Option<&Bitmap> {
        self.levels.get(level).map(|level| &**level)
    }

    /// The lookup options.
    pub fn options(&self) -> MipMapOptions {
        self.options
    }

    /// Bytes of memory of all levels.
    pub fn bytes(&self) -> usize {
        self.levels.iter().map(|level| level.bytes()).sum()
    }

    /// The filtered colour at `st`, with (0, 0) at the lower left, over the footprint of the two derivatives;
    /// grey for an image without colour. Alpha is ignored. A footprint of zero gives the finest level.
    pub fn lookup(&self, st: Vec2, dst_dx: Vec2, dst_dy: Vec2) -> Spectrum {
        self.filtered(st, dst_dx, dst_dy)
    }

    /// The filtered value as one number: alpha where the image has any alpha other than 1 (a leaf's outline);
    /// else its grey, or the mean of its colour channels.
    pub fn lookup_float(&self, st: Vec2, dst_dx: Vec2, dst_dy: Vec2) -> f32 {
        self.filtered(st, dst_dx, dst_dy)
    }

    fn filtered<T: Texel>(&self, st: Vec2, dst_dx: Vec2, dst_dy: Vec2) -> T {
        let finite = |v: Vec2| if v.is_finite() { v } else { Vec2::ZERO };
        // Rows are counted from the top.
        let flip = Vec2::new(1.0, -1.0);
        let st = self.within_reach(Vec2::new(st.x, 1.0 - st.y));
        let (major, minor) = (finite(dst_dx) * flip, finite(dst_dy) * flip);
        if let ImageFilter::Ewa(max_ratio) = self.options.filter {
            return self.elliptic(st, major, minor, max_ratio);
        }
        // Twice the largest derivative: a texel as wide as the footprint is half the filter's width.
        let width = 2.0 * major.abs().max(minor.abs()).max_element();
        let last = self.levels.len() - 1;
        let level = last as f32 + width.max(1e-8).logarithm_2();
        if level >= last as f32 {
            return T::fetch(self, last, 0, 0);
        }
        let finer = level.max(0.0).floor() as usize;
        match self.options.filter {
            ImageFilter::Point => {
                let (x, y) = self.to_texels(finer, st);
                self.texel(finer, (x + 0.5).floor() as i64, (y + 0.5).floor() as i64)
            }
            ImageFilter::Trilinear if level > 0.0 => {
                let amount = level - finer as f32;
                self.bilinear::<T>(finer, st) * (1.0 - amount) + self.bilinear::<T>(finer + 1, st) * amount
            }
            _ => self.bilinear(finer, st),
        }
    }

    /// Greene and Heckbert, "Creating Raster Omnimax Images from Multiple Perspective Views Using the Elliptical
    /// Weighted Average Filter", IEEE Computer Graphics and Applications 6(6), 1986; Heckbert, "Fundamentals of Texture
    /// Mapping and Image Warping", Berkeley, 1989.
    fn elliptic<T: Texel>(&self, st: Vec2, dx: Vec2, dy: Vec2, max_ratio: f32) -> T {
        let (major, minor) = if dx.length_squared() >= dy.length_squared() { (dx, dy) } else { (dy, dx) };
        let max_ratio = if max_ratio >= 1.0 { max_ratio.min(64.0) } else { 1.0 };
        let (long, short) = (major.length(), minor.length());
        if short == 0.0 {
            return self.bilinear(0, st);
        }
        // A very thin ellipse is widened: blurrier, but of bounded cost.
        let widen = (long / (short * max_ratio)).max(1.0);
        let (minor, short) = (minor * widen, short * widen);
        let last = self.levels.len() - 1;
        let level = (last as f32 + short.logarithm_2()).max(0.0);
        if level >= last as f32 {
            return T::fetch(self, last, 0, 0);
        }
        let finer = level.floor();
        let amount = level - finer;
        let finer = finer as usize;
        self.ellipse::<T>(finer, st, major, minor) * (1.0 - amount)
            + self.ellipse::<T>(finer + 1, st, major, minor) * amount
    }

    /// The mean of a level's texels within an ellipse, weighted by a Gaussian.
    fn ellipse<T: Texel>(&self, level: usize, st: Vec2, major: Vec2, minor: Vec2) -> T {
        let size = Vec2::new(self.levels[level].width() as f32, self.levels[level].height() as f32);
        let (s, t) = self.to_texels(level, st);
        let (major, minor) = (major * size, minor * size);
        // A s² + B s t + C t² < 1, one texel wider than the footprint so that it is never empty.
        let a = major.y * major.y + minor.y * minor.y + 1.0;
        let b = -2.0 * (major.x * major.y + minor.x * minor.y);
        let c = major.x * major.x + minor.x * minor.x + 1.0;
        let inverse = 1.0 / (a * c - 0.25 * b * b);
        let (half_s, half_t) = (c.sqrt(), a.sqrt());
        let (a, b, c) = (a * inverse, b * inverse, c * inverse);
        let mut sum = T::ZERO;
        let mut weights = 0.0;
        for y in (t - half_t).ceil() as i64..=(t + half_t).floor() as i64 {
            for x in (s - half_s).ceil() as i64..=(s + half_s).floor() as i64 {
                let (ds, dt) = (x as f32 - s, y as f32 - t);
                let r2 = a * ds * ds + b * ds * dt + c * dt * dt;
                if r2 < 1.0 {
                    let weight = (-2.0 * r2).exponential() - (-2.0_f32).exponential();
                    sum = sum + self.texel::<T>(level, x, y) * weight;
                    weights += weight;
                }
            }
        }
        if weights > 0.0 { sum * (1.0 / weights) } else { self.bilinear(level, st) }
    }

    fn bilinear<T: Texel>(&self, level: usize, st: Vec2) -> T {
        let (x, y) = self.to_texels(level, st);
        let (x0, y0) = (x.floor(), y.floor());
        let (dx, dy) = (x - x0, y - y0);
        let (x0, y0) = (x0 as i64, y0 as i64);
        let row =
            |y: i64| self.texel::<T>(level, x0, y) * (1.0 - dx) + self.texel::<T>(level, x0 + 1, y) * dx;
        row(y0) * (1.0 - dy) + row(y0 + 1) * dy
    }

    /// `st` reduced to the vicinity of the image, where texels can be distinguished: by whole periods where it
    /// repeats.
    fn within_reach(&self, st: Vec2) -> Vec2 {
        match self.options.wrap {
            _ if !st.is_finite() => Vec2::ZERO,
            Wrap::Repeat => st - st.floor(),
            Wrap::Clamp | Wrap::Black => st.clamp(Vec2::splat(-4.0), Vec2::splat(5.0)),
            Wrap::OctahedralSphere => st.clamp(Vec2::ZERO, Vec2::ONE),
            // `st` counts rows downwards here; mirroring is symmetric.
            Wrap::Axes([s, t]) => Vec2::new(s.within_reach(st.x), t.within_reach(st.y)),
        }
    }

    /// The position in texels of a level, integers at their centres, (0, 0) the upper left one.
    fn to_texels(&self, level: usize, st: Vec2) -> (f32, f32) {
        let level = &self.levels[level];
        (st.x * level.width() as f32 - 0.5, st.y * level.height() as f32 - 0.5)
    }

    /// The texel at a position that may be beyond the edge.
    fn texel<T: Texel>(&self, level: usize, x: i64, y: i64) -> T {
        let (width, height) = (i64::from(self.levels[level].width()), i64::from(self.levels[level].height()));
        let (x, y) = if (0..width).contains(&x) && (0..height).contains(&y) {
            (x, y)
        } else {
            match self.options.wrap {
                Wrap::Repeat => (x.rem_euclid(width), y.rem_euclid(height)),
                Wrap::Clamp => (x.clamp(0, width - 1), y.clamp(0, height - 1)),
                Wrap::Black => return T::ZERO,
                Wrap::OctahedralSphere => octahedral(x, y, width, height),
                Wrap::Axes([s, t]) => (s.texel(x, width), t.texel(y, height)),
            }
        };
        T::fetch(self, level, x as u32, y as u32)
    }
}

/// The texel of an equal-area octahedral image for a position up to one image beyond its edge: each edge meets
/// itself, mirrored about its middle.
fn octahedral(x: i64, y: i64, width: i64, height: i64) -> (i64, i64) {
    let (mut x, mut y) = (x.clamp(-width, 2 * width - 1), y.clamp(-height, 2 * height - 1));
    if !(0..width).contains(&x) {
        x = if x < 0 { -1 - x } else { 2 * width - 1 - x };
        y = height - 1 - y;
    }
    if !(0..height).contains(&y) {
        y = if y < 0 { -1 - y } else { 2 * height - 1 - y };
        x = width - 1 - x;
    }
    (x, y)
}

/// The image at half its size, rounded up: each texel the mean over its area. `None` for an image of one texel.
fn half_size(image: &Bitmap) -> Option<Bitmap> {
    let (width, height) = (image.width(), image.height());
    if width == 1 && height == 1 {
        return None;
    }
    let (new_width, new_height) = (width.div_ceil(2), height.div_ceil(2));
    let (columns, rows) = (coverages(width, new_width), coverages(height, new_height));
    let channels = image.channels();
    let count = channels.count();
    let mut light = Vec::with_capacity(new_width as usize * new_height as usize * count);
    for row in &rows {
        for column in &columns {
            for c in 0..count {
                let mut sum = 0.0;
                for &(y, weight_y) in row.iter().filter(|part| part.1 > 0.0) {
                    for &(x, weight_x) in column.iter().filter(|part| part.1 > 0.0) {
                        sum += weight_x * weight_y * image.texel(x, y, c);
                    }
                }
                light.push(sum);
            }
        }
    }
    let data = encode(&light, channels, image);
    Bitmap::new(new_width, new_height, channels, data, image.encoding())
}

/// Encodes light in the number format and encoding of an image.
fn encode(light: &[f32], channels: Channels, like: &Bitmap) -> PixelData {
    let stored = light.iter().enumerate().map(|(i, &v)| {
        let is_alpha = channels.alpha() == Some(i % channels.count());
        if is_alpha { Encoding::Linear } else { like.encoding() }.encode(v)
    });
    match like.data() {
        PixelData::U8(_) => PixelData::U8(stored.map(unit_to_u8).collect()),
        PixelData::U16(_) => PixelData::U16(stored.map(unit_to_u16).collect()),
        PixelData::F16(_) => PixelData::F16(stored.map(f32_to_half).collect()),
        PixelData::F32(_) => PixelData::F32(stored.collect()),
    }
}

/// For each of `to` texels, the at most three of `from` ≤ 2 `to` texels that it covers, with their weights.
fn coverages(from: u32, to: u32) -> Vec<[(u32, f32); 3]> {
    let size = f64::from(from) / f64::from(to);
    (0..to)
        .map(|i| {
            let (start, end) = (f64::from(i) * size, f64::from(i + 1) * size);
            std::array::from_fn(|k| {
                let texel = start.floor() + k as f64;
                let covered = ((texel + 1.0).min(end) - texel.max(start)).max(0.0);
                // Rounding may leave a sliver of the texel beyond the last.
                let share = if texel < f64::from(from) { covered / size } else { 0.0 };
                ((texel as u32).min(from - 1), share as f32)
            })
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    const NONE: Vec2 = Vec2::ZERO;

    /// A picture of 6 by 4 whose texel (x, y from the top) is (x / 8, y / 8, 0.5).
    fn ramp() -> Arc<Bitmap> {
        let data =
            (0..4).flat_map(|y| (0..6).flat_map(move |x| [x as f32 / 8.0, y as f32 / 8.0, 0.5])).collect();
        Arc::new(Bitmap::new(6, 4, Channels::Rgb, PixelData::F32(data), Encoding::Linear).unwrap())
    }

    fn noise(width: u32, height: u32) -> Arc<Bitmap> {
        let mut random = lumbre_math::random::RandomStream::new(8);
        let data = (0..width * height * 3).map(|_| random.next_f32()).collect();
        Arc::new(Bitmap::new(width, height, Channels::Rgb, PixelData::F32(data), Encoding::Linear).unwrap())
    }

    fn map(wrap: Wrap, filter: ImageFilter) -> MipMap {
        MipMap::new(ramp(), MipMapOptions { wrap, filter })
    }

    fn assert_close(a: Spectrum, b: Spectrum) {
        assert!((a - b).map(f32::abs).max_component() < 1e-5, "{a:?} {b:?}");
    }

    /// st of the centre of a texel counted from the top left.
    fn centre(x: i32, y: i32) -> Vec2 {
        Vec2::new((x as f32 + 0.5) / 6.0, 1.0 - (y as f32 + 0.5) / 4.0)
    }

    #[test]
    fn the_lower_left_is_the_last_row() {
        for filter in
            [ImageFilter::Point, ImageFilter::Bilinear, ImageFilter::Trilinear, ImageFilter::Ewa(8.0)]
        {
            let map = map(Wrap::Clamp, filter);
            for (x, y) in [(0, 3), (2, 1), (5, 0)] {
                let expected = Spectrum::new(x as f32 / 8.0, y as f32 / 8.0, 0.5);
                assert_close(map.lookup(centre(x, y), NONE, NONE), expected);
            }
        }
    }

    #[test]
    fn bilinear_interpolates_and_point_takes_the_nearest() {
        let place = centre(2, 1).lerp(centre(3, 2), 0.25);
        assert_close(
            map(Wrap::Clamp, ImageFilter::Bilinear).lookup(place, NONE, NONE),
            Spectrum::new(2.25 / 8.0, 1.25 / 8.0, 0.5),
        );
        assert_close(
            map(Wrap::Clamp, ImageFilter::Point).lookup(place, NONE, NONE),
            Spectrum::new(2.0 / 8.0, 1.0 / 8.0, 0.5),
        );
    }

    #[test]
    fn beyond_the_edge_each_wrap_does_what_it_says() {
        let red = |wrap, x, y| {
            let c = map(wrap, ImageFilter::Bilinear).lookup(centre(x, y), NONE, NONE);
            (c.r * 8.0, c.g * 8.0, c.b)
        };
        let near = |a: (f32, f32, f32), b: (f32, f32, f32)| {
            assert!((a.0 - b.0).abs() + (a.1 - b.1).abs() + (a.2 - b.2).abs() < 1e-4, "{a:?} {b:?}");
        };
        near(red(Wrap::Repeat, 7, 2), (1.0, 2.0, 0.5));
        near(red(Wrap::Repeat, -13, -3), (5.0, 1.0, 0.5));
        near(red(Wrap::Clamp, 7, 2), (5.0, 2.0, 0.5));
        near(red(Wrap::Clamp, -3, 9), (0.0, 3.0, 0.5));
        near(red(Wrap::Black, 7, 2), (0.0, 0.0, 0.0));
        near(red(Wrap::Black, 3, -2), (0.0, 0.0, 0.0));
        // Half-way across a black edge half is left.
        let edge = map(Wrap::Black, ImageFilter::Bilinear).lookup(Vec2::new(0.0, 0.5), NONE, NONE);
        assert!((edge.b - 0.25).abs() < 1e-6, "{edge:?}");
    }

    #[test]
    fn an_octahedral_edge_meets_itself_mirrored() {
        use lumbre_math::warp::equal_area_wrap;
        let size = 8;
        let mut count = 0;
        for y in 0..size {
            for x in [-2, -1, size, size + 1] {
                for (x, y) in [(x, y), (y, x)] {
                    let st = Vec2::new((x as f32 + 0.5) / 8.0, (y as f32 + 0.5) / 8.0);
                    let wrapped = equal_area_wrap(st) * 8.0 - 0.5;
                    let ours = octahedral(x, y, size, size);
                    assert_eq!(ours, (wrapped.x.round() as i64, wrapped.y.round() as i64), "{x} {y}");
                    count += 1;
                }
            }
        }
        assert_eq!(count, 64);
    }

    #[test]
    fn every_level_keeps_the_mean_and_the_number_format() {
        let image = noise(37, 12);
        let mean = |level: &Bitmap| {
            level.to_image().pixels().iter().copied().sum::<Spectrum>()
                / (level.width() * level.height()) as f32
        };
        let map = MipMap::new(Arc::clone(&image), MipMapOptions::default());
        let sizes: Vec<_> = (0..map.level_count())
            .map(|i| map.level(i).map(|level| (level.width(), level.height())).unwrap())
            .collect();
        assert_eq!(sizes, [(37, 12), (19, 6), (10, 3), (5, 2), (3, 1), (2, 1), (1, 1)]);
        for i in 0..map.level_count() {
            assert_close(mean(map.level(i).unwrap()), mean(&image));
        }
        let bytes = Bitmap::new(5, 3, Channels::Rgba, PixelData::U8(vec![77; 60]), Encoding::Srgb).unwrap();
        let map = MipMap::new(Arc::new(bytes), MipMapOptions::default());
        assert_eq!(map.level(1).unwrap().data(), &PixelData::U8(vec![77; 3 * 2 * 4]));
        assert_eq!(map.bytes(), 60 + 24 + 8 + 4);
        assert!(map.level(4).is_none());
    }

    #[test]
    fn a_footprint_of_everything_gives_the_mean() {
        let image = noise(64, 64);
        let mean = image.to_image().pixels().iter().copied().sum::<Spectrum>() / 4096.0;
        for filter in
            [ImageFilter::Point, ImageFilter::Bilinear, ImageFilter::Trilinear, ImageFilter::Ewa(8.0)]
        {
            let map = MipMap::new(Arc::clone(&image), MipMapOptions { filter, wrap: Wrap::Repeat });
            for size in [1.0, 50.0, 1e30] {
                let wide = map.lookup(Vec2::new(0.3, 0.7), Vec2::X * size, Vec2::Y * size);
                assert_close(wide, mean);
            }
        }
    }

    #[test]
    fn an_elliptic_footprint_blurs_along_its_axis_alone() {
        // Stripes along the diagonal s + t: sharp across a footprint that follows them, grey where it crosses them.
        let size = 128_u32;
        let data = (0..size * size)
            .map(|i| {
                let (x, y) = (i % size, size - 1 - i / size);
                if (x + y) % 16 < 8 { 1.0 } else { 0.0 }
            })
            .collect();
        let image = Bitmap::new(size, size, Channels::Y, PixelData::F32(data), Encoding::Linear).unwrap();
        let options = MipMapOptions { wrap: Wrap::Repeat, filter: ImageFilter::Ewa(16.0) };
        let map = MipMap::new(Arc::new(image), options);
        // In the middle of a white stripe: x + y ≡ 3.5 (mod 16) in texels, whose centres lie at halves.
        let st = Vec2::splat(66.25) / size as f32;
        let (along, across) = (Vec2::new(1.0, -1.0) / size as f32, Vec2::new(1.0, 1.0) / size as f32);
        let sharp = map.lookup_float(st, along * 12.0, across * 1.0);
        let grey = map.lookup_float(st, along * 1.0, across * 12.0);
        assert!(sharp > 0.95, "{sharp}");
        assert!((grey - 0.5).abs() < 0.1, "{grey}");
    }

    #[test]
    fn a_float_lookup_is_alpha_or_the_mean_colour() {
        let lookup = |channels: Channels, texel: &[u8]| {
            let data = PixelData::U8(texel.repeat(6));
            let bitmap = Bitmap::new(3, 2, channels, data, Encoding::Linear).unwrap();
            MipMap::new(Arc::new(bitmap), MipMapOptions::default()).lookup_float(
                Vec2::new(0.4, 0.6),
                NONE,
                NONE,
            )
        };
        assert!((lookup(Channels::Y, &[51]) - 0.2).abs() < 1e-6);
        assert!((lookup(Channels::Rgb, &[51, 102, 0]) - 0.2).abs() < 1e-6);
        assert!((lookup(Channels::Rgba, &[51, 102, 0, 255]) - 0.2).abs() < 1e-6);
        assert!((lookup(Channels::Rgba, &[51, 102, 0, 204]) - 0.8).abs() < 1e-6);
        assert!((lookup(Channels::Ya, &[51, 204]) - 0.8).abs() < 1e-6);
    }

    #[test]
    fn places_that_are_no_places_give_finite_values() {
        let odd = [0.0, 1.0, -1e30, 1e30, f32::NAN, f32::INFINITY, 1e-40];
        let mut count = 0;
        for wrap in [Wrap::Repeat, Wrap::Clamp, Wrap::Black, Wrap::OctahedralSphere] {
            for filter in [
                ImageFilter::Point,
                ImageFilter::Bilinear,
                ImageFilter::Trilinear,
                ImageFilter::Ewa(f32::INFINITY),
                ImageFilter::Ewa(f32::NAN),
            ] {
                let map = map(wrap, filter);
                for a in odd {
                    for b in odd {
                        let value = map.lookup(Vec2::new(a, b), Vec2::new(b, 1e-3), Vec2::new(0.2, a));
                        assert!(value.is_finite(), "{wrap:?} {filter:?} {a} {b}");
                        assert!(map.lookup(Vec2::new(b, a), Vec2::new(a, b), Vec2::ZERO).is_finite());
                        count += 1;
                    }
                }
            }
        }
        assert_eq!(count, 4 * 5 * 49);
    }
}
