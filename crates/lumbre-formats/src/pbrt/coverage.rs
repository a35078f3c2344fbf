//! The page of the book that says what becomes of every directive, type and parameter, made from what the reader asks
//! for and says.

#![allow(clippy::unwrap_used, reason = "tests may panic")]

use std::collections::{BTreeMap, BTreeSet};
use std::fs;

use super::pages::{KINDS, docs, required, scene, special};
use super::params::{Type, asked};
use super::parser::Parser;
use super::{read_bytes, settings};
use crate::{Budget, Diagnostics};

/// Set to write the page instead of comparing it.
const UPDATE: &str = "LUMBRE_UPDATE_PAGES";

/// Kinds of things: their folder in the book, the noun of the reader for their owner, their directive, and types
/// besides those of [`KINDS`].
const ALL: [(&str, &str, &str, &[&str]); 12] = [
    ("cameras", "camera", "Camera", &["environment"]),
    ("films", "film", "Film", &["rgb", "gbuffer", "spectral", "image"]),
    (
        "samplers",
        "sampler",
        "Sampler",
        &[
            "zsobol",
            "paddedsobol",
            "sobol",
            "halton",
            "pmj02bn",
            "independent",
            "stratified",
            "random",
            "02sequence",
            "lowdiscrepancy",
            "maxmindist",
        ],
    ),
    ("filters", "filter", "PixelFilter", &["gaussian", "box", "mitchell", "sinc", "triangle"]),
    ("integrators", "integrator", "Integrator", &["function", "directlighting"]),
    ("accelerators", "accelerator", "Accelerator", &["bvh", "kdtree"]),
    ("shapes", "shape", "Shape", &["heightfield", "nurbs"]),
    (
        "materials",
        "material",
        "Material",
        &[
            "matte",
            "plastic",
            "substrate",
            "mirror",
            "metal",
            "glass",
            "translucent",
            "disney",
            "uber",
            "kdsubsurface",
            "fourier",
        ],
    ),
    ("textures", "texture", "Texture", &[]),
    ("lights", "light", "LightSource", &[]),
    ("arealights", "light", "AreaLightSource", &["diffuse", "area"]),
    ("media", "medium", "MakeNamedMedium", &["heterogeneous"]),
];

/// Why parameters that are read without a word have no effect.
const REASONS: [(&str, &str); 35] = [
    ("lightsampler", "lights are chosen by a tree: it changes the noise alone"),
    ("samplelights", "lights are always sampled: it changes the noise alone"),
    ("samplebsdf", "surfaces are always sampled: it changes the noise alone"),
    ("lightsamplestrategy", "lights are chosen by a tree: it changes the noise alone"),
    ("rrthreshold", "paths end by their throughput: it changes the noise alone"),
    ("strategy", "it changes the noise alone"),
    ("dimensions", "the points have the dimensions that they need"),
    ("nsamples", "it changes the noise alone"),
    ("samples", "it changes the noise alone"),
    ("maxsampleluminance", "of pbrt-v3; `maxcomponentvalue` holds samples"),
    ("shadowalpha", "of pbrt-v3; `alpha` is for shadows, too"),
    ("discarddegenerateUVs", "of pbrt-v3; such triangles have tangents of their own"),
    (
        "emissionfilename",
        "it says how pbrt-v4 samples a lamp; the picture of the light is `filename` of its AreaLightSource",
    ),
    ("scheme", "of pbrt-v3; Loop's is the only one"),
    ("aamode", "of pbrt-v3; look-ups are filtered"),
    ("remaproughness", "of pbrt-v3; this material has no microfacets"),
    ("main_specular_sampling_rate", "it changes the noise alone"),
    ("diffuse_reflectance_sampling_rate", "it changes the noise alone"),
    ("clearcoat_sampling_rate", "it changes the noise alone"),
    ("specular_sampling_rate", "it changes the noise alone"),
    ("type", "it is the type itself"),
    ("splitdepth", "curves are met exactly, without splitting"),
    ("splitmethod", "the tree is Lumbre's own: it changes no picture"),
    ("maxnodeprims", "the tree is Lumbre's own: it changes no picture"),
    ("wavefront", "there is one way to render, by the processor"),
    ("rendercoordsys", "points have double precision in any space"),
    ("mfp", "the default of another parameter stands in its place"),
    ("subsurface_color", "of use with a subsurface_weight of 1 alone"),
    ("subsurface_radius", "of use with a subsurface_weight of 1 alone"),
    ("subsurface_radius_scale", "of use with a subsurface_weight of 1 alone"),
    ("subsurface_scatter_anisotropy", "of use with a subsurface_weight of 1 alone"),
    ("emission_color", "an AreaLightSource shines: see emission_luminance"),
    ("temperaturecutoff", "of use with a grid of temperatures alone"),
    ("temperatureoffset", "of use with a grid of temperatures alone"),
    ("temperaturescale", "of use with a grid of temperatures alone"),
];

