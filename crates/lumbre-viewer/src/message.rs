//! The protocol: everything that the viewer and its page send to each other, but for the pixels of [`crate::frame`].
//!
//! `web/src/messages.ts` has the same types for the page. It is generated from this file by `tests/protocol.rs`, which
//! fails if the two differ; the page does not compile if it uses other messages or fields.

use std::collections::BTreeMap;

use serde::{Deserialize, Serialize};

/// A message of the page. Unknown fields are an error: the page is part of the same program.
#[derive(Clone, Debug, Deserialize, PartialEq)]
#[serde(tag = "type", rename_all = "lowercase", deny_unknown_fields)]
pub(crate) enum PageMessage {
    /// It has shown the last frame, and is ready for another.
    Shown {},
    /// The camera has moved.
    Camera { sequence: u32, placement: Placement, fov: Option<f64>, zoom: f64 },
    /// Back to one of the file's cameras.
    Reset { sequence: u32, camera: usize },
    /// What is rendered, and how it is shown.
    Set(Box<SetOptions>),
    /// A parameter of the scene; `None` resets it to the file's value.
    Edit { path: String, value: Option<String> },
    /// Shapes that are hidden, or with `others` all but these; none shows everything.
    Hide { shapes: Vec<u32>, others: bool },
    /// What is in front of a plane, where its normal points, is not seen by the camera; without a plane, everything is.
    Section { plane: Option<Plane> },
    /// A moment of an animation, a variant.
    Moment { time: Option<f64>, variant: Option<String> },
    /// Asks for the shapes at a pixel of the full picture.
    Pick { x: f64, y: f64, request: u32 },
    /// Asks for an address of an HTTP request.
    Ticket { request: u32, errand: Errand },
    /// The values of a rectangle of pixels.
    Values { x: u32, y: u32, width: u32, height: u32, request: u32 },
}

/// A camera's position and orientation.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub(crate) struct Placement {
    /// The camera's position.
    pub eye: [f64; 3],
    /// A point in the middle of the picture.
    pub target: [f64; 3],
    /// What is upwards in the picture.
    pub up: [f64; 3],
}

/// The channel that is shown.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub(crate) enum Channel {
    /// The picture.
    #[default]
    Beauty,
    /// Reflectance.
    Albedo,
    /// Shading normals, (n + 1) / 2.
    Normal,
    /// Depth along the camera's axis.
    Depth,
    /// Texture coordinates.
    Uv,
    /// The variance of the picture's luminance; its square root, the standard error, is shown in false colours.
    Variance,
    /// A colour for each shape.
    Ids,
}

/// The colours of numbers.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub(crate) enum ColourMap {
    /// Grey for depth, the rainbow for light.
    #[default]
    Automatic,
    /// Near is bright; of light, bright is bright.
    Grey,
    /// Dark blue, blue, green, yellow, red.
    Rainbow,
    /// Dark blue, green, yellow, at steps that look even (S. van der Walt and N. Smith, matplotlib's default of 2015).
    Viridis,
}

/// A plane by a point and a normal of any length but 0.
#[derive(Clone, Copy, Debug, Deserialize, Serialize, PartialEq)]
#[serde(deny_unknown_fields)]
pub(crate) struct Plane {
    pub point: [f64; 3],
    pub normal: [f64; 3],
}

impl PageMessage {
    /// Whether who only watches may say it: it asks, and changes nothing.
    pub(crate) fn only_asks(&self) -> bool {
        match self {
            Self::Shown {} | Self::Pick { .. } | Self::Values { .. } => true,
            Self::Ticket { errand, .. } => !matches!(errand, Errand::Scene {}),
            Self::Camera { .. }
            | Self::Reset { .. }
            | Self::Set(_)
            | Self::Edit { .. }
            | Self::Hide { .. }
            | Self::Section { .. }
            | Self::Moment { .. } => false,
        }
    }
}

/// The first message of a page.
#[derive(Clone, Debug, Deserialize, PartialEq)]
#[serde(tag = "type", rename_all = "lowercase", deny_unknown_fields)]
pub(crate) enum PageGreeting {
    /// The proof that it may come in: see [`crate::guard::Guard::admit`].
    Hello { nonce: String, proof: String },
}

/// The purpose of a page's HTTP request, which needs a single-use ticket.
#[derive(Clone, Debug, Deserialize, PartialEq)]
#[serde(tag = "for", rename_all = "lowercase", deny_unknown_fields)]
pub(crate) enum Errand {
    /// It takes the picture as a file.
    Picture { format: FileFormat },
    /// It loads an explanation of a pixel's colour.
    Explanation { language: String, pixel: (u32, u32) },
    /// It sends a scene, or a picture for its light.
    Scene {},
}

