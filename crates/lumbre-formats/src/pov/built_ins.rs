//! The functions and constants of the language.

use std::rc::Rc;

use lumbre_math::{DVec3, Elementary};
use lumbre_shading::pov::Octaves;
use lumbre_shading::pov::function::{Binary, Unary};

use super::value::{Num, Value};
use super::{Parser, Result};
use crate::Diagnostic;
use crate::diagnostic::quoted;

/// Texts are no longer than this.
const LONGEST_TEXT: usize = 1 << 20;
/// Numbers are printed with at most this many digits.
const MAX_DIGITS: f64 = 300.0;

impl Parser<'_, '_> {
    /// A constant by its name.
    pub(super) fn constant(&self, word: &str) -> Option<Num> {
        let frame = &self.options;
        Some(match word {
            "x" | "y" | "z" => Num::vector(match word {
                "x" => DVec3::X,
                "y" => DVec3::Y,
                _ => DVec3::Z,
            }),
            "u" => Num { v: [1.0, 0.0, 0.0, 0.0, 0.0], n: 2, is_colour: false },
            "v" => Num { v: [0.0, 1.0, 0.0, 0.0, 0.0], n: 2, is_colour: false },
            "t" => Num { v: [0.0, 0.0, 0.0, 1.0, 0.0], n: 4, is_colour: false },
            "pi" => Num::float(std::f64::consts::PI),
            "tau" => Num::float(std::f64::consts::TAU),
            "true" | "yes" | "on" => Num::float(1.0),
            "false" | "no" | "off" => Num::float(0.0),
            "clock" => Num::float(frame.clock),
            "clock_delta" => {
                let steps = frame.frames.map_or(0, |[first, last]| last.saturating_sub(first));
                let [from, to] = frame.clocks;
                Num::float(if steps == 0 { 0.0 } else { (to - from) / f64::from(steps) })
            }
            "clock_on" => Num::float(f64::from(u8::from(frame.frames.is_some()))),
            "initial_clock" => Num::float(frame.clocks[0]),
            "final_clock" => Num::float(frame.clocks[1]),
            "frame_number" => Num::float(f64::from(frame.frame_number)),
            "initial_frame" => Num::float(frame.frames.map_or(0.0, |[first, _]| f64::from(first))),
            "final_frame" => Num::float(frame.frames.map_or(0.0, |[_, last]| f64::from(last))),
            "image_width" => Num::float(f64::from(frame.width)),
            "image_height" => Num::float(f64::from(frame.height)),
            "version" => Num::float(self.settings.version),
            // A picture is a function of its scene: the time is always the same.
            "now" => Num::float(0.0),
            _ => return None,
        })
    }

    /// A function of the language, whose name was taken.
    pub(super) fn built_in(&mut self, word: &Rc<str>) -> Result<Num> {
        if let Some(unary) = Unary::from_name(word) {
            let [x] = self.numbers()?;
            let value = unary.of(x);
            if value.is_nan() && !x.is_nan() {
                self.warn(&format!("{word} of a number that it has no value for"));
            }
            return Ok(Num::float(value));
        }
        if matches!(&**word, "min" | "max" | "bitwise_and" | "bitwise_or" | "bitwise_xor")
            && let Some(binary) = Binary::from_name(word)
        {
            let all = self.list()?;
            let mut all = all.into_iter();
            let Some(first) = all.next() else { return Err(self.error("arguments are missing")) };
            return Ok(Num::float(all.fold(first, |a, b| binary.of(a, b))));
        }
        if let Some(binary) = Binary::from_name(word) {
            let [a, b] = self.numbers()?;
            return Ok(Num::float(binary.of(a, b)));
        }
        match &**word {
            "select" => self.select(),
            "rand" => self.rand(),
            "seed" => {
                let [x] = self.numbers()?;
                self.budget.bytes(4, "random streams")?;
                self.streams.push(x as i64 as u32);
                Ok(Num::float((self.streams.len() - 1) as f64))
            }
            "defined" => {
                self.expect(b'(')?;
                let is = self.is_defined()?;
                self.expect(b')')?;
                Ok(Num::float(f64::from(u8::from(is))))
            }
            "dimensions" | "dimension_size" => self.dimensions(word),
            "file_exists" => {
                self.expect(b'(')?;
                let name = self.file_name()?;
                self.expect(b')')?;
                let is = self.written.contains_key(&name) || self.find(&name).is_some();
                Ok(Num::float(f64::from(u8::from(is))))
            }
            "asc" | "strlen" | "val" | "strcmp" => self.of_text(word),
            "vdot" | "vcross" | "vlength" | "vnormalize" | "vrotate" | "vaxis_rotate" | "vturbulence" => {
                self.of_vectors(word)
            }
            "inside" | "trace" | "min_extent" | "max_extent" => self.of_object(word),
            _ => {
                let wrong = Diagnostic::error("unexpected").found(quoted(word));
                Err(self.diagnostic(wrong.expected("a number, a vector or a colour")).into())
            }
        }
    }

