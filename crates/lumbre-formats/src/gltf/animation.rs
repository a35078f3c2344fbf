//! Animations: node transforms at a time, and other animated values.

use std::collections::{BTreeMap, HashMap, HashSet};

use lumbre_math::{DQuat, DVec3, Elementary};

use super::accessor::{Accessor, Component, Element};
use super::file::{File, List};
use super::json::{Read, Value};
use super::options::GltfOptions;
use super::pointer::{self, Changes};
use crate::diagnostic::{Diagnostic, quoted};

/// The effect of animations at a time on nodes, and on meshes whose nodes have no weights.
#[derive(Clone, Debug, Default)]
pub(super) struct Played {
    pub nodes: HashMap<usize, Moved>,
    pub meshes: HashMap<usize, Weights>,
}

/// The effect of animations on a node at a time.
#[derive(Clone, Debug, Default, PartialEq)]
pub(super) struct Moved {
    pub translation: Option<DVec3>,
    pub rotation: Option<DQuat>,
    pub scale: Option<DVec3>,
    pub weights: Weights,
}

/// The effect of animations on the weights of morph targets at a time.
#[derive(Clone, Debug, Default, PartialEq)]
pub(super) struct Weights {
    /// All weights.
    pub all: Option<Vec<f64>>,
    /// Single weights.
    pub single: BTreeMap<usize, f64>,
}

impl Weights {
    /// Sets a value named by [`Path::Weights`] or [`Path::Weight`]; false if it is already set.
    fn set(&mut self, path: Path, value: Vec<f64>) -> bool {
        let is_free = self.all.is_none()
            && match path {
                Path::Weight(target) => !self.single.contains_key(&target),
                _ => self.single.is_empty(),
            };
        match path {
            _ if !is_free => {}
            Path::Weight(target) => drop(self.single.insert(target, value[0])),
            _ => self.all = Some(value),
        }
        is_free
    }

    /// The animated weights, where `still` are those without animation.
    pub(super) fn over(&self, still: Option<Vec<f64>>) -> Option<Vec<f64>> {
        let weights = self.all.clone().or(still);
        let Some((&last, _)) = self.single.last_key_value() else { return weights };
        let mut weights = weights.unwrap_or_default();
        weights.resize(weights.len().max(last + 1), 0.0);
        self.single.iter().for_each(|(&target, &weight)| weights[target] = weight);
        Some(weights)
    }
}

impl Moved {
    /// Whether it moves the node itself, not only its morph targets.
    pub(super) fn places(&self) -> bool {
        self.translation.is_some() || self.rotation.is_some() || self.scale.is_some()
    }
}

#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
enum Path {
    Translation,
    Rotation,
    Scale,
    /// All weights of morph targets.
    Weights,
    /// One weight.
    Weight(usize),
    /// Other values: their number, and whether they are written as a list even if there is one.
    Numbers {
        width: usize,
        is_list: bool,
    },
}

/// The target of a channel.
#[derive(Clone, Debug, PartialEq, Eq, Hash)]
enum Target {
    Node(usize),
    /// The default weights of a mesh.
    Mesh(usize),
    /// A value that only exists in the JSON.
    Pointer(String),
}

#[derive(Clone, Copy, Debug, PartialEq)]
enum Interpolation {
    Step,
    Linear,
    CubicSpline,
}

/// A channel with its sampler.
struct Channel<'a> {
    value: Value<'a>,
    target: Target,
    path: Path,
    interpolation: Interpolation,
    input: Accessor<'a>,
    output: Accessor<'a>,
    /// Elements of the output per value.
    width: usize,
}

/// The animations that play simultaneously.
pub(super) struct Playing<'a> {
    file: &'a File<'a>,
    channels: Vec<Channel<'a>>,
}