/// The formats of pictures that a page can take.
#[derive(Clone, Copy, Debug, Deserialize, PartialEq, Eq)]
#[serde(rename_all = "lowercase")]
pub(crate) enum FileFormat {
    Png,
    Exr,
}

/// A page's options; missing ones stay unchanged.
#[derive(Clone, Debug, Default, Deserialize, PartialEq)]
#[serde(default, deny_unknown_fields)]
pub(crate) struct SetOptions {
    pub exposure: Option<f32>,
    pub tone_map: Option<String>,
    pub false_colour: Option<bool>,
    pub channel: Option<Channel>,
    pub denoise: Option<bool>,
    pub paused: Option<bool>,
    pub scale: Option<f64>,
    pub spp: Option<u32>,
    /// 0 for none.
    pub noise: Option<f64>,
    /// The colours of numbers.
    pub map: Option<ColourMap>,
    /// The numbers at both ends of these colours; none to find them.
    pub range: Option<Vec<f32>>,
}

/// A file in the list that precedes files dropped on the page: see [`crate::bundle`].
#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct DroppedFile {
    /// Its path in the folder that was dropped.
    pub name: String,
    /// Bytes.
    pub size: u64,
}

/// A message of the viewer before the page is admitted.
#[derive(Debug, Serialize)]
#[serde(tag = "type", rename_all = "lowercase")]
pub(crate) enum ViewerGreeting {
    /// The number that the page's proof is made with.
    Challenge { nonce: String },
    /// The page is admitted: see [`crate::guard::Welcome`].
    Welcome { proof: String, session: Option<String>, access: Access },
}

/// What a page may do.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "lowercase")]
pub(crate) enum Access {
    /// Everything.
    Edit,
    /// Ask, and change nothing: see [`PageMessage::only_asks`].
    Watch,
}

/// A message of the viewer.
#[derive(Debug, Serialize)]
#[serde(tag = "type", rename_all = "lowercase")]
pub(crate) enum ViewerMessage<'a> {
    /// What is requested, and how it is shown.
    State(Box<ViewerState>),
    /// The scene, when it was built.
    Scene { scene: &'a SceneFacts },
    /// How far the picture is.
    Progress(RenderProgress),
    /// The answer to `pick`.
    Picked { request: u32, x: f64, y: f64, ray: PickedRay },
    /// The answer to `values`, row by row.
    Values { request: u32, x: u32, y: u32, width: u32, height: u32, values: Vec<[PixelValue; 3]> },
    /// The answer to `ticket`: an address that works once; `None` if the system has no random numbers to make one.
    Ticket { request: u32, address: Option<String> },
    /// Why the page's message was refused.
    Wrong { what: String },
}

impl ViewerMessage<'_> {
    /// That a message was refused.
    pub(crate) fn wrong(what: impl Into<String>) -> Self {
        Self::Wrong { what: what.into() }
    }
}

/// A message as JSON.
pub(crate) fn to_json(message: &impl Serialize) -> String {
    serde_json::to_string(message).expect("messages have no maps but those with names")
}

/// The requested state.
#[derive(Clone, Debug, Serialize)]
pub(crate) struct ViewerState {
    /// The name of the scene.
    pub name: String,
    pub has_scene: bool,
    /// Why there is no scene, or no picture.
    pub error: Option<String>,
    /// Why the last parameter could not be set.
    pub edit_error: Option<String>,
    /// Which of the file's cameras.
    pub camera: usize,
    /// The last change of the camera, as counted by the page that made it.
    pub sequence: u32,
    /// Whether the camera was moved by hand.
    pub moved: bool,
    pub placement: Option<Placement>,
    /// The field of view in degrees, where it was changed.
    pub fov: Option<f64>,
    /// The magnification of an orthographic camera.
    pub zoom: f64,
    /// Width and height of the picture in pixels.
    pub size: Option<[u32; 2]>,
    pub channel: Channel,
    /// Pixels along a side, as a factor.
    pub scale: f64,
    pub spp: Option<u32>,
    /// The noise at which the picture is done; 0 for none.
    pub noise: Option<f64>,
    pub denoise: Option<bool>,
    pub paused: bool,
    /// In stops.
    pub exposure: Option<f32>,
    pub tone_map: Option<String>,
    pub false_colour: bool,
    pub map: ColourMap,
    /// The numbers at both ends of the colours; `None` where they are found.
    pub range: Option<[f32; 2]>,
    pub hidden: HiddenShapes,
    pub section: Option<Plane>,
    /// The moment of the animation, in seconds.
    pub time: Option<f64>,
    pub variant: Option<String>,
    /// Parameters with their values, in the order in which they were first set.
    pub settings: Vec<(String, String)>,
}