/// What becomes of something.
#[derive(Clone, Debug, PartialEq)]
enum Fate {
    Rendered,
    /// Read without a word, and of no effect.
    Ignored,
    /// Rendered, with something to say.
    Noted(String),
    Warned(String),
    Refused(String),
}

/// The message without its place.
fn message(line: &str) -> String {
    let words = ["warning: ", "error: ", "note: "];
    let at = words.iter().filter_map(|word| Some(line.find(word)? + word.len())).min().unwrap_or(0);
    let rest = &line[at..];
    let rest = rest.strip_prefix("scene.pbrt:").map_or(rest, |place| {
        place.trim_start_matches(|c: char| c.is_ascii_digit() || c == ':').trim_start()
    });
    rest.replace('|', "\\|")
}

/// What becomes of a scene, and what was asked for while it was read.
fn read(text: &str) -> (Fate, Vec<asked::Asked>) {
    asked::take();
    let mut said = Diagnostics::new();
    let folder = docs().join("pictures");
    let read = read_bytes("scene.pbrt", text.as_bytes(), Some(&folder), &Budget::default(), &mut said);
    let lines = said.lines();
    let is_new = |line: &&String| !line.contains("the scene is upgraded");
    let lines: Vec<&String> = lines.iter().filter(is_new).collect();
    let warning = lines.iter().find(|line| line.starts_with("warning"));
    let fate = match (read, warning, lines.first()) {
        (Err(error), ..) => Fate::Refused(message(&error.to_string())),
        (Ok(_), Some(line), _) => Fate::Warned(message(line)),
        (Ok(_), None, Some(line)) => Fate::Noted(message(line)),
        (Ok(_), None, None) => Fate::Rendered,
    };
    (fate, asked::take())
}

