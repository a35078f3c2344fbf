//! Pictures of floating-point numbers, as .pfm, and how far two of them differ.

use std::path::Path;

use anyhow::{Context, Result, bail, ensure};

/// Linear RGB, row by row from the top.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Picture {
    pub(crate) width: usize,
    pub(crate) height: usize,
    pub(crate) pixels: Vec<[f32; 3]>,
}

impl Picture {
    /// Reads a .pfm of three channels.
    pub(crate) fn read(path: &Path) -> Result<Self> {
        let bytes = std::fs::read(path).with_context(|| format!("cannot read {}", path.display()))?;
        Self::decode(&bytes).with_context(|| format!("{} is no picture", path.display()))
    }

    fn decode(bytes: &[u8]) -> Result<Self> {
        let mut rest = bytes;
        let mut word = || -> Result<&str> {
            let end = rest.iter().position(u8::is_ascii_whitespace).context("the header ends early")?;
            let (word, after) = rest.split_at(end);
            rest = &after[1..];
            Ok(std::str::from_utf8(word)?)
        };
        if word()? != "PF" {
            bail!("it does not begin with PF");
        }
        let (width, height): (usize, usize) = (word()?.parse()?, word()?.parse()?);
        let little_endian = word()?.parse::<f64>()? < 0.0;
        ensure!(rest.len() == 12 * width * height, "it has {} bytes of {}", rest.len(), 12 * width * height);
        let number = |b: &[u8]| {
            let b = [b[0], b[1], b[2], b[3]];
            if little_endian { f32::from_le_bytes(b) } else { f32::from_be_bytes(b) }
        };
        let pixel = |b: &[u8]| [number(&b[0..4]), number(&b[4..8]), number(&b[8..12])];
        // The first row of the file is the lowest.
        let pixels =
            rest.chunks_exact(12 * width).rev().flat_map(|row| row.chunks_exact(12).map(pixel)).collect();
        Ok(Self { width, height, pixels })
    }

    /// The mean of two pictures of the same size, `share` of it the other.
    pub(crate) fn mixed(&self, other: &Self, share: f64) -> Self {
        let mix = |(a, b): (&[f32; 3], &[f32; 3])| {
            [0, 1, 2].map(|k| (f64::from(a[k]) * (1.0 - share) + f64::from(b[k]) * share) as f32)
        };
        Self { pixels: self.pixels.iter().zip(&other.pixels).map(mix).collect(), ..*self }
    }

    /// The mean of all values.
    pub(crate) fn mean(&self) -> f64 {
        let values = self.pixels.as_flattened();
        values.iter().copied().map(f64::from).sum::<f64>() / values.len() as f64
    }

    /// The relative mean squared error: the mean of (a - r)² / (r² + 0.01) over all values, r those of the reference.
    ///
    /// # Errors
    /// Where the pictures differ in size, or a value is not a number.
    pub(crate) fn relative_mse(&self, reference: &Self) -> Result<f64> {
        ensure!(
            (self.width, self.height) == (reference.width, reference.height),
            "a picture of {} x {} is compared with one of {} x {}",
            self.width,
            self.height,
            reference.width,
            reference.height
        );
        let (ours, theirs) = (self.pixels.as_flattened(), reference.pixels.as_flattened());
        let term = |(&a, &r): (&f32, &f32)| {
            let (a, r) = (f64::from(a), f64::from(r));
            (a - r).powi(2) / (r * r + 0.01)
        };
        let mean = ours.iter().zip(theirs).map(term).sum::<f64>() / ours.len() as f64;
        ensure!(mean.is_finite(), "a picture has values that are no numbers");
        Ok(mean)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn picture(pixels: &[[f32; 3]]) -> Picture {
        Picture { width: 2, height: pixels.len() / 2, pixels: pixels.to_vec() }
    }

    #[test]
    fn relative_mse_divides_by_reference_squares() {
        let reference = picture(&[[0.0, 0.3, 2.0], [0.7, 0.7, 0.7]]);
        let other = picture(&[[0.1, 0.5, 2.5], [0.7, 0.7, 0.7]]);
        // 0.01/0.01, 0.04/0.1 and 0.25/4.01 over six values.
        let expected = (1.0 + 0.4 + 0.25 / 4.01) / 6.0;
        let found = other.relative_mse(&reference).unwrap();
        assert!((found - expected).abs() < 1e-6, "{found} is not {expected}");
        assert!(other.relative_mse(&picture(&[[0.0; 3]; 4])).is_err());
        let broken = picture(&[[f32::NAN, 0.5, 2.5], [0.7, 0.7, 0.7]]);
        assert!(broken.relative_mse(&reference).is_err());
    }

    #[test]
    fn a_pfm_begins_with_its_lowest_row_in_either_order_of_bytes() {
        for (scale, little) in [("-1.0", true), ("2", false)] {
            let mut bytes = format!("PF\n2 2\n{scale}\n").into_bytes();
            for value in 0..12 {
                let value = 0.5 + value as f32;
                bytes.extend(if little { value.to_le_bytes() } else { value.to_be_bytes() });
            }
            let found = Picture::decode(&bytes).unwrap();
            let expected = picture(&[[6.5, 7.5, 8.5], [9.5, 10.5, 11.5], [0.5, 1.5, 2.5], [3.5, 4.5, 5.5]]);
            assert_eq!(found, expected);
            assert!(Picture::decode(&bytes[..bytes.len() - 1]).is_err());
        }
    }
}
