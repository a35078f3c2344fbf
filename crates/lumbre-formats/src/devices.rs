//! Names that Windows keeps for devices, in every folder and with every ending.

use std::path::{Component, Path, Prefix};

/// A device that Windows opens in place of a file.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Device {
    /// `NUL` alone, which discards everything.
    Null,
    /// Any other: a console, a port, a pipe, or a name such as `nul.png`, which some versions take for `NUL`.
    Other,
}

/// The device of this path, on Windows; elsewhere no name is that of a device.
pub(crate) fn device(path: &Path) -> Option<Device> {
    if !cfg!(windows) {
        return None;
    }
    match path.components().next() {
        Some(Component::Prefix(prefix)) if prefix.kind().is_verbatim() => return None,
        Some(Component::Prefix(prefix)) if matches!(prefix.kind(), Prefix::DeviceNS(_)) => {
            return Some(Device::Other);
        }
        _ => {}
    }
    device_of_name(&path.file_name()?.to_string_lossy())
}

/// Whether Windows opens a device by this path, in place of a file; elsewhere no name is that of a device.
pub fn is_device_name(path: &Path) -> bool {
    device(path).is_some()
}

/// The device of a name without folders, by the rules of Microsoft, "Naming Files, Paths, and Namespaces": endings, and
/// spaces before them, make no difference.
fn device_of_name(name: &str) -> Option<Device> {
    let stem = name.split(['.', ':']).next().unwrap_or(name).trim_end_matches(' ').to_ascii_uppercase();
    let is_port = |prefix: &str| {
        let number = stem.strip_prefix(prefix).map(|rest| rest.chars().collect::<Vec<_>>());
        matches!(number.as_deref(), Some(['0'..='9' | '¹' | '²' | '³']))
    };
    match &*stem {
        "NUL" if name.len() == stem.len() => Some(Device::Null),
        "NUL" | "CON" | "PRN" | "AUX" | "CONIN$" | "CONOUT$" => Some(Device::Other),
        _ if is_port("COM") || is_port("LPT") => Some(Device::Other),
        _ => None,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn device_names_match_with_any_extension() {
        for name in ["nul", "NUL", "Nul"] {
            assert_eq!(device_of_name(name), Some(Device::Null), "{name}");
        }
        for name in ["nul.png", "nul .png", "NUL:", "con", "Con.pbrt", "com1", "LPT9.exr", "com²", "conout$"]
        {
            assert_eq!(device_of_name(name), Some(Device::Other), "{name}");
        }
        for name in
            ["null", "nul-1.png", "annul", "com", "com10.obj", "comx", "console.png", "auxiliary", ".nul"]
        {
            assert_eq!(device_of_name(name), None, "{name}");
        }
        // Elsewhere they are names like any other.
        assert_eq!(device(Path::new("folder/con.png")), cfg!(windows).then_some(Device::Other));
    }
}