impl<'a> Playing<'a> {
    /// Checks all animations, and selects those that play: the requested one, or else every one that does not
    /// conflict with an earlier one. Without a time none plays, and nothing is checked.
    pub(super) fn read(file: &'a File<'a>, options: &GltfOptions) -> Read<Self> {
        let mut playing = Self { file, channels: vec![] };
        if options.frame.is_none() {
            return Ok(playing);
        }
        let chosen = options.animation.as_deref().map(|name| position(file, name)).transpose()?;
        let mut moved: HashSet<(Target, Path)> = HashSet::new();
        let (mut played, mut changes) = (Played::default(), Changes::default());
        for (position, &animation) in file.list(List::Animations).iter().enumerate() {
            let channels = channels(file, animation)?;
            if chosen.is_some_and(|chosen| chosen != position) {
                continue;
            }
            let key = |channel: &Channel<'_>| (channel.target.clone(), channel.path);
            if channels.iter().any(|channel| moved.contains(&key(channel))) {
                let warning = Diagnostic::warning(
                    "animation is left out: an earlier one moves the same (choose one with --animation)",
                );
                let name = animation.string_at("name")?.map_or_else(|| position.to_string(), Into::into);
                file.push(warning.at(animation.place()).found(quoted(&name)));
                continue;
            }
            moved.extend(channels.iter().map(key));
            for channel in channels {
                let nothing = vec![0.0; channel.numbers()];
                let is_free = match &channel.target {
                    Target::Pointer(pointer) => changes.set(pointer, &nothing, channel.is_list()),
                    target => played.set(target, channel.path, nothing),
                };
                if is_free {
                    playing.channels.push(channel);
                } else {
                    file.warn(channel.value, "animation is left out: another one animates the same");
                }
            }
        }
        Ok(playing)
    }

    /// Their effect on nodes and meshes at a time in seconds.
    pub(super) fn at(&self, time: f64) -> Read<Played> {
        let mut played = Played::default();
        for channel in &self.channels {
            if !matches!(channel.target, Target::Pointer(_)) {
                played.set(&channel.target, channel.path, channel.sample(self.file, time)?);
            }
        }
        Ok(played)
    }

    /// Their effect on anything else at a time, by pointers.
    pub(super) fn changes(&self, time: f64) -> Read<Changes> {
        let mut changes = Changes::default();
        for channel in &self.channels {
            if let Target::Pointer(pointer) = &channel.target {
                changes.set(pointer, &channel.sample(self.file, time)?, channel.is_list());
            }
        }
        Ok(changes)
    }

    /// Warns of values changed by pointers between these times: they are fixed at the middle.
    pub(super) fn warn_of_changes(&self, times: &[f64]) -> Read<()> {
        for channel in &self.channels {
            let Target::Pointer(pointer) = &channel.target else { continue };
            let values: Vec<Vec<f64>> =
                times.iter().map(|&time| channel.sample(self.file, time)).collect::<Read<_>>()?;
            if values.iter().any(|value| *value != values[0]) {
                let warning = Diagnostic::warning(
                    "animation without motion blur: its value halfway through the shutter is used",
                );
                self.file.push(warning.at(channel.value.place()).found(quoted(pointer)));
            }
        }
        Ok(())
    }

    /// Whether nothing plays.
    pub(super) fn is_empty(&self) -> bool {
        self.channels.is_empty()
    }
}

impl Played {
    /// Sets a value; false if it is already set.
    fn set(&mut self, target: &Target, path: Path, v: Vec<f64>) -> bool {
        let node = match *target {
            Target::Mesh(mesh) => return self.meshes.entry(mesh).or_default().set(path, v),
            Target::Node(node) => self.nodes.entry(node).or_default(),
            Target::Pointer(_) => return false,
        };
        let vec3 = |v: &[f64]| DVec3::new(v[0], v[1], v[2]);
        match path {
            Path::Translation => set(&mut node.translation, vec3(&v)),
            Path::Rotation => set(&mut node.rotation, DQuat::from_xyzw(v[0], v[1], v[2], v[3])),
            Path::Scale => set(&mut node.scale, vec3(&v)),
            Path::Weights | Path::Weight(_) => node.weights.set(path, v),
            Path::Numbers { .. } => false,
        }
    }
}

/// Sets an empty place; false if it is occupied.
fn set<T>(place: &mut Option<T>, value: T) -> bool {
    let is_free = place.is_none();
    place.get_or_insert(value);
    is_free
}

