//! The denoiser's guides of a picture.

use crate::film::{Extras, GuideSums, PixelBounds, Tile};

/// The guides of every pixel of a picture. They share the memory of the film: see [`Tile`].
#[derive(Clone, Debug, PartialEq)]
pub struct Guides {
    tiles: Vec<Tile>,
}

impl Guides {
    /// The guides of some tiles.
    pub(crate) fn new<'t>(tiles: impl Iterator<Item = &'t Tile>) -> Self {
        Self { tiles: tiles.cloned().collect() }
    }

    /// The guides of all pixels, in no order.
    pub fn iter(&self) -> impl Iterator<Item = GuideSums> + '_ {
        self.tiles.iter().flat_map(Tile::guides)
    }

    /// The guides of a rectangle of pixels, row by row; empty ones outside the picture.
    pub fn within(&self, bounds: PixelBounds) -> Vec<GuideSums> {
        let mut guides = vec![GuideSums::default(); bounds.area() as usize];
        for tile in &self.tiles {
            let both = tile.bounds().intersection(&bounds);
            if both.is_empty() {
                continue;
            }
            for (x, y) in both.pixels() {
                guides[bounds.position(x, y)] = tile.guide(x, y);
            }
        }
        guides
    }

    /// The guides of the first pixel of each square of `side` by `side` pixels of a picture, as those of a small
    /// picture.
    pub(crate) fn smaller(&self, bounds: PixelBounds, side: u32) -> Self {
        let small = PixelBounds::whole(bounds.width().div_ceil(side), bounds.height().div_ceil(side));
        let mut film = Tile::new(small, Extras { guides: true, ..Extras::default() });
        for tile in &self.tiles {
            for ((x, y), guide) in tile.bounds().pixels().zip(tile.guides()) {
                let (x, y) = (x - bounds.x0, y - bounds.y0);
                if x.is_multiple_of(side) && y.is_multiple_of(side) {
                    film.set_guide(small.position(x / side, y / side), guide);
                }
            }
        }
        Self { tiles: vec![film] }
    }

    /// The guides of these tiles, mutable.
    #[cfg(test)]
    pub(crate) fn tiles_mut(&mut self) -> &mut [Tile] {
        &mut self.tiles
    }
}
