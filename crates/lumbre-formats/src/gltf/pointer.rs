//! Numbers anywhere in a glTF that animations change (`KHR_animation_pointer`, Khronos, 2025): the JSON is
//! edited to the values at one time, before it is interpreted.

use std::collections::BTreeMap;

use super::json::{Read, Value};

/// Top-level members that may contain animated numbers.
const ROOTS: [&str; 5] = ["cameras", "extensions", "materials", "meshes", "nodes"];
/// An upper bound on the depth of any number in glTF.
const DEEPEST: usize = 10;

/// Whether an animation of this pointer's value is played: a number, or a list of numbers, that glTF lets
/// change.
pub(super) fn is_played(pointer: &str) -> bool {
    let Some(path) = pointer.strip_prefix('/') else { return false };
    let steps: Vec<&str> = path.split('/').collect();
    steps.len() >= 3 && steps.len() <= DEEPEST && ROOTS.contains(&steps[0]) && !steps.contains(&"")
}

/// Whether the value of a pointer exists, or its object does, to which it can be added.
pub(super) fn has_place(root: Value<'_>, pointer: &str) -> Read<bool> {
    let mut here = root;
    for step in pointer.split('/').skip(1) {
        match inside(here, &unescaped(step))? {
            Some(found) => here = found,
            None => return Ok(here.object().is_ok()),
        }
    }
    Ok(true)
}

/// The value that a step leads to: a member of an object, or an element of a list.
fn inside<'a>(value: Value<'a>, step: &str) -> Read<Option<Value<'a>>> {
    if value.object().is_ok() {
        return value.get(step);
    }
    Ok(match (value.array(), step.parse::<usize>()) {
        (Ok(mut list), Ok(position)) => list.nth(position),
        _ => None,
    })
}

/// A step with escapes resolved.
fn unescaped(step: &str) -> String {
    step.replace("~1", "/").replace("~0", "~")
}

/// Values by pointers, which have passed [`is_played`].
#[derive(Debug, Default)]
pub(super) struct Changes {
    top: Change,
}

#[derive(Debug, Default)]
struct Change {
    text: Option<String>,
    inside: BTreeMap<String, Change>,
}

impl Changes {
    /// Sets a list of numbers, or a single one. False, and nothing changes, if they or a part of them are
    /// already set.
    pub(super) fn set(&mut self, pointer: &str, numbers: &[f64], is_list: bool) -> bool {
        // In the precision that they were stored in, so that a factor between two of 1 is 1.
        let texts: Vec<String> = numbers.iter().map(|n| format!("{}", *n as f32)).collect();
        let is_switch = pointer.ends_with("/KHR_node_visibility/visible");
        let text = if is_switch {
            numbers.first().is_some_and(|&n| n != 0.0).to_string()
        } else if is_list {
            format!("[{}]", texts.join(","))
        } else {
            texts.concat()
        };
        let mut here = &mut self.top;
        for step in pointer.split('/').skip(1) {
            if here.text.is_some() {
                return false;
            }
            here = here.inside.entry(unescaped(step)).or_default();
        }
        if here.text.is_some() || !here.inside.is_empty() {
            return false;
        }
        here.text = Some(text);
        true
    }

    /// Whether nothing is set.
    pub(super) fn is_empty(&self) -> bool {
        self.top.inside.is_empty()
    }

    /// The text of `root` with the changes.
    ///
    /// # Errors
    /// When a member occurs twice.
    pub(super) fn apply(&self, root: Value<'_>) -> Read<String> {
        // Ranges of the text, with their replacements.
        let mut edits: Vec<(std::ops::Range<usize>, String)> = vec![];
        let mut open = vec![(&self.top, root)];
        while let Some((change, value)) = open.pop() {
            if let Some(text) = &change.text {
                edits.push((value.range(), text.clone()));
                continue;
            }
            let is_object = value.object().is_ok();
            let mut added = String::new();
            for (step, inner) in &change.inside {
                match inside(value, step)? {
                    Some(found) => open.push((inner, found)),
                    // A list does not grow.
                    None if is_object => added += &format!("{}:{},", quoted(step), inner.written()),
                    None => {}
                }
            }
            if !added.is_empty() {
                let start = value.range().start + 1;
                if value.inside().next().is_none() {
                    added.pop();
                }
                edits.push((start..start, added));
            }
        }
        edits.sort_by_key(|(range, _)| (range.start, range.end));
        let mut out = String::with_capacity(root.text().len() + 64 * edits.len());
        let mut at = 0;
        for (range, text) in edits {
            out += &root.text()[at..range.start];
            out += &text;
            at = range.end;
        }
        out += &root.text()[at..];
        Ok(out)
    }
}