/// The index of the animation with a name, or else a number.
fn position(file: &File<'_>, wanted: &str) -> Read<usize> {
    let mut names = vec![];
    for (position, value) in file.list(List::Animations).iter().enumerate() {
        names.push(value.string_at("name")?.map_or_else(|| position.to_string(), Into::into));
    }
    let by_number = || wanted.parse().ok().filter(|&position: &usize| position < names.len());
    if let Some(position) = names.iter().position(|name| name == wanted).or_else(by_number) {
        return Ok(position);
    }
    if names.is_empty() {
        let wrong = format!("--animation {}: the file has no animations", quoted(wanted));
        return Err(Diagnostic::error(wrong).at(file.whole()).into());
    }
    let wrong = Diagnostic::error("no such animation").at(file.whole()).found(quoted(wanted));
    let known: Vec<String> = names.iter().take(20).map(|name| quoted(name)).collect();
    Err(wrong.expected(known.join(", ")).suggest(wanted, names.iter().map(String::as_str)).into())
}

/// Checks all animations without playing them.
pub(super) fn check(file: &File<'_>) -> Read<()> {
    for &animation in file.list(List::Animations) {
        channels(file, animation)?;
    }
    Ok(())
}

fn channels<'a>(file: &'a File<'_>, animation: Value<'a>) -> Read<Vec<Channel<'a>>> {
    let samplers: Vec<Value<'a>> = animation.need("samplers")?.array()?.collect();
    let mut channels = vec![];
    for value in animation.need("channels")?.array()? {
        let sampler = samplers[value.need("sampler")?.index(samplers.len(), "a sampler")?];
        let target = value.need("target")?;
        let path_value = target.need("path")?;
        let extension = target.extension("KHR_animation_pointer")?;
        let (pointed, path) = match (&*path_value.string()?, extension) {
            ("translation", _) => (None, Path::Translation),
            ("rotation", _) => (None, Path::Rotation),
            ("scale", _) => (None, Path::Scale),
            ("weights", _) => (None, Path::Weights),
            ("pointer", Some(extension)) => {
                if let Some(node) = target.get("node")? {
                    file.breach(node.wrong("animation by a pointer that names a node, too"))?;
                }
                match pointed(file, &extension.need("pointer")?.string()?) {
                    Some((target, path)) => (Some(target), path),
                    None => {
                        channels.extend(by_pointer(file, value, extension, sampler)?);
                        continue;
                    }
                }
            }
            (other, _) => {
                let wrong = path_value.wrong("unknown target of an animation").found(quoted(other));
                return Err(wrong.suggest(other, ["translation", "rotation", "scale", "weights"]).into());
            }
        };
        let interpolation = interpolation(sampler)?;
        use Component::{F32, I8, I16, U8, U16};
        let input_value = sampler.need("input")?;
        let input = Accessor::named(file, input_value)?;
        input.expect(input_value, &[Element::Scalar], &[F32])?;
        let output_value = sampler.need("output")?;
        let output = Accessor::named(file, output_value)?;
        let (elements, components): (&[Element], &[Component]) = match path {
            Path::Translation | Path::Scale => (&[Element::Vec3], &[F32]),
            Path::Rotation => (&[Element::Vec4], &[F32, I8, U8, I16, U16]),
            Path::Weights | Path::Weight(_) | Path::Numbers { .. } => {
                (&[Element::Scalar], &[F32, I8, U8, I16, U16])
            }
        };
        output.expect(output_value, elements, components)?;
        let aim = match pointed {
            Some(aim) => aim,
            // Without a node, it may belong to an extension.
            None => match file.named(List::Nodes, target, "node")? {
                Some((node, _)) => Target::Node(node),
                None => continue,
            },
        };
        let targets = match aim {
            Target::Node(node) => targets(file, file.list(List::Nodes)[node])?,
            Target::Mesh(mesh) => targets_of(file.list(List::Meshes)[mesh])?,
            Target::Pointer(_) => 0,
        };
        let (width, is_there) = match path {
            Path::Weights => (targets, targets > 0),
            Path::Weight(position) => (1, position < targets),
            _ => (1, true),
        };
        if !is_there {
            return Err(target.wrong("animation of morph targets that do not exist").into());
        }
        let each = if interpolation == Interpolation::CubicSpline { 3 } else { 1 };
        let expected = input.count.checked_mul(width).and_then(|n| n.checked_mul(each));
        if expected != Some(output.count) {
            let wrong =
                output_value.wrong("animation of a wrong length").found(format!("{} elements", output.count));
            let expected = format!("{} times {} times {each}", input.count, width);
            return Err(wrong.expected(expected).into());
        }
        channels.push(Channel { value, target: aim, path, interpolation, input, output, width });
    }
    Ok(channels)
}

