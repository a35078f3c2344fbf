//! A glTF file with its lists and buffers.

use std::borrow::Cow;
use std::cell::{Cell, RefCell};
use std::collections::{HashMap, HashSet};
use std::path::Path;
use std::sync::Arc;

use super::json::{Read, Value};
use super::uri::{DataUri, Target, base64_decoded, percent_decoded_bytes, target};
use crate::budget::{Budget, BudgetVec};
use crate::diagnostic::{Diagnostic, Diagnostics, FormatError, Place, Severity, Strictness, quoted};
use crate::input::Input;

/// The top-level lists, and those of extensions.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum List {
    Accessors,
    Animations,
    Buffers,
    BufferViews,
    Cameras,
    Images,
    Materials,
    Meshes,
    Nodes,
    Samplers,
    Scenes,
    Skins,
    Textures,
    Lights,
    Profiles,
    Variants,
}

impl List {
    const ALL: [Self; 16] = [
        Self::Accessors,
        Self::Animations,
        Self::Buffers,
        Self::BufferViews,
        Self::Cameras,
        Self::Images,
        Self::Materials,
        Self::Meshes,
        Self::Nodes,
        Self::Samplers,
        Self::Scenes,
        Self::Skins,
        Self::Textures,
        Self::Lights,
        Self::Profiles,
        Self::Variants,
    ];

    /// Its extension, if any, its name, and the noun for one element.
    fn names(self) -> (Option<&'static str>, &'static str, &'static str) {
        match self {
            Self::Accessors => (None, "accessors", "an accessor"),
            Self::Animations => (None, "animations", "an animation"),
            Self::Buffers => (None, "buffers", "a buffer"),
            Self::BufferViews => (None, "bufferViews", "a buffer view"),
            Self::Cameras => (None, "cameras", "a camera"),
            Self::Images => (None, "images", "an image"),
            Self::Materials => (None, "materials", "a material"),
            Self::Meshes => (None, "meshes", "a mesh"),
            Self::Nodes => (None, "nodes", "a node"),
            Self::Samplers => (None, "samplers", "a sampler"),
            Self::Scenes => (None, "scenes", "a scene"),
            Self::Skins => (None, "skins", "a skin"),
            Self::Textures => (None, "textures", "a texture"),
            Self::Lights => (Some("KHR_lights_punctual"), "lights", "a light"),
            Self::Profiles => (Some("EXT_lights_ies"), "lights", "a light profile"),
            Self::Variants => (Some("KHR_materials_variants"), "variants", "a variant"),
        }
    }
}

/// A glTF file that is being read.
pub(super) struct File<'a> {
    /// The root object.
    pub root: Value<'a>,
    /// The name for messages.
    pub name: Arc<str>,
    /// The folder of files that it names.
    pub folder: &'a Path,
    /// The budget.
    pub budget: &'a Budget,
    diagnostics: RefCell<Diagnostics>,
    lists: [Vec<Value<'a>>; List::ALL.len()],
    buffers: Vec<Option<Cow<'a, [u8]>>>,
    /// The bytes of decompressed buffer views.
    unpacked: Vec<Option<Vec<u8>>>,
    /// The elements of accessors whose primitives were compressed.
    filled: HashMap<usize, Vec<u8>>,
    /// The total size of all buffers.
    buffer_bytes: u64,
    /// Whether a buffer was not loaded because of its URI; true for one on a network.
    is_elsewhere: Cell<Option<bool>>,
    /// The extensions that the file declares to use.
    used: HashSet<String>,
    /// The violations that a warning was given of: parts are read several times.
    said: RefCell<HashSet<(Option<Place>, String)>>,
}

/// The bytes of a buffer view.
#[derive(Clone, Copy)]
pub(super) struct View<'a> {
    /// The bytes; `None` where the buffer has none, because an extension provides them.
    pub bytes: Option<&'a [u8]>,
    /// The number of bytes.
    pub length: u64,
    /// The stride, if specified.
    pub stride: Option<usize>,
    /// The offset in the buffer.
    pub offset: u64,
}

impl<'a> File<'a> {
    /// A file that is not loaded yet: see [`super::load()`].
    pub(super) fn new(
        root: Value<'a>,
        name: &Arc<str>,
        folder: &'a Path,
        budget: &'a Budget,
        diagnostics: Diagnostics,
    ) -> Self {
        Self {
            root,
            name: name.clone(),
            folder,
            budget,
            diagnostics: RefCell::new(diagnostics),
            lists: Default::default(),
            buffers: vec![],
            unpacked: vec![],
            filled: HashMap::new(),
            buffer_bytes: 0,
            is_elsewhere: Cell::new(None),
            used: HashSet::new(),
            said: RefCell::default(),
        }
    }

