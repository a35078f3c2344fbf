//! The named items of a description's files, for choosing among them.

use std::collections::HashSet;

/// The names that were read. They change no picture.
#[derive(Clone, Debug, Default, PartialEq)]
#[non_exhaustive]
pub struct Listing {
    /// Animations, in the order of their indices.
    pub animations: Vec<AnimationListing>,
    /// Material variants.
    pub variants: Vec<String>,
    /// The images that textures and environment maps are made of, in the order in which they were read.
    pub textures: Vec<TextureListing>,
    /// The names of these.
    names: HashSet<String>,
}

/// An animation.
#[derive(Clone, Debug, PartialEq)]
pub struct AnimationListing {
    /// Its name, if the file gives one.
    pub name: Option<String>,
    /// The time of its last key in seconds, if the file says it.
    pub end: Option<f64>,
}

/// An image.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct TextureListing {
    /// The name in the file that uses it: of a file, of the image, or its position.
    pub name: String,
    /// Width in pixels.
    pub width: u32,
    /// Height in pixels.
    pub height: u32,
}

impl Listing {
    /// Adds an image, unless one of its name is there.
    pub fn add_texture(&mut self, name: &str, width: u32, height: u32) {
        if self.names.insert(name.to_owned()) {
            self.textures.push(TextureListing { name: name.to_owned(), width, height });
        }
    }

    /// Adds all of another listing.
    pub fn append(&mut self, other: Self) {
        self.animations.extend(other.animations);
        self.variants.extend(other.variants);
        self.textures.extend(other.textures);
        self.names.extend(other.names);
    }
}