fn interpolation(sampler: Value<'_>) -> Read<Interpolation> {
    let Some(value) = sampler.get("interpolation")? else { return Ok(Interpolation::Linear) };
    Ok(match &*value.string()? {
        "LINEAR" => Interpolation::Linear,
        "STEP" => Interpolation::Step,
        "CUBICSPLINE" => Interpolation::CubicSpline,
        other => {
            let wrong = value.wrong("unknown interpolation").found(quoted(other));
            return Err(wrong.suggest(other, ["LINEAR", "STEP", "CUBICSPLINE"]).into());
        }
    })
}

/// The target of a pointer that addresses the same values as other channels.
fn pointed(file: &File<'_>, pointer: &str) -> Option<(Target, Path)> {
    let steps: Vec<&str> = pointer.strip_prefix('/')?.split('/').collect();
    let position = |list: List, step: &str| step.parse().ok().filter(|&i: &usize| i < file.list(list).len());
    let target = match steps[..] {
        ["nodes", node, ..] => Target::Node(position(List::Nodes, node)?),
        ["meshes", mesh, "weights", ..] => Target::Mesh(position(List::Meshes, mesh)?),
        _ => return None,
    };
    let path = match steps[2..] {
        ["translation"] => Path::Translation,
        ["rotation"] => Path::Rotation,
        ["scale"] => Path::Scale,
        ["weights"] => Path::Weights,
        ["weights", target] => Path::Weight(target.parse().ok()?),
        _ => return None,
    };
    Some((target, path))
}

/// The channel of a pointer; `None` if it is not played.
fn by_pointer<'a>(
    file: &'a File<'_>,
    value: Value<'a>,
    extension: Value<'a>,
    sampler: Value<'a>,
) -> Read<Option<Channel<'a>>> {
    let pointer_value = extension.need("pointer")?;
    let pointer = pointer_value.string()?.into_owned();
    let interpolation = interpolation(sampler)?;
    let input_value = sampler.need("input")?;
    let input = Accessor::named(file, input_value)?;
    input.expect(input_value, &[Element::Scalar], &[Component::F32])?;
    let output_value = sampler.need("output")?;
    let output = Accessor::named(file, output_value)?;
    let each = if interpolation == Interpolation::CubicSpline { 3 } else { 1 };
    let keyframes = input.count.saturating_mul(each);
    if output.count == 0 || !output.count.is_multiple_of(keyframes) {
        let wrong = output_value.wrong("animation of a wrong length");
        let wrong = wrong.found(format!("{} elements", output.count));
        return Err(wrong.expected(format!("a multiple of {keyframes}")).into());
    }
    // Elements per keyframe: several of one number each are a list.
    let width = output.count / keyframes;
    let is_matrix = matches!(output.element, Element::Mat2 | Element::Mat3 | Element::Mat4);
    let is_list = output.element == Element::Scalar && (width > 1 || pointer.ends_with("/weights"));
    if !pointer::is_played(&pointer) || is_matrix || (width > 1 && !is_list) {
        file.warn(pointer_value, "animation is left out: this cannot be animated");
        return Ok(None);
    }
    if !pointer::has_place(file.root, &pointer)? {
        file.warn(pointer_value, "animation is left out: there is no such value");
        return Ok(None);
    }
    let path = Path::Numbers { width: width * output.element.numbers(), is_list };
    Ok(Some(Channel { value, target: Target::Pointer(pointer), path, interpolation, input, output, width }))
}

/// The number of morph targets of a node's mesh.
pub(super) fn targets(file: &File<'_>, node: Value<'_>) -> Read<usize> {
    file.named(List::Meshes, node, "mesh")?.map_or(Ok(0), |(_, mesh)| targets_of(mesh))
}

/// The number of morph targets of a mesh.
fn targets_of(mesh: Value<'_>) -> Read<usize> {
    let Some(primitive) = mesh.need("primitives")?.array()?.next() else { return Ok(0) };
    primitive.get("targets")?.map_or(Ok(0), |targets| Ok(targets.array()?.count()))
}