/// Values of a parameter of this type, as a list of parameters has them.
fn values(page: &str, name: &str, ty: Type, choices: &[&'static str]) -> Vec<String> {
    let typical: &[&str] = match ty {
        Type::Bool => &["true", "false"],
        Type::Float => &["0.3", "0.75", "2", "20", "400", "700", "0.1 0.2 0.3 0.4", "0 1 0 1"],
        Type::Integer => &["1", "2", "3", "0 1 2", "0 4 0 4"],
        Type::Point2 | Type::Vector2 => &["0.2 0.3", "0 0 1 0 0 1"],
        Type::Point3 | Type::Vector3 | Type::Normal => &["0.2 0.3 0.4", "0 0 0 1 0 0 0 1 0"],
        Type::String => &["\"one\"", "\"srgb\""],
        Type::Texture => &["\"tex\""],
        Type::Rgb => &["0.2 0.3 0.4"],
        Type::Blackbody => &["3000"],
        Type::Spectrum => &["\"metal-Cu-eta\"", "400 0.5 700 0.6"],
    };
    let words = choices.iter().map(|word| format!("\"{word}\""));
    let typical = typical.iter().map(|value| (*value).to_owned());
    let special = special(page, name).map(str::to_owned);
    let values =
        if choices.is_empty() { special.into_iter().chain(typical).collect() } else { words.collect() };
    let values: Vec<String> = values;
    values.iter().map(|value| format!(" \"{} {name}\" [ {value} ]", ty.name())).collect()
}

/// The types of a parameter for which the reader does not say which it accepts.
const TYPES: [Type; 11] = [
    Type::Float,
    Type::Rgb,
    Type::Spectrum,
    Type::Texture,
    Type::String,
    Type::Bool,
    Type::Integer,
    Type::Point2,
    Type::Point3,
    Type::Normal,
    Type::Blackbody,
];

/// A parameter as the reader knows it.
#[derive(Clone, Debug, Default)]
struct Known {
    types: Vec<Type>,
    choices: Vec<&'static str>,
    /// What has to be given besides for it to be asked for.
    context: String,
}

/// What becomes of the parameters of a thing, and of single values of them.
fn parameters(kind: &str, noun: &str, ty: &str) -> (Fate, BTreeMap<String, Fate>) {
    let base = match ty {
        "heightfield" => " \"integer nu\" 2 \"integer nv\" 2 \"float Pz\" [0 0 0 1]".to_owned(),
        "nurbs" => " \"integer nu\" 2 \"integer nv\" 2 \"integer uorder\" 2 \"integer vorder\" 2 \"float uknots\" [0 0 1 1] \
                     \"float vknots\" [0 0 1 1] \"point3 P\" [0 0 0 1 0 0 0 1 0 1 1 1]"
            .to_owned(),
        "heterogeneous" => " \"float density\" 0.5".to_owned(),
        _ => required(kind, ty),
    };
    // Media are known by their own name.
    let owner = format!("{noun} \"{}\"", if kind == "media" { "m" } else { ty });
    let (fate, first) = read(&scene(kind, ty, &base));
    let mut known: BTreeMap<&'static str, Known> = BTreeMap::new();
    let mut queue: Vec<&'static str> = Vec::new();
    fn learn(
        all: Vec<asked::Asked>,
        owner: &str,
        context: &str,
        known: &mut BTreeMap<&'static str, Known>,
        queue: &mut Vec<&'static str>,
    ) {
        for asked in all.into_iter().filter(|asked| asked.owner == owner) {
            let entry = known.entry(asked.name).or_insert_with(|| {
                queue.push(asked.name);
                Known { context: context.to_owned(), ..Known::default() }
            });
            for ty in asked.types {
                if !entry.types.contains(&ty) {
                    entry.types.push(ty);
                }
            }
            for choice in asked.choices {
                if !entry.choices.contains(&choice) {
                    entry.choices.push(choice);
                }
            }
        }
    }
    learn(first, &owner, "", &mut known, &mut queue);
    let mut fates = BTreeMap::new();
    while let Some(name) = queue.pop() {
        if kind == "media" && name == "type" {
            // It is the type itself.
            continue;
        }
        let Known { types, choices, context } = known[name].clone();
        let types = if types.is_empty() { TYPES.to_vec() } else { types };
        let mut best: Option<Fate> = None;
        for text in types.iter().flat_map(|of| values(ty, name, *of, &choices)) {
            let given = format!("{base}{context}{text}");
            let (found, all) = read(&scene(kind, ty, &given));
            let own: Vec<&asked::Asked> =
                all.iter().filter(|asked| asked.owner == owner && asked.name == name).collect();
            let is_ignored = !own.is_empty() && own.iter().all(|asked| asked.is_ignored);
            let found = if is_ignored && found == Fate::Rendered { Fate::Ignored } else { found };
            if !matches!(found, Fate::Refused(_)) {
                learn(all, &owner, &format!("{context}{text}"), &mut known, &mut queue);
            }
            let is_word = !choices.is_empty() || text.contains("\"bool ");
            if is_word
                && let Fate::Warned(_) | Fate::Refused(_) = found
                && found != fate
            {
                let value = text.rsplit('[').next().unwrap_or("").trim_matches([' ', ']', '"']);
                fates.insert(format!("{name}` = `{value}"), found.clone());
            }
            let rank = |fate: &Fate| match fate {
                Fate::Rendered => 0,
                Fate::Noted(_) => 1,
                Fate::Ignored => 2,
                Fate::Warned(_) => 3,
                Fate::Refused(_) => 4,
            };
            if best.as_ref().is_none_or(|best| rank(&found) < rank(best)) {
                best = Some(found);
            }
            // The first accepted value decides; strings are listed one by one.
            if best == Some(Fate::Rendered) && choices.is_empty() && !text.contains("\"bool ") {
                break;
            }
        }
        if let Some(best) = best {
            fates.insert(name.to_owned(), best);
        }
    }
    (fate, fates)
}

/// The reason of a parameter without effect.
fn reason(name: &str) -> Option<&'static str> {
    REASONS.iter().find(|(known, _)| *known == name).map(|(_, reason)| *reason)
}

/// What is said of a thing besides that it is rendered.
fn told(fate: &Fate) -> Option<(&'static str, &str)> {
    match fate {
        Fate::Rendered => None,
        Fate::Ignored => Some(("no effect", "")),
        Fate::Noted(what) => Some(("rendered", what)),
        Fate::Warned(why) => Some(("warned", why)),
        Fate::Refused(why) => Some(("refused", why)),
    }
}