/// Shapes that are not in the picture; with `others` all but these.
#[derive(Clone, Debug, Serialize)]
pub(crate) struct HiddenShapes {
    pub shapes: Vec<u32>,
    pub others: bool,
}

/// The facts of a scene.
#[derive(Clone, Debug, Serialize)]
pub(crate) struct SceneFacts {
    pub cameras: Vec<CameraFacts>,
    /// The direction upwards.
    pub up: [f64; 3],
    /// An infinite plane below everything.
    pub ground: Option<Plane>,
    pub tree: ShapeTree,
    /// The corners of the bounding box.
    pub bounds: Option<[[f64; 3]; 2]>,
    /// Shapes by kind.
    pub shapes: BTreeMap<String, u64>,
    /// Materials by kind.
    pub materials: BTreeMap<String, u64>,
    /// Lights by kind.
    pub lights: BTreeMap<String, u64>,
    pub triangles: u64,
    pub instances: u64,
    /// Bytes.
    pub memory: u64,
    pub build_seconds: f64,
    pub animations: Vec<AnimationFacts>,
    /// The names of the material variants.
    pub variants: Vec<String>,
    pub parameters: Vec<ListedParameter>,
    /// Those in which pixels are explained: their codes and their own names.
    pub languages: Vec<(String, String)>,
    pub warnings: Vec<String>,
}

/// A camera of the file.
#[derive(Clone, Debug, Serialize)]
pub(crate) struct CameraFacts {
    pub name: String,
    pub kind: String,
    /// Whether it shows the scene as in a mirror.
    pub mirrored: bool,
    /// The field of view in degrees of a perspective camera.
    pub fov: Option<f64>,
    /// The part of the image plane that it shows (left, right, bottom, top), in units of half the field of view, if the
    /// file says so.
    pub window: Option<[f64; 4]>,
}

/// An animation of the file.
#[derive(Clone, Debug, Serialize)]
pub(crate) struct AnimationFacts {
    pub name: Option<String>,
    /// Its last moment in seconds.
    pub end: Option<f64>,
}

/// The shapes of the world and of each object.
#[derive(Clone, Debug, Serialize)]
pub(crate) struct ShapeTree {
    pub groups: Vec<ShapeGroup>,
    /// Shapes that are not listed, because there are too many.
    pub left_out: usize,
}

/// The shapes of an object, or of the world, which has no name.
#[derive(Clone, Debug, Serialize)]
pub(crate) struct ShapeGroup {
    pub name: Option<String>,
    pub shapes: Vec<ListedShape>,
}

/// A shape of the file, or the ground.
#[derive(Clone, Debug, Serialize)]
pub(crate) struct ListedShape {
    pub shape: u32,
    pub kind: String,
    pub name: Option<String>,
    /// The name and kind of its material.
    pub material: Option<String>,
    /// What the parameters of its material belong to.
    pub owner: Option<String>,
    /// Whether it emits light.
    pub shines: bool,
}

/// A parameter that can be edited.
#[derive(Clone, Debug, Serialize)]
pub(crate) struct ListedParameter {
    pub path: String,
    pub owner: String,
    pub name: String,
    pub kind: ValueKind,
    /// `None` if a texture gives it.
    pub value: Option<Vec<f64>>,
    /// The ends of its range.
    pub low: Option<f64>,
    pub high: Option<f64>,
}

/// What a parameter's value is.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "lowercase")]
pub(crate) enum ValueKind {
    Number,
    Colour,
    Light,
    Point,
    Factor,
}

/// How far the picture is; `None` where something is not known or does not apply.
#[derive(Clone, Debug, Default, Serialize)]
pub(crate) struct RenderProgress {
    pub doing: Doing,
    /// Samples per pixel so far, and at the end.
    pub spp: Option<u32>,
    pub target: Option<u32>,
    /// How much of the way to the end is done, in \[0, 1\].
    pub share: Option<f64>,
    /// The noise so far, and at the end.
    pub noise: Option<f64>,
    pub noise_target: Option<f64>,
    pub rays_per_second: Option<f64>,
    /// Seconds so far, and those that are left.
    pub seconds: Option<f64>,
    pub left: Option<f64>,
    /// Samples that were no numbers.
    pub dropped: Option<u64>,
}

