//! The messages of a page.

use serde::Deserialize;

use crate::camera::Placement;
use crate::frame::Channel;

/// A message of a page. Unknown fields are an error: the page is part of the same program.
#[derive(Clone, Debug, Deserialize, PartialEq)]
#[serde(tag = "type", rename_all = "lowercase", deny_unknown_fields)]
pub(crate) enum Message {
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
    /// A moment of an animation, a variant.
    Moment { time: Option<f64>, variant: Option<String> },
    /// Asks for the shapes at a pixel of the full picture.
    Pick { x: f64, y: f64, request: u32 },
    /// Asks for an address of an HTTP request.
    Ticket { request: u32, errand: Errand },
    /// The values of a rectangle of pixels.
    Values { x: u32, y: u32, width: u32, height: u32, request: u32 },
}

/// The first message of a page.
#[derive(Clone, Debug, Deserialize, PartialEq)]
#[serde(tag = "type", rename_all = "lowercase", deny_unknown_fields)]
pub(crate) enum Greeting {
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
    /// It sends a scene.
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