impl Change {
    /// A new value. Pointers are short, so the recursion is shallow.
    fn written(&self) -> String {
        if let Some(text) = &self.text {
            return text.clone();
        }
        let members: Vec<String> =
            self.inside.iter().map(|(step, inner)| format!("{}:{}", quoted(step), inner.written())).collect();
        format!("{{{}}}", members.join(","))
    }
}

/// A JSON string.
fn quoted(text: &str) -> String {
    let mut out = String::from('"');
    for c in text.chars() {
        match c {
            '"' | '\\' => out.extend(['\\', c]),
            c if u32::from(c) < 0x20 => out += &format!("\\u{:04x}", u32::from(c)),
            c => out.push(c),
        }
    }
    out.push('"');
    out
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Budget;
    use crate::gltf::json::Json;

    fn changed(text: &str, changes: &[(&str, &[f64], bool)]) -> String {
        let json = Json::read(text, &"a.gltf".into(), None, &Budget::default()).unwrap();
        let mut set = Changes::default();
        for (pointer, numbers, is_list) in changes {
            assert!(is_played(pointer), "{pointer}");
            assert!(set.set(pointer, numbers, *is_list), "{pointer}");
        }
        set.apply(json.root()).unwrap()
    }

    #[test]
    fn numbers_are_replaced_or_added() {
        let text = r#"{"materials": [{ }, {"pbr": {"colour": [1, 2 , 3 ] , "rough":5},"n":1e3 }], "nodes":[{"x":[]}]}"#;
        let found = changed(
            text,
            &[
                ("/materials/1/pbr/colour", &[0.25, 7.0], true),
                ("/materials/1/pbr/rough", &[0.5], false),
                ("/materials/1/n", &[-2.0], false),
                ("/materials/1/extensions/E/a", &[3.0], false),
                ("/materials/1/extensions/E/b", &[4.0], true),
                ("/materials/0/more", &[9.5], false),
                ("/materials/7/more", &[9.5], false),
                ("/nodes/0/x", &[1.5], true),
            ],
        );
        assert_eq!(
            found,
            r#"{"materials": [{"more":9.5 }, {"extensions":{"E":{"a":3,"b":[4]}},"pbr": {"colour": [0.25,7] , "rough":0.5},"n":-2 }], "nodes":[{"x":[1.5]}]}"#
        );
        Json::read(&found, &"a.gltf".into(), None, &Budget::default()).unwrap();
    }

    #[test]
    fn what_is_set_is_set_once_and_as_a_whole() {
        let mut set = Changes::default();
        assert!(set.is_empty() && set.set("/nodes/3/scale", &[1.0, 2.0, 3.0], true) && !set.is_empty());
        assert!(!set.set("/nodes/3/scale", &[4.0, 5.0, 6.0], true));
        assert!(!set.set("/nodes/3/scale/0", &[4.0], false));
        assert!(set.set("/nodes/4/weights/2", &[4.0], false));
        assert!(!set.set("/nodes/4/weights", &[4.0], true));
    }

    #[test]
    fn only_numbers_deep_inside_known_lists_are_played() {
        for pointer in ["", "nodes/0/x", "/nodes", "/nodes/0", "/buffers/0/byteLength", "/nodes//x", "/a/b/c"]
        {
            assert!(!is_played(pointer), "{pointer}");
        }
        let deep = format!("/nodes/0{}", "/x".repeat(20));
        assert!(!is_played(&deep));
    }
}
