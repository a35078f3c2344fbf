//! Accessors: numbers from buffers of any type, stride and sparsity.

use rayon::prelude::*;

use super::file::{File, List, View};
use super::json::{Read, Value};
use crate::diagnostic::{Diagnostic, FormatError, quoted};

/// The number of elements from which decoding is worth splitting over threads.
pub(super) const SHARE: usize = 1 << 15;

/// What a budget is asked for.
const ELEMENTS: &str = "elements of accessors";

/// The component types.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Component {
    I8,
    U8,
    I16,
    U16,
    U32,
    F32,
}

impl Component {
    pub(super) fn read(value: Value<'_>) -> Read<Self> {
        Ok(match value.whole(0)? {
            5120 => Self::I8,
            5121 => Self::U8,
            5122 => Self::I16,
            5123 => Self::U16,
            5125 => Self::U32,
            5126 => Self::F32,
            _ => {
                return Err(
                    value.unexpected("unknown type of number", "5120, 5121, 5122, 5123, 5125 or 5126")
                );
            }
        })
    }

    pub(super) fn bytes(self) -> usize {
        match self {
            Self::I8 | Self::U8 => 1,
            Self::I16 | Self::U16 => 2,
            Self::U32 | Self::F32 => 4,
        }
    }

    pub(super) fn name(self) -> &'static str {
        match self {
            Self::I8 => "signed bytes",
            Self::U8 => "unsigned bytes",
            Self::I16 => "signed shorts",
            Self::U16 => "unsigned shorts",
            Self::U32 => "unsigned integers",
            Self::F32 => "floats",
        }
    }
}

/// The element types.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Element {
    Scalar,
    Vec2,
    Vec3,
    Vec4,
    Mat2,
    Mat3,
    Mat4,
}

impl Element {
    const NAMES: [(&'static str, Self); 7] = [
        ("SCALAR", Self::Scalar),
        ("VEC2", Self::Vec2),
        ("VEC3", Self::Vec3),
        ("VEC4", Self::Vec4),
        ("MAT2", Self::Mat2),
        ("MAT3", Self::Mat3),
        ("MAT4", Self::Mat4),
    ];

    pub(super) fn read(value: Value<'_>) -> Read<Self> {
        let text = value.string()?;
        let known = Self::NAMES.iter().find(|(name, _)| *name == text).map(|&(_, element)| element);
        known.ok_or_else(|| {
            let wrong = value.wrong("unknown type of element").found(quoted(&text));
            wrong.suggest(&text, Self::NAMES.iter().map(|(name, _)| *name)).into()
        })
    }

    pub(super) fn name(self) -> &'static str {
        Self::NAMES[self as usize].0
    }

    /// The number of columns, and of numbers in each.
    fn columns(self) -> (usize, usize) {
        match self {
            Self::Scalar => (1, 1),
            Self::Vec2 => (1, 2),
            Self::Vec3 => (1, 3),
            Self::Vec4 => (1, 4),
            Self::Mat2 => (2, 2),
            Self::Mat3 => (3, 3),
            Self::Mat4 => (4, 4),
        }
    }

    /// The number of components.
    pub(super) fn numbers(self) -> usize {
        let (columns, rows) = self.columns();
        columns * rows
    }
}

/// An accessor whose bytes are known to exist.
#[derive(Clone, Copy)]
pub(super) struct Accessor<'a> {
    /// The accessor itself, for messages.
    pub value: Value<'a>,
    /// Its index in the file's list.
    pub index: usize,
    /// The type of its numbers.
    pub component: Component,
    /// The numbers of one element.
    pub element: Element,
    /// Whether integers represent fractions of 1.
    pub normalized: bool,
    /// How many elements it has, at least 1.
    pub count: usize,
    /// The elements; `None` where all are zero.
    data: Option<Strided<'a>>,
    sparse: Option<Sparse<'a>>,
    /// Whether it has minimum and maximum.
    pub has_bounds: bool,
    /// Its buffer view, and whether that has a stride.
    pub view: Option<(usize, bool)>,
    /// The offset of the elements in the buffer, for alignment.
    pub start: u64,
    /// The stride in bytes.
    pub stride: usize,
}

#[derive(Clone, Copy)]
struct Strided<'a> {
    /// `None` where the buffer has none.
    bytes: Option<&'a [u8]>,
    stride: usize,
}