/// What the viewer is doing.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize)]
#[serde(rename_all = "lowercase")]
pub(crate) enum Doing {
    Reading,
    Building,
    Rendering,
    Done,
    /// For a file that can be read.
    Waiting,
    #[default]
    Nothing,
}

/// The ray through a place of the picture; without a camera there is none.
#[derive(Clone, Debug, Default, Serialize)]
pub(crate) struct PickedRay {
    pub origin: Option<[f64; 3]>,
    pub direction: Option<[f64; 3]>,
    /// By distance.
    pub hits: Vec<ListedHit>,
}

/// Where a ray meets a shape.
#[derive(Clone, Debug, Serialize)]
pub(crate) struct ListedHit {
    #[serde(flatten)]
    pub shape: ListedShape,
    pub distance: f64,
    /// A page at rest does not know it.
    pub surface: Option<HitSurface>,
}

/// The surface at a hit.
#[derive(Clone, Debug, Serialize)]
pub(crate) struct HitSurface {
    pub point: [f64; 3],
    pub normal: [f64; 3],
    pub uv: [f64; 2],
    /// Whether the ray comes from outside.
    pub front: bool,
    pub primitive: u32,
    pub instance: Option<u32>,
}

/// A channel of a pixel: a number, or the text of what JSON has no number for, as `inf`.
#[derive(Clone, Debug, Serialize)]
#[serde(untagged)]
pub(crate) enum PixelValue {
    Number(f32),
    Text(String),
}

/// What a page at rest shows: see [`crate::export`].
#[derive(Debug, Serialize)]
pub(crate) struct StaticPage<'a> {
    pub name: String,
    pub scene: &'a SceneFacts,
    pub placement: Option<Placement>,
    pub camera: usize,
    pub progress: StaticProgress,
    pub channels: Vec<StaticChannel>,
    pub picks: StaticPicks,
}

/// How the picture of a page at rest was made.
#[derive(Debug, Serialize)]
pub(crate) struct StaticProgress {
    pub spp: u32,
    pub target: u32,
    pub noise: Option<f64>,
    pub seconds: f64,
    pub rays_per_second: f64,
}

/// A channel of a page at rest.
#[derive(Debug, Serialize)]
pub(crate) struct StaticChannel {
    pub name: Channel,
    /// A picture in base 64.
    pub png: String,
    /// Its numbers in half precision, compressed, in base 64; empty where the picture has them.
    pub values: String,
}

/// The hits in the middle of each pixel.
#[derive(Debug, Serialize)]
pub(crate) struct StaticPicks {
    pub shapes: Vec<ListedShape>,
    /// For each pixel the position of the shape in the list, from 1, or 0 for nothing, and its distance; compressed, in
    /// base 64.
    pub values: String,
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn messages_are_what_they_are_and_nothing_else() {
        let ticket =
            r#"{"type":"ticket","request":3,"errand":{"for":"explanation","language":"en","pixel":[7,5]}}"#;
        let errand = Errand::Explanation { language: "en".to_owned(), pixel: (7, 5) };
        assert_eq!(
            serde_json::from_str::<PageMessage>(ticket).unwrap(),
            PageMessage::Ticket { request: 3, errand }
        );
        let set: PageMessage =
            serde_json::from_str(r#"{"type":"set","paused":true,"channel":"ids"}"#).unwrap();
        let PageMessage::Set(options) = set else { panic!() };
        assert_eq!(
            (options.paused, options.channel, options.exposure),
            (Some(true), Some(Channel::Ids), None)
        );
        for text in [
            "",
            "[]",
            "7",
            r#"{"type":"open","path":"/etc/passwd"}"#,
            r#"{"type":"shown","more":1}"#,
            r#"{"type":"pick","x":"a","y":2,"request":3}"#,
            r#"{"type":"set","spp":-3}"#,
            r#"{"type":"set","channel":"../beauty"}"#,
            r#"{"type":"ticket","request":3,"errand":{"for":"file","path":"/etc/passwd"}}"#,
            r#"{"type":"ticket","request":3,"errand":{"for":"picture","format":"../png"}}"#,
            r#"{"type":"ticket","request":3,"errand":{"for":"explanation","language":"en","pixel":[3,-1]}}"#,
        ] {
            assert!(serde_json::from_str::<PageMessage>(text).is_err(), "{text}");
        }
    }
}