impl Channel<'_> {
    /// The number of components of a value.
    fn numbers(&self) -> usize {
        match self.path {
            Path::Translation | Path::Scale => 3,
            Path::Rotation => 4,
            Path::Weights | Path::Weight(_) => self.width,
            Path::Numbers { width, .. } => width,
        }
    }

    /// Whether it is written as a list.
    fn is_list(&self) -> bool {
        self.numbers() > 1 || matches!(self.path, Path::Numbers { is_list: true, .. })
    }

    /// The value at a time; constant before the first and after the last keyframe.
    fn sample(&self, file: &File<'_>, time: f64) -> Read<Vec<f64>> {
        let times = self.input.flat_floats(file, 1)?;
        if let Some(i) =
            (0..times.len()).find(|&i| !times[i].is_finite() || (i > 0 && times[i] <= times[i - 1]))
        {
            let wrong =
                self.input.value.wrong("times out of order").found(format!("{} as element {i}", times[i]));
            return Err(wrong.expected("finite numbers, each more than the one before").into());
        }
        let numbers = self.numbers();
        let each = match (self.path, self.output.element) {
            (Path::Translation | Path::Scale, _) => 3,
            (Path::Rotation, _) => 4,
            (Path::Weights | Path::Weight(_), _) => 1,
            (Path::Numbers { .. }, Element::Vec2 | Element::Vec3 | Element::Vec4) => {
                self.output.element.numbers()
            }
            (Path::Numbers { .. }, _) => 1,
        };
        let values = self.output.flat_floats(file, each)?;
        file.budget.release(4 * (times.len() + values.len()) as u64);
        if let Some(i) = values.iter().position(|v| !v.is_finite()) {
            let wrong = self
                .output
                .value
                .wrong("number that is not finite")
                .found(format!("{} as number {i}", values[i]));
            return Err(wrong.into());
        }
        let get = |block: usize| -> Vec<f64> {
            values[block * numbers..(block + 1) * numbers].iter().map(|&v| f64::from(v)).collect()
        };
        let is_cubic = self.interpolation == Interpolation::CubicSpline;
        // A keyframe of a spline has an in-tangent, a value and an out-tangent.
        let key = |k: usize| get(if is_cubic { 3 * k + 1 } else { k });
        let after = times.partition_point(|&t| f64::from(t) <= time);
        if after == 0 {
            return Ok(key(0));
        }
        let k = after - 1;
        if after == times.len() || self.interpolation == Interpolation::Step {
            return Ok(key(k));
        }
        let (t0, t1) = (f64::from(times[k]), f64::from(times[after]));
        let length = t1 - t0;
        let t = (time - t0) / length;
        let (from, to) = (key(k), key(after));
        let blend = |weights: &[(f64, &Vec<f64>)]| -> Vec<f64> {
            (0..numbers).map(|i| weights.iter().map(|(w, v)| w * v[i]).sum()).collect()
        };
        if is_cubic {
            let (out, into) = (get(3 * k + 2), get(3 * after));
            let (t2, t3) = (t * t, t * t * t);
            return Ok(blend(&[
                (2.0 * t3 - 3.0 * t2 + 1.0, &from),
                (length * (t3 - 2.0 * t2 + t), &out),
                (3.0 * t2 - 2.0 * t3, &to),
                (length * (t3 - t2), &into),
            ]));
        }
        if self.path != Path::Rotation {
            return Ok(blend(&[(1.0 - t, &from), (t, &to)]));
        }
        // Spherical interpolation along the shorter arc (Shoemake, "Animating rotation with quaternion curves",
        // SIGGRAPH 1985).
        let cosine: f64 = (0..4).map(|i| from[i] * to[i]).sum();
        let sign = if cosine < 0.0 { -1.0 } else { 1.0 };
        let angle = cosine.abs().min(1.0).arc_cosine();
        let sine = angle.sine();
        if sine < 1e-6 {
            return Ok(blend(&[(1.0 - t, &from), (sign * t, &to)]));
        }
        Ok(blend(&[(((1.0 - t) * angle).sine() / sine, &from), (sign * (t * angle).sine() / sine, &to)]))
    }
}