    /// The collected diagnostics.
    pub(super) fn into_diagnostics(self) -> Diagnostics {
        self.diagnostics.into_inner()
    }

    fn find_lists(&mut self) -> Read<()> {
        if let Some(list) = self.root.get("extensionsUsed")? {
            for name in list.array()? {
                self.used.insert(name.string()?.into_owned());
            }
        }
        for list in List::ALL {
            let (extension, key, _) = list.names();
            let holder = match extension {
                None => Some(self.root),
                Some(extension) => self.root.extension(extension)?,
            };
            let Some(holder) = holder else { continue };
            let array = match (holder.get(key)?, extension) {
                (Some(array), _) => array,
                (None, None) => continue,
                (None, Some(_)) => holder.need(key)?,
            };
            let mut values = BudgetVec::new(self.budget, "lists of a glTF");
            for value in array.array()? {
                values.push(value.object()?)?;
            }
            self.lists[list as usize] = values.into_vec();
            if self.list(list).is_empty() {
                self.breach(array.wrong("empty list").expected("one element or more, or no list"))?;
            }
        }
        Ok(())
    }

    /// The values of a list.
    pub(super) fn list(&self, list: List) -> &[Value<'a>] {
        &self.lists[list as usize]
    }

    /// The element of a list that `value` indexes, with the index.
    pub(super) fn at(&self, list: List, value: Value<'_>) -> Read<(usize, Value<'a>)> {
        let index = value.index(self.list(list).len(), list.names().2)?;
        Ok((index, self.list(list)[index]))
    }

    /// The element of a list that a member of `value` indexes, if it has that member.
    pub(super) fn named(
        &self,
        list: List,
        value: Value<'_>,
        member: &str,
    ) -> Read<Option<(usize, Value<'a>)>> {
        value.get(member)?.map(|index| self.at(list, index)).transpose()
    }

    /// Whether the file declares that it uses an extension.
    pub(super) fn uses(&self, extension: &str) -> bool {
        self.used.contains(extension)
    }

    /// Whether unusable parts are dropped with a warning.
    pub(super) fn is_lenient(&self) -> bool {
        self.diagnostics.borrow().is_lenient()
    }

    /// Adds a warning of this kind.
    pub(super) fn warn(&self, value: Value<'_>, message: &str) {
        value.warn(&mut self.diagnostics.borrow_mut(), message);
    }

    /// Adds a warning.
    pub(super) fn push(&self, warning: Diagnostic) {
        self.diagnostics.borrow_mut().push(warning);
    }

    /// The collector, for readers of other formats.
    pub(super) fn with_diagnostics<T>(&self, f: impl FnOnce(&mut Diagnostics) -> T) -> T {
        f(&mut self.diagnostics.borrow_mut())
    }

    /// A violation of glTF whose meaning is still clear, which other programs show: a warning, once for each
    /// place, or an error when strict.
    pub(super) fn breach(&self, wrong: Diagnostic) -> Read<()> {
        /// At most this many are distinguished; the collector keeps fewer.
        const MOST: usize = 1 << 12;
        if self.diagnostics.borrow().strictness() == Strictness::Strict {
            return Err(wrong.into());
        }
        let mut said = self.said.borrow_mut();
        if said.len() < MOST && !said.insert((wrong.place.clone(), wrong.message.clone())) {
            return Ok(());
        }
        self.push(Diagnostic { severity: Severity::Warning, ..wrong });
        Ok(())
    }

    /// What is wrong with a part that may be unused: a warning. Where it is needed after all, reading it again
    /// is an error.
    pub(super) fn unless_used(&self, read: Read<()>) -> Read<()> {
        match read {
            Err(FormatError::Input(wrong)) => self.breach(*wrong),
            other => other,
        }
    }

    /// Finds the lists and loads every buffer. `binary` is the GLB's own buffer.
    pub(super) fn load_buffers(&mut self, binary: Option<&'a [u8]>, is_glb: bool) -> Read<()> {
        self.find_lists()?;
        for (index, &value) in self.lists[List::Buffers as usize].iter().enumerate() {
            let bytes = self.buffer(index, value, binary, is_glb)?;
            self.buffer_bytes += bytes.as_ref().map_or(0, |bytes| bytes.len() as u64);
            self.buffers.push(bytes);
        }
        Ok(())
    }

    /// Adds the bytes of the next buffer view if it was compressed; `None` if not.
    pub(super) fn add_unpacked(&mut self, bytes: Option<Vec<u8>>) {
        self.buffer_bytes += bytes.as_ref().map_or(0, |bytes| bytes.len() as u64);
        self.unpacked.push(bytes);
    }

