//! What a page says.

use serde::{Deserialize, Serialize};

use crate::camera::Placement;
use crate::frame::{Channel, Map};

/// A message of a page. Whatever else one holds is an error: a page is of the same program.
#[derive(Clone, Debug, Deserialize, PartialEq)]
#[serde(tag = "type", rename_all = "lowercase", deny_unknown_fields)]
pub(crate) enum Message {
    /// It has shown the last frame, and can take another.
    Shown {},
    /// The camera is there now.
    Camera { sequence: u32, placement: Placement, fov: Option<f64>, zoom: f64 },
    /// One of the file's cameras, as it is.
    Reset { sequence: u32, camera: usize },
    /// What is rendered, and how it is shown.
    Set(Box<Wishes>),
    /// A parameter of the scene; without a value that of the file.
    Edit { path: String, value: Option<String> },
    /// Shapes that are hidden, or with `others` all but these; none shows everything.
    Hide { shapes: Vec<u32>, others: bool },
    /// What is in front of a plane, where its normal points, is not seen by the camera; without a plane, everything is.
    Section { plane: Option<Plane> },
    /// A moment of an animation, a variant.
    Moment { time: Option<f64>, variant: Option<String> },
    /// What is there at a pixel of the full picture.
    Pick { x: f64, y: f64, request: u32 },
    /// An address for what goes beside the socket.
    Ticket { request: u32, errand: Errand },
    /// The values of a rectangle of pixels.
    Values { x: u32, y: u32, width: u32, height: u32, request: u32 },
}

/// A plane by a point and a normal of any length but 0.
#[derive(Clone, Copy, Debug, Deserialize, Serialize, PartialEq)]
#[serde(deny_unknown_fields)]
pub(crate) struct Plane {
    pub point: [f64; 3],
    pub normal: [f64; 3],
}

impl Message {
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
pub(crate) enum Greeting {
    /// It proves to be one that may come in: see [`crate::guard::Guard::admit`].
    Hello { nonce: String, proof: String },
}

/// What a page does by a request of its own, for which it has a ticket that works once.
#[derive(Clone, Debug, Deserialize, PartialEq)]
#[serde(tag = "for", rename_all = "lowercase", deny_unknown_fields)]
pub(crate) enum Errand {
    /// It takes the picture as a file.
    Picture { format: FileFormat },
    /// It takes a page on how the colour of a pixel comes about.
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

/// What a page asks for; what is not in it stays.
#[derive(Clone, Debug, Default, Deserialize, PartialEq)]
#[serde(default, deny_unknown_fields)]
pub(crate) struct Wishes {
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
    pub map: Option<Map>,
    /// The numbers at both ends of these colours; none to find them.
    pub range: Option<Vec<f32>>,
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn messages_are_what_they_are_and_nothing_else() {
        let ticket =
            r#"{"type":"ticket","request":3,"errand":{"for":"explanation","language":"en","pixel":[7,5]}}"#;
        let errand = Errand::Explanation { language: "en".to_owned(), pixel: (7, 5) };
        assert_eq!(serde_json::from_str::<Message>(ticket).unwrap(), Message::Ticket { request: 3, errand });
        let set: Message = serde_json::from_str(r#"{"type":"set","paused":true,"channel":"ids"}"#).unwrap();
        let Message::Set(wishes) = set else { panic!() };
        assert_eq!((wishes.paused, wishes.channel, wishes.exposure), (Some(true), Some(Channel::Ids), None));
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
            assert!(serde_json::from_str::<Message>(text).is_err(), "{text}");
        }
    }
}
