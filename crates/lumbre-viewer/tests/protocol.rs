//! The page has the messages of the viewer: its types are generated from `src/message.rs`.

use std::fmt::Write;

use syn::{Attribute, Expr, Fields, GenericArgument, Item, ItemEnum, ItemStruct, Lit, PathArguments, Type};

/// Set to write the page's types instead of comparing them.
const UPDATE: &str = "LUMBRE_UPDATE_MESSAGES";
const RUST: &str = include_str!("../src/message.rs");
const START: &str = "// Generated from src/message.rs by tests/protocol.rs: change that file, and run
//   LUMBRE_UPDATE_MESSAGES=1 cargo test -p lumbre-viewer --test integration protocol

/** A whole number from 0. */
export type Unsigned = number;
";

/// The types in TypeScript.
///
/// # Panics
/// On everything that it does not know how to write, such as another attribute of serde.
fn typescript(rust: &str) -> String {
    let mut out = START.to_owned();
    for item in syn::parse_file(rust).expect("Rust").items {
        match item {
            Item::Struct(item) => structure(&item, &mut out),
            Item::Enum(item) => enumeration(&item, &mut out),
            Item::Use(_) | Item::Impl(_) | Item::Fn(_) | Item::Mod(_) => {}
            _ => panic!("only types cross between viewer and page"),
        }
    }
    out
}

/// The attributes of serde that change what is written.
#[derive(Default)]
struct Serde {
    tag: Option<String>,
    is_lowercase: bool,
    is_untagged: bool,
    is_flat: bool,
    /// Missing fields are allowed.
    has_default: bool,
}

fn serde(attributes: &[Attribute]) -> Serde {
    let mut found = Serde::default();
    for attribute in attributes.iter().filter(|attribute| attribute.path().is_ident("serde")) {
        let parsed = attribute.parse_nested_meta(|meta| {
            let name = meta.path.require_ident()?.to_string();
            match name.as_str() {
                "tag" => found.tag = Some(meta.value()?.parse::<syn::LitStr>()?.value()),
                "rename_all" => {
                    assert_eq!(meta.value()?.parse::<syn::LitStr>()?.value(), "lowercase");
                    found.is_lowercase = true;
                }
                "untagged" => found.is_untagged = true,
                "flatten" => found.is_flat = true,
                "default" => found.has_default = true,
                "deny_unknown_fields" => {}
                _ => panic!("serde({name}) has no TypeScript yet"),
            }
            Ok(())
        });
        parsed.expect("attributes of serde");
    }
    found
}

/// The doc comment, as one of TypeScript. Links name items of Rust, whose module the page does not have.
fn doc(attributes: &[Attribute], indent: &str, out: &mut String) {
    let mut lines = Vec::new();
    for attribute in attributes.iter().filter(|attribute| attribute.path().is_ident("doc")) {
        let Expr::Lit(text) = &attribute.meta.require_name_value().expect("a doc comment").value else {
            continue;
        };
        let Lit::Str(text) = &text.lit else { continue };
        let mut line = text.value().trim().to_owned();
        for (rust, page) in [("\\[", "["), ("\\]", "]"), ("crate::", ""), ("`None`", "`null`")] {
            line = line.replace(rust, page);
        }
        lines.push(line);
    }
    let space = format!("\n{indent} * ");
    match &lines[..] {
        [] => {}
        [line] => writeln!(out, "{indent}/** {line} */").expect("a text"),
        lines => writeln!(out, "{indent}/**{space}{}\n{indent} */", lines.join(&space)).expect("a text"),
    }
}

fn structure(item: &ItemStruct, out: &mut String) {
    let known = serde(&item.attrs);
    let (bases, own): (Vec<_>, Vec<_>) = item.fields.iter().partition(|field| serde(&field.attrs).is_flat);
    let bases: Vec<_> = bases.iter().map(|field| name_of(&field.ty)).collect();
    out.push('\n');
    doc(&item.attrs, "", out);
    let extends = if bases.is_empty() { String::new() } else { format!(" extends {}", bases.join(", ")) };
    writeln!(out, "export interface {}{extends} {{", item.ident).expect("a text");
    for field in own {
        doc(&field.attrs, "  ", out);
        let name = field.ident.as_ref().expect("structs have names for their fields");
        let optional = if known.has_default { "?" } else { "" };
        writeln!(out, "  {name}{optional}: {};", name_of(&field.ty)).expect("a text");
    }
    out.push_str("}\n");
}

fn enumeration(item: &ItemEnum, out: &mut String) {
    let known = serde(&item.attrs);
    assert!(known.is_untagged || known.is_lowercase, "{}: names of variants are in lower case", item.ident);
    out.push('\n');
    doc(&item.attrs, "", out);
    write!(out, "export type {} =", item.ident).expect("a text");
    for variant in &item.variants {
        out.push('\n');
        doc(&variant.attrs, "  ", out);
        let name = variant.ident.to_string().to_lowercase();
        let written = match (&variant.fields, &known.tag) {
            (Fields::Unit, None) => format!("\"{name}\""),
            (Fields::Unnamed(inner), None) if known.is_untagged && inner.unnamed.len() == 1 => {
                name_of(&inner.unnamed[0].ty)
            }
            (Fields::Unnamed(inner), Some(tag)) if inner.unnamed.len() == 1 => {
                format!("({{ {tag}: \"{name}\" }} & {})", name_of(&inner.unnamed[0].ty))
            }
            (Fields::Named(fields), Some(tag)) => {
                let mut all = vec![format!("{tag}: \"{name}\"")];
                for field in &fields.named {
                    let name = field.ident.as_ref().expect("a name");
                    all.push(format!("{name}: {}", name_of(&field.ty)));
                }
                format!("{{ {} }}", all.join("; "))
            }
            _ => panic!("{}::{} has no TypeScript yet", item.ident, variant.ident),
        };
        write!(out, "  | {written}").expect("a text");
    }
    out.push_str(";\n");
}