    fn list(&mut self) -> Result<Vec<f64>> {
        self.expect(b'(')?;
        let mut all = Vec::new();
        while !self.take(b')')? {
            all.push(self.float()?);
            self.comma()?;
        }
        Ok(all)
    }

    fn numbers<const N: usize>(&mut self) -> Result<[f64; N]> {
        self.expect(b'(')?;
        let mut all = [0.0; N];
        for (i, x) in all.iter_mut().enumerate() {
            if i > 0 {
                self.comma()?;
            }
            *x = self.float()?;
        }
        self.expect(b')')?;
        Ok(all)
    }

    fn select(&mut self) -> Result<Num> {
        self.expect(b'(')?;
        let x = self.float()?;
        let mut choices = Vec::new();
        while !self.take(b')')? {
            self.comma()?;
            choices.push(self.expression()?);
        }
        match choices[..] {
            [negative, rest] => Ok(if x < 0.0 { negative } else { rest }),
            [negative, zero, positive] => Ok(if x < 0.0 {
                negative
            } else if x == 0.0 {
                zero
            } else {
                positive
            }),
            _ => Err(self.error("select has two or three choices")),
        }
    }

    fn rand(&mut self) -> Result<Num> {
        let [stream] = self.numbers()?;
        let Some(state) = self.streams.get_mut(stream as usize) else {
            return Err(self.error("rand of a stream that seed did not make"));
        };
        *state = state.wrapping_mul(1_812_433_253).wrapping_add(12_345);
        Ok(Num::float(f64::from(*state) / f64::from(u32::MAX)))
    }

    fn dimensions(&mut self, word: &str) -> Result<Num> {
        self.expect(b'(')?;
        let Value::Array(array) = self.value()? else { return Err(self.error("an array is needed")) };
        let size = if word == "dimensions" {
            array.sizes.len()
        } else {
            self.comma()?;
            let which = self.float()?;
            match array.sizes.get((which as usize).wrapping_sub(1)) {
                Some(size) => *size,
                None => return Err(self.error("the array has no such dimension")),
            }
        };
        self.expect(b')')?;
        Ok(Num::float(size as f64))
    }

    fn of_text(&mut self, word: &str) -> Result<Num> {
        self.expect(b'(')?;
        let text = self.string()?;
        let value = match word {
            "asc" => text.chars().next().map_or(0.0, |c| f64::from(u32::from(c))),
            "strlen" => text.chars().count() as f64,
            "strcmp" => {
                self.comma()?;
                let other = self.string()?;
                f64::from(text.cmp(&other) as i8)
            }
            _ => leading_number(&text),
        };
        self.expect(b')')?;
        Ok(Num::float(value))
    }

    fn of_vectors(&mut self, word: &str) -> Result<Num> {
        self.expect(b'(')?;
        let value = if word == "vturbulence" {
            let lambda = self.float()?;
            self.comma()?;
            let omega = self.float()?;
            self.comma()?;
            let octaves = self.whole(1.0, 10.0)?;
            self.comma()?;
            let p = self.vector()?;
            Num::vector(Octaves { octaves, lambda, omega }.vector_turbulence(p))
        } else {
            let a = self.vector()?;
            match word {
                "vlength" => Num::float(a.length()),
                "vnormalize" => match a.try_normalize() {
                    Some(unit) => Num::vector(unit),
                    None => return Err(self.error("vnormalize of a vector of length 0")),
                },
                _ => {
                    self.comma()?;
                    let b = self.vector()?;
                    match word {
                        "vdot" => Num::float(a.dot(b)),
                        "vcross" => Num::vector(a.cross(b)),
                        "vrotate" => Num::vector(super::transforms::rotated(a, b)),
                        _ => {
                            self.comma()?;
                            let degrees = self.float()?;
                            Num::vector(about_axis(a, b, degrees))
                        }
                    }
                }
            }
        };
        self.expect(b')')?;
        Ok(value)
    }