#[derive(Clone, Copy)]
struct Sparse<'a> {
    value: Value<'a>,
    count: usize,
    component: Component,
    indices: Option<&'a [u8]>,
    values: Option<&'a [u8]>,
}

/// A range of `count` elements of `size` bytes at a stride of `stride` from `offset`, checked against the view.
fn strided<'a>(
    culprit: Value<'_>,
    view: &View<'a>,
    offset: u64,
    count: u64,
    stride: usize,
    size: usize,
) -> Read<Option<&'a [u8]>> {
    let end =
        (count - 1).checked_mul(stride as u64).and_then(|n| n.checked_add(size as u64)?.checked_add(offset));
    let found = view.length;
    match end {
        Some(end) if end <= found => {
            Ok(view.bytes.and_then(|bytes| bytes.get(offset as usize..end as usize)))
        }
        _ => {
            let wrong = culprit.wrong("accessor past the end of its buffer view");
            let needs = end.map_or("more bytes than can be".to_owned(), |end| format!("{end} bytes"));
            Err(wrong
                .found(format!("{count} elements, which need {needs}"))
                .expected(format!("{found} bytes at most"))
                .into())
        }
    }
}

/// An error that [`Accessor::needs_data`] forestalls.
fn without_data(value: Value<'_>) -> FormatError {
    value.wrong("the buffer of what is needed here has no data").into()
}

/// Whether an accessor is of a known kind; unknown ones may stay unused.
pub(super) fn is_known(value: Value<'_>) -> Read<bool> {
    let component = value.need("componentType")?;
    let element = value.need("type")?;
    component.whole(0)?;
    element.string()?;
    Ok(Component::read(component).is_ok() && Element::read(element).is_ok())
}

impl<'a> Accessor<'a> {
    /// The accessor that `value` names.
    pub(super) fn named(file: &'a File<'_>, value: Value<'_>) -> Read<Self> {
        let index = value.index(file.list(List::Accessors).len(), "an accessor")?;
        Self::at(file, index)
    }

    /// The accessor at an index.
    pub(super) fn at(file: &'a File<'_>, index: usize) -> Read<Self> {
        let value = file.list(List::Accessors)[index];
        let component = Component::read(value.need("componentType")?)?;
        let element = Element::read(value.need("type")?)?;
        let count_value = value.need("count")?;
        let count = count_value.whole(1)?;
        let normalized = value.bool_or("normalized", false)?;
        if normalized && matches!(component, Component::F32 | Component::U32) {
            let culprit = value.need("normalized")?;
            file.breach(culprit.wrong("normalized numbers of a wrong type").found(component.name()))?;
        }
        for bound in ["min", "max"] {
            if let Some(bound) = value.get(bound)?
                && bound.array()?.count() != element.numbers()
            {
                file.breach(bound.wrong("bound of a wrong length").expected(element.numbers()))?;
            }
        }
        let has_bounds = value.get("min")?.is_some() && value.get("max")?.is_some();
        let offset_value = value.get("byteOffset")?;
        let offset = offset_value.map_or(Ok(0), |v| v.whole(0))?;
        let (columns, rows) = element.columns();
        let column = if columns > 1 {
            (rows * component.bytes()).next_multiple_of(4)
        } else {
            rows * component.bytes()
        };
        // The last column is not padded.
        let size = columns * column;
        let least = size - column + rows * component.bytes();

        let mut at = Self {
            value,
            index,
            component,
            element,
            normalized,
            count: 0,
            data: None,
            sparse: None,
            has_bounds,
            view: None,
            start: offset,
            stride: size,
        };
        if let Some(bytes) = file.filled(index) {
            at.data = Some(Strided { bytes: Some(bytes), stride: size });
            at.start = 0;
            let here = View { bytes: Some(bytes), length: bytes.len() as u64, stride: None, offset: 0 };
            strided(count_value, &here, 0, count, size, least)?;
        } else if let Some(name) = value.get("bufferView")? {
            let (index, view) = file.view(name)?;
            let stride = view.stride.unwrap_or(size);
            if stride < least {
                let wrong = value.wrong("stride shorter than an element").found(stride);
                return Err(wrong.expected(format!("{least} or more")).into());
            }
            let bytes = strided(count_value, &view, offset, count, stride, least)?;
            at.data = Some(Strided { bytes, stride });
            at.view = Some((index, view.stride.is_some()));
            at.start = offset + view.offset;
            at.stride = stride;
            let step = if columns > 1 { 4 } else { component.bytes() as u64 };
            for (start, culprit) in [(offset, offset_value.unwrap_or(value)), (at.start, value)] {
                if !start.is_multiple_of(step) {
                    let wrong =
                        culprit.wrong("accessor out of step with its numbers").found(format!("byte {start}"));
                    file.breach(wrong.expected(format!("a multiple of {step}")))?;
                    break;
                }
            }
        } else {
            if let Some(culprit) = offset_value {
                file.breach(culprit.wrong("byteOffset without a buffer view"))?;
            }
            // All zeros, except for sparse values, so the file's size does not bound the count.
            let most = 65_536_u64.saturating_add(file.buffer_bytes());
            if count > most {
                let wrong = count_value.wrong("accessor without data has too many elements").found(count);
                return Err(wrong.expected(format!("{most} or less, for the buffers there are")).into());
            }
        }
        at.count = count as usize;
        if let Some(sparse) = value.get("sparse")? {
            at.sparse = Some(Sparse::read(file, sparse, count, size)?);
        }
        file.budget.elements(0, "accessors")?;
        Ok(at)
    }

