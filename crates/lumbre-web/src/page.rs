//! What JavaScript calls: the core, with options as JSON and errors as the JSON of a [`Problem`].

#![allow(
    missing_docs,
    unreachable_pub,
    reason = "what JavaScript sees of it; the types of the package document it"
)]

use std::cell::RefCell;
use std::time::Duration;

use lumbre::PixelBounds;
use lumbre::formats::HeldFiles;
use serde::de::DeserializeOwned;
use wasm_bindgen::prelude::*;

use crate::problem::{Problem, ProblemKind};
use crate::session::{self, Session};

thread_local! {
    static PANIC: RefCell<String> = const { RefCell::new(String::new()) };
}

/// Keeps what a panic said, which else is lost with the trap that ends it.
#[wasm_bindgen(start)]
pub fn start() {
    std::panic::set_hook(Box::new(|info| PANIC.set(info.to_string())));
}

/// What the panic said that ended the last call; the module is not to be used after it.
#[wasm_bindgen(js_name = lastPanic)]
pub fn last_panic() -> String {
    PANIC.take()
}

#[wasm_bindgen]
#[derive(Default, Debug)]
pub struct Files(HeldFiles);

#[wasm_bindgen]
impl Files {
    #[wasm_bindgen(constructor)]
    pub fn new() -> Self {
        Self::default()
    }

    pub fn add(&mut self, name: &str, bytes: Vec<u8>) {
        self.0.insert(name, bytes);
    }
}

#[wasm_bindgen]
#[derive(Debug)]
pub struct Scene(Session);

#[wasm_bindgen]
impl Scene {
    #[wasm_bindgen(constructor)]
    pub fn new(files: Files, name: &str, wanted: &str) -> Result<Self, JsValue> {
        Session::open(files.0, name, &parsed(wanted)?).map(Self).map_err(thrown)
    }

    #[wasm_bindgen(getter)]
    pub fn width(&self) -> u32 {
        self.0.size().0
    }

    #[wasm_bindgen(getter)]
    pub fn height(&self) -> u32 {
        self.0.size().1
    }

    #[wasm_bindgen(getter)]
    pub fn bounds(&self) -> Vec<u32> {
        let PixelBounds { x0, y0, x1, y1 } = self.0.bounds();
        vec![x0, y0, x1, y1]
    }

    #[wasm_bindgen(getter)]
    pub fn warnings(&self) -> Vec<String> {
        self.0.warnings().to_vec()
    }

    #[wasm_bindgen(getter, js_name = isDivisible)]
    pub fn is_divisible(&self) -> bool {
        self.0.is_divisible()
    }

    #[wasm_bindgen(js_name = limitRows)]
    pub fn limit_rows(&mut self, from: u32, to: u32) -> Result<(), JsValue> {
        self.0.limit_rows(from, to).map_err(thrown)
    }

    pub fn step(&mut self, milliseconds: f64) -> Result<String, JsValue> {
        let time = Duration::from_secs_f64(milliseconds.clamp(1.0, 1e7) / 1000.0);
        self.0.step(time).map(|pass| json(&pass)).map_err(thrown)
    }

    pub fn pixels(&self) -> Vec<u8> {
        self.0.pixels()
    }

    pub fn light(&self) -> Vec<f32> {
        self.0.light()
    }

    pub fn cast(&self, list: Vec<u8>, query: &str) -> Result<String, JsValue> {
        self.0.cast(list, query).map_err(thrown)
    }

    pub fn explain(&self, wanted: &str) -> Result<String, JsValue> {
        self.0.explain(&parsed(wanted)?).map_err(thrown)
    }
}

#[wasm_bindgen]
pub fn calculate(text: &str, lang: &str, as_json: bool) -> Result<String, JsValue> {
    session::calculate(text, lang, as_json).map_err(thrown)
}

fn parsed<T: DeserializeOwned>(text: &str) -> Result<T, JsValue> {
    serde_json::from_str(text).map_err(|wrong| thrown(Problem::new(ProblemKind::Usage, wrong.to_string())))
}

fn thrown(problem: Problem) -> JsValue {
    JsValue::from_str(&json(&problem))
}

fn json(value: &impl serde::Serialize) -> String {
    serde_json::to_string(value).unwrap_or_default()
}