    /// Sets the elements of the accessors whose primitives were compressed.
    #[cfg(feature = "draco")]
    pub(super) fn set_filled(&mut self, filled: HashMap<usize, Vec<u8>>) {
        self.buffer_bytes += filled.values().map(|bytes| bytes.len() as u64).sum::<u64>();
        self.filled = filled;
    }

    fn buffer(
        &self,
        index: usize,
        value: Value<'a>,
        binary: Option<&'a [u8]>,
        is_glb: bool,
    ) -> Read<Option<Cow<'a, [u8]>>> {
        let length = value.need("byteLength")?;
        let length_value = length;
        let length = length.whole(0)?;
        if length == 0 {
            self.breach(length_value.wrong("buffer without bytes"))?;
        }
        let bytes: Cow<'a, [u8]> = match value.get("uri")? {
            None if index == 0 && binary.is_some() => Cow::Borrowed(binary.unwrap_or_default()),
            None => {
                // Filled by another program, or a fallback for one that an extension decompresses.
                if index == 0 && is_glb && value.get("extensions")?.is_none() {
                    let wrong = value.wrong("buffer without data").expected("a binary chunk in the GLB file");
                    return Err(wrong.into());
                }
                return Ok(None);
            }
            Some(uri) => {
                let text = uri.string()?;
                if let Target::Scheme(scheme) = target(&text) {
                    let warning = Diagnostic::warning(elsewhere("buffer", scheme)).at(uri.place());
                    self.push(warning.found(quoted(&text)).expected("the name of a file, or data"));
                    self.is_elsewhere.set(Some(is_network(scheme)));
                    return Ok(None);
                }
                Cow::Owned(self.data(uri, &["application/octet-stream", "application/gltf-buffer"])?.1)
            }
        };
        let found = bytes.len() as u64;
        if found < length {
            let wrong = length_value.wrong("buffer longer than its data").found(length);
            return Err(wrong.expected(format!("{found} or less")).into());
        }
        if matches!(bytes, Cow::Borrowed(_)) && found > length + 3 {
            let warning = Diagnostic::warning("binary chunk longer than its buffer").at(length_value.place());
            self.push(warning.found(format!("{found} bytes")).expected(length));
        }
        let bytes = match bytes {
            Cow::Borrowed(bytes) => Cow::Borrowed(&bytes[..length as usize]),
            Cow::Owned(mut bytes) => {
                bytes.truncate(length as usize);
                Cow::Owned(bytes)
            }
        };
        Ok(Some(bytes))
    }

    /// The bytes behind a URI, with a name for messages. Data URIs must have one of the media types, if any are
    /// given.
    pub(super) fn data(&self, uri: Value<'_>, media_types: &[&str]) -> Read<(Arc<str>, Vec<u8>)> {
        let text = uri.string()?;
        match target(&text) {
            Target::Data(DataUri { media_type, is_base64, data }) => {
                if !media_types.is_empty() && !media_types.contains(&media_type) {
                    let wrong = uri.wrong("wrong media type of data").found(quoted(media_type));
                    self.breach(wrong.expected(media_types.join(" or ")))?;
                }
                let name: Arc<str> = uri.place().to_string().into();
                self.budget.bytes(data.len() as u64, "data URI")?;
                if !is_base64 {
                    return Ok((name, percent_decoded_bytes(data)));
                }
                let data = if data.contains('%') {
                    Cow::Owned(super::uri::percent_decoded(data))
                } else {
                    Cow::Borrowed(data)
                };
                let decoded = base64_decoded(&data).map_err(|at| {
                    let found = data.get(at..).and_then(|rest| rest.chars().next());
                    let found = found.map_or_else(
                        || format!("{} characters", data.len()),
                        |c| format!("{} as character {}", quoted(&c.to_string()), at + 1),
                    );
                    FormatError::from(uri.wrong("wrong base64 data").found(found))
                })?;
                Ok((name, decoded))
            }
            Target::File(path) => {
                if path.as_os_str().is_empty() {
                    return Err(uri.unexpected("wrong URI", "the name of a file or data"));
                }
                let path = self.folder.join(path);
                let input = Input::open(&path, self.budget).map_err(|error| match error {
                    FormatError::Io { source, action, .. } => {
                        uri.wrong(format!("{}: {action}: {source}", path.display())).into()
                    }
                    other => other,
                })?;
                Ok((input.name().clone(), input.into_bytes()))
            }
            Target::Malformed => Err(uri.unexpected("wrong data URI", "data:MEDIA/TYPE;base64,DATA")),
            Target::Scheme(scheme) => {
                let wrong = uri.wrong(elsewhere("file", scheme)).found(quoted(&text));
                Err(wrong.expected("the name of a file, or data").into())
            }
        }
    }

    /// The total size of all buffers.
    pub(super) fn buffer_bytes(&self) -> u64 {
        self.buffer_bytes
    }

    /// The bytes of a buffer slice described like a buffer view, its offset and its length.
    pub(super) fn buffer_slice(&self, value: Value<'_>) -> Read<(Option<&[u8]>, u64, u64)> {
        let (index, buffer) = self.at(List::Buffers, value.need("buffer")?)?;
        let offset_value = value.get("byteOffset")?;
        let offset = offset_value.map_or(Ok(0), |v| v.whole(0))?;
        let length_value = value.need("byteLength")?;
        let length = length_value.whole(0)?;
        if length == 0 {
            self.breach(length_value.wrong("buffer view without bytes"))?;
        }
        let size = buffer.need("byteLength")?.whole(0)?;
        let fits = offset.checked_add(length).is_some_and(|end| end <= size);
        if !fits {
            let culprit = if offset < size { length_value } else { offset_value.unwrap_or(length_value) };
            let wrong = culprit.wrong("buffer view past the end of its buffer");
            let found = format!("{length} bytes from byte {offset}");
            return Err(wrong.found(found).expected(format!("at most {size} bytes in all")).into());
        }
        // A loaded buffer has its declared length.
        let bytes = self.buffers.get(index).and_then(Option::as_ref);
        Ok((bytes.and_then(|bytes| bytes.get(offset as usize..(offset + length) as usize)), offset, length))
    }

    /// The buffer view that `value` indexes.
    pub(super) fn view(&self, value: Value<'_>) -> Read<(usize, View<'_>)> {
        let (index, view) = self.at(List::BufferViews, value)?;
        Ok((index, self.view_at(index, view)?))
    }

    /// The elements of an accessor whose primitive was compressed, tightly packed.
    pub(super) fn filled(&self, accessor: usize) -> Option<&[u8]> {
        self.filled.get(&accessor).map(Vec::as_slice)
    }

    /// A buffer view.
    pub(super) fn view_at(&self, index: usize, value: Value<'_>) -> Read<View<'_>> {
        let stride = match value.get("byteStride")? {
            None => None,
            Some(value) => {
                let stride = value.whole(0)?;
                if !(4..=252).contains(&stride) || !stride.is_multiple_of(4) {
                    return Err(value.unexpected("wrong stride", "a multiple of 4 from 4 to 252"));
                }
                Some(stride as usize)
            }
        };
        if let Some(target) = value.get("target")? {
            match target.whole(0)? {
                34962 => {}
                34963 => {
                    if stride.is_some() {
                        self.breach(value.wrong("buffer view of indices with a stride"))?;
                    }
                }
                _ => {
                    let warning = Diagnostic::warning("unknown target of a buffer view").at(target.place());
                    self.push(warning.expected("34962 or 34963"));
                }
            }
        }
        if let Some(Some(bytes)) = self.unpacked.get(index) {
            return Ok(View { bytes: Some(bytes), length: bytes.len() as u64, stride, offset: 0 });
        }
        let (bytes, offset, length) = self.buffer_slice(value)?;
        if let (Some(stride), Some(value)) = (stride, value.get("byteStride")?)
            && stride as u64 > length
        {
            let wrong = value.wrong("stride longer than the buffer view").found(stride);
            self.breach(wrong.expected(format!("at most {length}")))?;
        }
        Ok(View { bytes, length, stride, offset })
    }

    /// An error: a buffer is needed that has no data.
    pub(super) fn without_data(&self, value: Value<'_>) -> FormatError {
        let message = match self.is_elsewhere.get() {
            Some(true) => "the data of what is needed here are on a network, from which nothing is fetched",
            Some(false) | None => "the buffer of what is needed here has no data",
        };
        value.wrong(message).into()
    }

    /// A place for messages about the whole file.
    pub(super) fn whole(&self) -> Place {
        Place::whole(self.name.clone())
    }
}

/// Whether a scheme is that of a server.
fn is_network(scheme: &str) -> bool {
    ["http", "https", "ftp"].iter().any(|known| scheme.eq_ignore_ascii_case(known))
}

/// Why something behind a URI is not loaded.
fn elsewhere(what: &str, scheme: &str) -> String {
    if is_network(scheme) {
        format!("{what} on a network: nothing is fetched from there")
    } else {
        format!("{what} behind a URI of a scheme that is not supported")
    }
}