/// A type in TypeScript.
fn name_of(of: &Type) -> String {
    match of {
        Type::Reference(reference) => name_of(&reference.elem),
        Type::Array(array) => {
            let Expr::Lit(length) = &array.len else { panic!("the length of an array is a number") };
            let Lit::Int(length) = &length.lit else { panic!("the length of an array is a number") };
            let length = length.base10_parse().expect("a length");
            format!("[{}]", vec![name_of(&array.elem); length].join(", "))
        }
        Type::Tuple(tuple) => format!("[{}]", tuple.elems.iter().map(name_of).collect::<Vec<_>>().join(", ")),
        Type::Path(path) => {
            let last = path.path.segments.last().expect("a name");
            let inner: Vec<String> = match &last.arguments {
                PathArguments::AngleBracketed(all) => all.args.iter().filter_map(argument).collect(),
                PathArguments::None | PathArguments::Parenthesized(_) => Vec::new(),
            };
            let name = last.ident.to_string();
            match (name.as_str(), &inner[..]) {
                ("bool", []) => "boolean".to_owned(),
                ("f32" | "f64", []) => "number".to_owned(),
                ("u8" | "u16" | "u32" | "u64" | "usize", []) => "Unsigned".to_owned(),
                ("String", []) => "string".to_owned(),
                ("Box", [inner]) => inner.clone(),
                ("Option", [inner]) => format!("{inner} | null"),
                ("Vec", [inner]) if inner.contains(' ') && !inner.starts_with('[') => format!("({inner})[]"),
                ("Vec", [inner]) => format!("{inner}[]"),
                ("BTreeMap", [key, value]) if key == "string" => format!("Record<string, {value}>"),
                (_, []) if RUST.contains(&format!(" {name} {{")) || RUST.contains(&format!(" {name}<")) => {
                    name
                }
                _ => panic!("{name} has no TypeScript yet: a type of messages is in src/message.rs"),
            }
        }
        _ => panic!("a type that has no TypeScript yet"),
    }
}

fn argument(argument: &GenericArgument) -> Option<String> {
    match argument {
        GenericArgument::Type(of) => Some(name_of(of)),
        _ => None,
    }
}

#[test]
fn the_page_has_the_types_of_the_viewers_messages() {
    let path = concat!(env!("CARGO_MANIFEST_DIR"), "/web/src/messages.ts");
    let generated = typescript(RUST);
    if std::env::var_os(UPDATE).is_some() {
        std::fs::write(path, &generated).unwrap();
    }
    let known = std::fs::read_to_string(path).unwrap();
    assert!(known == generated, "{path} is not up to date: {UPDATE}=1 writes it; then adapt the page");
}

#[test]
fn the_page_knows_the_header_of_a_frame() {
    let [rust, page] = ["src/frame.rs", "web/src/frame.ts"]
        .map(|file| std::fs::read_to_string(format!("{}/{file}", env!("CARGO_MANIFEST_DIR"))).unwrap());
    assert!(rust.contains("HEADER: usize = 40;") && page.contains("HEADER = 40;"));
    let magic = format!("MAGIC = {:#x};", u32::from_le_bytes(*b"LUM2"));
    assert!(rust.contains("from_le_bytes(*b\"LUM2\");") && page.contains(&magic), "{magic}");
}

#[test]
fn each_change_of_a_message_changes_the_pages_types() {
    let before = typescript(RUST);
    for (old, new) in [
        ("    pub zoom: f64,\n", ""),
        ("    pub zoom: f64,\n", "    pub zoom: f64,\n    pub tilt: f64,\n"),
        ("    pub zoom: f64,\n", "    pub zoom: Option<f64>,\n"),
        ("    pub zoom: f64,\n", "    pub magnification: f64,\n"),
        ("sequence: u32, camera: usize }", "sequence: f64, camera: usize }"),
        ("sequence: u32, camera: usize }", "camera: usize }"),
        ("    /// Why the page's message was refused.\n    Wrong { what: String },\n", ""),
        ("    Ids,\n", "    Ids,\n    Primitives,\n"),
        ("    #[serde(flatten)]\n", ""),
        ("#[serde(tag = \"for\"", "#[serde(tag = \"purpose\""),
    ] {
        assert!(RUST.contains(old), "{old}");
        assert_ne!(typescript(&RUST.replacen(old, new, 1)), before, "{new}");
    }
}

#[test]
fn every_message_is_written_by_its_type() {
    for file in ["session", "socket", "worker", "stage", "tree", "export"] {
        let path = format!("{}/src/{file}.rs", env!("CARGO_MANIFEST_DIR"));
        let text = std::fs::read_to_string(path).unwrap();
        assert!(!text.contains("json!"), "{file}.rs makes JSON that src/message.rs does not declare");
    }
}