    /// Its type, in words.
    pub(super) fn said(&self) -> String {
        format!("{} of {}", self.element.name(), self.component.name())
    }

    /// Checks that its element and component types are among these.
    pub(super) fn expect(
        &self,
        culprit: Value<'_>,
        elements: &[Element],
        components: &[Component],
    ) -> Read<()> {
        if elements.contains(&self.element) && components.contains(&self.component) {
            return Ok(());
        }
        let elements: Vec<&str> = elements.iter().map(|e| e.name()).collect();
        let components: Vec<&str> = components.iter().map(|c| c.name()).collect();
        let wrong = culprit.wrong("accessor of a wrong type").found(self.said());
        Err(wrong.expected(format!("{} of {}", elements.join(" or "), components.join(" or "))).into())
    }

    /// The first `N` numbers of every element, which has at least N.
    pub(super) fn floats<const N: usize>(&self, file: &File<'_>) -> Read<Vec<[f32; N]>> {
        let mut elements = self.zeros(file)?;
        self.read_floats(N, elements.as_flattened_mut())?;
        Ok(elements)
    }

    /// The first `N` numbers of every element, as a vector of the same size, so that no other memory is needed.
    pub(super) fn vectors<const N: usize, T>(
        &self,
        file: &File<'_>,
        make: impl Fn([f32; N]) -> T,
    ) -> Read<Vec<T>> {
        const { assert!(size_of::<T>() == size_of::<[f32; N]>()) }
        Ok(self.floats(file)?.into_iter().map(make).collect())
    }

    /// The first `n` numbers of every element, one element after another.
    pub(super) fn flat_floats(&self, file: &File<'_>, n: usize) -> Read<Vec<f32>> {
        self.needs_data(file)?;
        file.budget.elements(self.count as u64, ELEMENTS)?;
        let count = self.count.saturating_mul(n);
        let mut numbers = file.budget.vec(count as u64, ELEMENTS)?;
        numbers.resize(count, 0.0);
        self.read_floats(n, &mut numbers)?;
        Ok(numbers)
    }

    fn read_floats(&self, n: usize, out: &mut [f32]) -> Read<()> {
        match (self.component, self.normalized) {
            (Component::F32, _) => self.decode(n, out, f32::from_le_bytes),
            (Component::I8, false) => self.decode(n, out, |[b]| f32::from(b as i8)),
            (Component::I8, true) => self.decode(n, out, |[b]| (f32::from(b as i8) / 127.0).max(-1.0)),
            (Component::U8, false) => self.decode(n, out, |[b]| f32::from(b)),
            (Component::U8, true) => self.decode(n, out, |[b]| f32::from(b) / 255.0),
            (Component::I16, false) => self.decode(n, out, |b| f32::from(i16::from_le_bytes(b))),
            (Component::I16, true) => {
                self.decode(n, out, |b| (f32::from(i16::from_le_bytes(b)) / 32767.0).max(-1.0))
            }
            (Component::U16, false) => self.decode(n, out, |b| f32::from(u16::from_le_bytes(b))),
            (Component::U16, true) => self.decode(n, out, |b| f32::from(u16::from_le_bytes(b)) / 65535.0),
            (Component::U32, _) => self.decode(n, out, |b| u32::from_le_bytes(b) as f32),
        }
    }