    /// A function that gives a text, whose name was taken.
    pub(super) fn built_in_text(&mut self, word: &Rc<str>) -> Result<String> {
        if &**word == "input_file_name" {
            return Ok(self.frames.first().map_or_else(String::new, |frame| frame.source.name.to_string()));
        }
        self.expect(b'(')?;
        let text = match &**word {
            "concat" => {
                let mut all = String::new();
                while !self.is_mark(b')')? {
                    all.push_str(&self.string()?);
                    if all.len() > LONGEST_TEXT {
                        return Err(self.error("a text of more than a million characters"));
                    }
                    self.comma()?;
                }
                all
            }
            "chr" => {
                let code = self.float()?;
                char::from_u32(code.max(0.0) as u32).unwrap_or('\u{FFFD}').to_string()
            }
            "str" => {
                let x = self.float()?;
                self.comma()?;
                let (width, digits) = self.format()?;
                formatted(x, width, digits)
            }
            "vstr" => {
                let n = self.whole(2.0, 5.0)? as usize;
                self.comma()?;
                let v = self.expression()?.promoted(n);
                self.comma()?;
                let separator = self.string()?;
                self.comma()?;
                let (width, digits) = self.format()?;
                let parts: Vec<String> = v[..n].iter().map(|&x| formatted(x, width, digits)).collect();
                parts.join(&separator)
            }
            "strlwr" => self.string()?.to_lowercase(),
            "strupr" => self.string()?.to_uppercase(),
            "substr" => {
                let text = self.string()?;
                self.comma()?;
                let from = self.float()?;
                self.comma()?;
                let count = self.float()?;
                let length = text.chars().count() as f64;
                if from < 1.0 || count < 0.0 || from - 1.0 + count > length {
                    return Err(self.error("substr of characters that the text does not have"));
                }
                text.chars().skip(from as usize - 1).take(count as usize).collect()
            }
            "datetime" => {
                self.float()?;
                if self.take(b',')? {
                    self.string()?;
                }
                "2000-01-01 00:00:00Z".to_owned()
            }
            _ => {
                let wrong = Diagnostic::error("a text is needed").found(quoted(word));
                return Err(self.diagnostic(wrong).into());
            }
        };
        self.expect(b')')?;
        Ok(text)
    }

    fn format(&mut self) -> Result<(f64, f64)> {
        let width = self.float()?;
        self.comma()?;
        let digits = self.float()?;
        Ok((width.clamp(-MAX_DIGITS, MAX_DIGITS), digits.clamp(-1.0, MAX_DIGITS)))
    }
}

/// A number as C's `%*.*f` prints it; a negative width pads with zeros.
pub(super) fn formatted(x: f64, width: f64, digits: f64) -> String {
    let digits = if digits < 0.0 { 6 } else { digits as usize };
    let is_padded = width < 0.0;
    let width = width.abs() as usize;
    if is_padded { format!("{x:0width$.digits$}") } else { format!("{x:width$.digits$}") }
}

/// The number that a text begins with; 0 if none.
fn leading_number(text: &str) -> f64 {
    let text: String = text.trim_start().chars().take(64).collect();
    let ends = text.char_indices().map(|(i, c)| i + c.len_utf8());
    ends.rev().find_map(|end| text[..end].parse::<f64>().ok().filter(|x| x.is_finite())).unwrap_or(0.0)
}

/// A vector turned about an axis, left-handed as all rotations of the language.
fn about_axis(v: DVec3, axis: DVec3, degrees: f64) -> DVec3 {
    let Some(axis) = axis.try_normalize() else { return v };
    let (sine, cosine) = degrees.to_radians().sine_cosine();
    v * cosine + axis.cross(v) * sine + axis * (axis.dot(v) * (1.0 - cosine))
}
