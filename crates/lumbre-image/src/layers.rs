//! Named channels over one rectangle of pixels: an image with its AOVs.

use crate::{Image, Rgb};

/// One named channel of [`Layers`].
#[derive(Clone, Debug, PartialEq)]
pub struct Layer {
    /// Its name: `R`, or `albedo.R` when it belongs to a group.
    pub name: String,
    /// One value a pixel, row by row from the top left.
    pub samples: Vec<f32>,
    /// Whether half precision is insufficient, as for depths and ids.
    pub full_precision: bool,
}

/// Named channels over one rectangle of pixels, in a fixed order.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Layers {
    // Each layer has `width * height` samples, and no two share a name.
    width: u32,
    height: u32,
    layers: Vec<Layer>,
}

impl Layers {
    /// No channels yet.
    pub fn new(width: u32, height: u32) -> Self {
        Self { width, height, layers: vec![] }
    }

    /// The channels `R`, `G`, `B` and, where the image has it, `A`.
    pub fn from_image(image: &Image) -> Self {
        let mut layers = Self::new(image.width(), image.height());
        layers.push_image("", image).expect("there was none, of the same size");
        layers
    }

    /// Adds a channel.
    ///
    /// # Errors
    /// The layer itself, when its name is taken or its number of samples is wrong.
    pub fn push(&mut self, layer: Layer) -> Result<(), Layer> {
        let expected = self.width as usize * self.height as usize;
        if layer.samples.len() != expected || self.get(&layer.name).is_some() {
            return Err(layer);
        }
        self.layers.push(layer);
        Ok(())
    }

    /// Adds the channels of an image as `group.R` and so on, or `R` and so on when `group` is empty.
    ///
    /// # Errors
    /// The layer that cannot be added, as for [`Layers::push`]; those before it have been added.
    pub fn push_image(&mut self, group: &str, image: &Image) -> Result<(), Layer> {
        let channel = |name, samples| Layer { name: grouped(group, name), samples, full_precision: false };
        for (c, name) in ["R", "G", "B"].into_iter().enumerate() {
            self.push(channel(name, image.channel(c).collect()))?;
        }
        match image.alpha() {
            Some(alpha) => self.push(channel("A", alpha.to_vec())),
            None => Ok(()),
        }
    }

    /// Width in pixels.
    pub fn width(&self) -> u32 {
        self.width
    }

    /// Height in pixels.
    pub fn height(&self) -> u32 {
        self.height
    }

    /// Every channel, in the order in which they were added.
    pub fn iter(&self) -> impl ExactSizeIterator<Item = &Layer> {
        self.layers.iter()
    }

    /// The channel of that name.
    pub fn get(&self, name: &str) -> Option<&Layer> {
        self.layers.iter().find(|layer| layer.name == name)
    }

    /// The image whose channels are `group.R` and so on, or `R` and so on when `group` is empty.
    pub fn image(&self, group: &str) -> Option<Image> {
        let samples = |name| self.get(&grouped(group, name)).map(|layer| &layer.samples);
        let (r, g, b) = (samples("R")?, samples("G")?, samples("B")?);
        let colours = r.iter().zip(g).zip(b).map(|((&r, &g), &b)| Rgb::new(r, g, b)).collect();
        let image = Image::from_pixels(self.width, self.height, colours)?;
        match samples("A") {
            Some(alpha) => image.with_alpha(alpha.clone()),
            None => Some(image),
        }
    }
}

fn grouped(group: &str, name: &str) -> String {
    if group.is_empty() { name.to_owned() } else { format!("{group}.{name}") }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn picture() -> Image {
        let colours = (0..6).map(|i| Rgb::new(i as f32, 10.0 + i as f32, 20.0 + i as f32)).collect();
        let alpha = (0..6).map(|i| i as f32 / 5.0).collect();
        Image::from_pixels(3, 2, colours).unwrap().with_alpha(alpha).unwrap()
    }

    #[test]
    fn images_come_back_from_their_channels() {
        let mut layers = Layers::from_image(&picture());
        let albedo = Image::filled(3, 2, Rgb::new(0.2, 0.4, 0.6));
        layers.push_image("albedo", &albedo).unwrap();
        let names: Vec<_> = layers.iter().map(|l| l.name.as_str()).collect();
        assert_eq!(names, ["R", "G", "B", "A", "albedo.R", "albedo.G", "albedo.B"]);
        assert_eq!(layers.image(""), Some(picture()));
        assert_eq!(layers.image("albedo"), Some(albedo));
        assert_eq!(layers.image("normal"), None);
    }

    #[test]
    fn a_taken_name_and_a_wrong_size_are_refused() {
        let mut layers = Layers::from_image(&picture());
        let depth =
            |n: usize, name: &str| Layer { name: name.into(), samples: vec![2.5; n], full_precision: true };
        assert!(layers.push(depth(5, "Z")).is_err());
        assert!(layers.push(depth(6, "R")).is_err());
        assert!(layers.push(depth(6, "Z")).is_ok());
        assert_eq!(layers.get("Z").unwrap().samples[5], 2.5);
    }
}