    /// The first `N` numbers of every element as integers. The caller has checked the component type.
    pub(super) fn wholes<const N: usize>(&self, file: &File<'_>) -> Read<Vec<[u32; N]>> {
        let mut elements = self.zeros(file)?;
        let out = elements.as_flattened_mut();
        match self.component {
            Component::U8 => self.decode(N, out, |[b]| u32::from(b))?,
            Component::U16 => self.decode(N, out, |b| u32::from(u16::from_le_bytes(b)))?,
            Component::U32 => self.decode(N, out, u32::from_le_bytes)?,
            Component::I8 | Component::I16 | Component::F32 => {
                let wrong = self.value.wrong("accessor of a wrong type").found(self.said());
                return Err(wrong.expected("unsigned numbers").into());
            }
        }
        Ok(elements)
    }

    /// Checks that its buffers have data.
    fn needs_data(&self, file: &File<'_>) -> Read<()> {
        let is_absent = self.data.is_some_and(|data| data.bytes.is_none());
        let is_sparsely = |sparse: Sparse<'_>| sparse.indices.is_none() || sparse.values.is_none();
        if is_absent || self.sparse.is_some_and(is_sparsely) {
            return Err(file.without_data(self.value));
        }
        Ok(())
    }

    /// All its elements, charged to the budget.
    fn zeros<T: Copy + Default, const N: usize>(&self, file: &File<'_>) -> Read<Vec<[T; N]>> {
        debug_assert!(N <= self.element.numbers());
        self.needs_data(file)?;
        file.budget.elements(self.count as u64, ELEMENTS)?;
        let mut elements = file.budget.vec(self.count as u64, ELEMENTS)?;
        elements.resize(self.count, [T::default(); N]);
        Ok(elements)
    }

    /// Its declared minimum and maximum; `None` where it has none, or of another size.
    pub(super) fn bounds<const N: usize>(&self) -> Read<Option<[[f64; N]; 2]>> {
        let [Some(low), Some(high)] = [self.value.get("min")?, self.value.get("max")?] else {
            return Ok(None);
        };
        if low.array()?.count() != N || high.array()?.count() != N {
            return Ok(None);
        }
        let unit = match (self.component, self.normalized) {
            (Component::I8, true) => 127.0,
            (Component::U8, true) => 255.0,
            (Component::I16, true) => 32767.0,
            (Component::U16, true) => 65535.0,
            _ => 1.0,
        };
        Ok(Some([low.numbers::<N>()?.map(|x| x / unit), high.numbers::<N>()?.map(|x| x / unit)]))
    }

    /// The numbers in groups of three, without an incomplete one; `None` where they are not contiguous.
    pub(super) fn by_threes(&self) -> Option<Self> {
        let size = self.component.bytes();
        let count = self.count / 3;
        let Some(Strided { bytes: Some(bytes), stride }) = self.data else { return None };
        if self.element != Element::Scalar || stride != size || self.sparse.is_some() || count == 0 {
            return None;
        }
        let bytes = bytes.get(..3 * size * count)?;
        let data = Some(Strided { bytes: Some(bytes), stride: 3 * size });
        Some(Self { element: Element::Vec3, count, data, stride: 3 * size, ..*self })
    }