fn page() -> (String, Vec<String>) {
    let mut text = String::from(HEAD);
    let mut without_reason = Vec::new();
    let mut count = 0;
    for (kind, noun, directive, others) in ALL {
        let names = KINDS.iter().find(|(known, _)| *known == kind).map_or(&[][..], |(_, names)| names);
        text += &format!("\n## {directive}\n\n| type | parameters that are rendered |\n|---|---|\n");
        let mut rest = String::new();
        for ty in names.iter().chain(others) {
            let (of_type, parameters) = parameters(kind, noun, ty);
            let rendered: Vec<String> = parameters
                .iter()
                .filter(|(name, fate)| {
                    // Refused is the value that was tried, or that it was tried alone.
                    let is_other = matches!(fate, Fate::Refused(_)) && !name.contains('=');
                    **fate == Fate::Rendered || **fate == of_type || is_other
                })
                .map(|(name, _)| format!("`{name}`"))
                .collect();
            if let Some((what, why)) = told(&of_type) {
                rest += &format!("| `{ty}` | | {what} | {why} |\n");
            }
            if let Fate::Warned(_) | Fate::Refused(_) = of_type {
                // Nothing of it is rendered.
                continue;
            }
            count += rendered.len();
            text += &format!("| `{ty}` | {} |\n", rendered.join(", "));
            for (name, fate) in parameters.iter().filter(|(_, fate)| !matches!(fate, Fate::Refused(_))) {
                let (Some((what, why)), false) = (told(fate), *fate == of_type) else { continue };
                let why = if *fate == Fate::Ignored { reason(name).unwrap_or("") } else { why };
                if why.is_empty() {
                    without_reason.push(format!("{kind} {ty} {name}"));
                }
                rest += &format!("| `{ty}` | `{name}` | {what} | {why} |\n");
            }
        }
        if !rest.is_empty() {
            text += &format!("\n| type | parameter | | why |\n|---|---|---|---|\n{rest}");
        }
    }
    text += "\n## Option\n\n| option | | why |\n|---|---|---|\n";
    for name in settings::OPTIONS {
        let values = ["true", "false", "2", "\"a\""];
        let fates = values.map(|value| read(&format!("Option \"{name}\" {value}\nWorldBegin")).0);
        let is_accepted = fates.contains(&Fate::Rendered);
        let warned = fates.iter().find(|fate| matches!(fate, Fate::Warned(_)));
        let line = match (warned, is_accepted, reason(name)) {
            (Some(Fate::Warned(why)), ..) => format!("warned | {why}"),
            (_, true, Some(reason)) => format!("no effect | {reason}"),
            (_, true, None) => "rendered | ".to_owned(),
            _ => {
                without_reason.push(format!("option {name}"));
                String::new()
            }
        };
        text += &format!("| `{name}` | {line} |\n");
    }
    let with_types: BTreeSet<&str> =
        ALL.iter().map(|(_, _, directive, _)| *directive).chain(["Option"]).collect();
    let plain: Vec<String> = Parser::directives()
        .into_iter()
        .filter(|name| !with_types.contains(name))
        .map(|name| format!("`{name}`"))
        .collect();
    text += &format!(
        "\n## Other directives\n\nThey have the meaning that they have in pbrt-v4: {}.\n",
        plain.join(", ")
    );
    text += TAIL;
    assert!(count > 400, "{count} parameters are rendered");
    (text, without_reason)
}

const HEAD: &str = "\
# What is rendered

Every directive of pbrt-v4, with its types and parameters, and what becomes of each. The tables are made by a test, from what the reader asks for and what it says; the additions of
[Lumbre](scene-language.md) and what is read of pbrt-v3 are in them, too.

- *Rendered*: it has the meaning of pbrt-v4, or that of its page in this book.
- *No effect*: it is read without a word, and changes no picture.
- *Warned*: it is left out or replaced, with a warning that has its place. `--strict` makes an error of it.
- *Refused*: it is an error.

An unknown name gives a warning with the nearest known one. Values out of their range, and parameters without others that they need, are errors.
";

const TAIL: &str = "\n\
`ActiveTransform` and `TransformTimes` move shapes, instances and cameras. Lights and media stay where they start, and a warning says so; so it is where a light stands inside an \
object. `ColorSpace` is that of `rgb` parameters; a film in another one than `srgb` has the colours of the scene in the numbers of sRGB, and a warning says so. `SurfaceIntegrator` and \
`WorldEnd` are of pbrt-v3.\n";

#[test]
fn the_coverage_table_is_that_of_the_reader() {
    let (text, without_reason) = page();
    assert_eq!(without_reason, [""; 0], "parameters without effect, and no reason for that");
    let path = docs().join("coverage.md");
    if std::env::var_os(UPDATE).is_some() {
        fs::write(&path, text).unwrap();
    } else if fs::read_to_string(&path).unwrap_or_default() != text {
        panic!("{} is not what the reader does: cargo xtask book --update writes it", path.display());
    }
}
