//! Explanations of pixels on the viewer's page: `lumbre explain` for the first sample.

use clap::ValueEnum;
use lumbre::{RenderOptions, Scene, SceneDesc};
use lumbre_viewer::Explain;

use super::question::Question;
use super::things::SceneNames;
use super::{html, texts, title};
use crate::language::Language;

/// Explains the pixels of one scene.
#[derive(Debug)]
pub struct Explainer {
    name: String,
    things: SceneNames,
}

impl Explainer {
    /// For a named scene, as described before it is staged.
    pub fn new(desc: &SceneDesc, name: String) -> Self {
        Self { name, things: SceneNames::of(desc) }
    }
}

impl Explain for Explainer {
    fn languages(&self) -> Vec<(&'static str, &'static str)> {
        let languages = Language::value_variants().iter().map(|language| texts(*language));
        languages.map(|texts| (texts.code, texts.language)).collect()
    }

    fn page(
        &self,
        scene: &Scene,
        options: &RenderOptions,
        pixel: (u32, u32),
        language: &str,
    ) -> Result<String, String> {
        let texts = texts(Language::from_str(language, false)?);
        let question =
            Question { things: &self.things, texts, sample: 0, depth: 0, nearest: false, shapes: None };
        let sections = question.of_pixel(scene, options, pixel).map_err(|failure| failure.to_string())?;
        Ok(html::html(&title(&self.name, Some(pixel), texts), texts.code, &sections, texts.schoolbook))
    }
}