    /// Reads `n` numbers of `S` bytes of every element into `out`, which is zero.
    fn decode<const S: usize, T: Copy + Default + Send>(
        &self,
        n: usize,
        out: &mut [T],
        decode: impl Fn([u8; S]) -> T + Sync,
    ) -> Read<()> {
        debug_assert_eq!(S, self.component.bytes());
        let (columns, rows) = self.element.columns();
        let column = if columns > 1 { (rows * S).next_multiple_of(4) } else { rows * S };
        let in_a_row = |out: &mut [T], bytes: &[u8]| {
            let (numbers, _) = bytes.as_chunks::<S>();
            out.iter_mut().zip(numbers).for_each(|(out, number)| *out = decode(*number));
        };
        let element = |out: &mut [T], bytes: &[u8]| match columns {
            1 => in_a_row(out, bytes),
            _ => {
                for (i, out) in out.iter_mut().enumerate() {
                    let at = i / rows * column + i % rows * S;
                    if let Some(number) = bytes.get(at..).and_then(<[u8]>::first_chunk) {
                        *out = decode(*number);
                    }
                }
            }
        };
        if let Some(Strided { bytes, stride }) = self.data {
            let bytes = bytes.ok_or_else(|| without_data(self.value))?;
            in_shares(n, out, stride, bytes, &|out, bytes| match columns {
                1 if stride == n * S => in_a_row(out, bytes),
                _ => out.chunks_mut(n).zip(bytes.chunks(stride)).for_each(|(out, bytes)| element(out, bytes)),
            });
        }
        if let Some(sparse) = &self.sparse {
            let value_size = columns * column;
            let values = sparse.values.ok_or_else(|| without_data(sparse.value))?;
            sparse.each_index(self.count, |k, index| {
                let out = &mut out[n * index..][..n];
                out.fill(T::default());
                element(out, &values[k * value_size..]);
            })?;
        }
        Ok(())
    }
}

/// Splits elements of `n` numbers, and their bytes, over threads. Compiled once for each type of number, and called
/// once for many elements.
fn in_shares<T: Send>(
    n: usize,
    out: &mut [T],
    stride: usize,
    bytes: &[u8],
    read: &(dyn Fn(&mut [T], &[u8]) + Sync),
) {
    out.par_chunks_mut(n * SHARE)
        .zip(bytes.par_chunks(stride.saturating_mul(SHARE)))
        .for_each(|(out, bytes)| read(out, bytes));
}

impl<'a> Sparse<'a> {
    fn read(file: &'a File<'_>, value: Value<'a>, of: u64, size: usize) -> Read<Self> {
        let count_value = value.need("count")?;
        let count = count_value.whole(1)?;
        if count > of {
            let expected = format!("at most {of}, the elements of the accessor");
            return Err(count_value.unexpected("too many sparse elements", &expected));
        }
        let part = |name: &str, size: Option<usize>| -> Read<(Option<&'a [u8]>, Component)> {
            let part = value.need(name)?;
            let component = match size {
                Some(_) => Component::F32,
                None => Component::read(part.need("componentType")?)?,
            };
            if !matches!(component, Component::U8 | Component::U16 | Component::U32) && size.is_none() {
                let expected = "5121, 5123 or 5125";
                return Err(part.need("componentType")?.unexpected("wrong type of sparse indices", expected));
            }
            let size = size.unwrap_or(component.bytes());
            let (_, view) = file.view(part.need("bufferView")?)?;
            if view.stride.is_some() {
                file.breach(part.wrong("sparse data in a buffer view with a stride"))?;
            }
            let offset = part.get("byteOffset")?.map_or(Ok(0), |v| v.whole(0))?;
            Ok((strided(part, &view, offset, count, size, size)?, component))
        };
        let (indices, component) = part("indices", None)?;
        let (values, _) = part("values", Some(size))?;
        Ok(Self { value, count: count as usize, component, indices, values })
    }

    /// Calls `f` with each index below `count` and its position in the list.
    fn each_index(&self, count: usize, mut f: impl FnMut(usize, usize)) -> Read<()> {
        let size = self.component.bytes();
        let mut before = None;
        let indices = self.indices.ok_or_else(|| without_data(self.value))?;
        for (k, b) in indices.chunks_exact(size).take(self.count).enumerate() {
            let index = match self.component {
                Component::U8 => usize::from(b[0]),
                Component::U16 => usize::from(u16::from_le_bytes([b[0], b[1]])),
                _ => u32::from_le_bytes([b[0], b[1], b[2], b[3]]) as usize,
            };
            let wrong = |message: &str, expected: String| -> Diagnostic {
                self.value.wrong(message).found(format!("{index} as element {k}")).expected(expected)
            };
            if index >= count {
                return Err(wrong("sparse index out of range", format!("0 to {}", count - 1)).into());
            }
            if let Some(before) = before.filter(|&before| index <= before) {
                return Err(wrong("sparse indices out of order", format!("more than {before}")).into());
            }
            before = Some(index);
            f(k, index);
        }
        Ok(())
    }
}
