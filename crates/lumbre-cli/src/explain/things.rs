//! What the shapes of a file are called, and what they are made of.

use std::collections::{BTreeSet, HashMap};

use lumbre::SceneDesc;
use lumbre::description::{GeometryDesc, ShapeDesc};

/// The shapes of a file by their number, and the materials.
#[derive(Debug, Default)]
pub struct Things {
    shapes: HashMap<u32, Thing>,
    materials: Vec<Substance>,
}

/// A shape of a file.
#[derive(Clone, Copy, Debug)]
struct Thing {
    kind: &'static str,
    material: Option<usize>,
}

/// A parameter's name and its numbers; without these where a texture stands.
type Parameter = (String, Option<Vec<f64>>);

/// A material of a file.
#[derive(Clone, Debug)]
pub(super) struct Substance {
    /// Its name, if it has one, and its kind.
    pub(super) name: Option<String>,
    pub(super) kind: &'static str,
    /// Its parameters.
    pub(super) parameters: Vec<Parameter>,
}

impl Things {
    /// Of a description.
    pub fn of(desc: &SceneDesc) -> Self {
        let mut by_owner: HashMap<String, Vec<Parameter>> = HashMap::new();
        for parameter in lumbre::parameters(desc) {
            let owner = parameter.path.strip_suffix(&parameter.name).unwrap_or_default().to_owned();
            by_owner.entry(owner).or_default().push((parameter.name, parameter.value));
        }
        let materials = desc.materials.iter().enumerate().map(|(index, named)| {
            let called = named.name.clone().unwrap_or_else(|| index.to_string());
            let parameters = by_owner.remove(&format!("material.{called}.")).unwrap_or_default();
            Substance { name: named.name.clone(), kind: named.material.kind.name(), parameters }
        });
        let materials = materials.collect();
        let in_objects = desc.objects.iter().flat_map(|object| &object.shapes);
        let mut open: Vec<&ShapeDesc> = desc.shapes.iter().chain(in_objects).collect();
        let mut shapes = HashMap::new();
        while let Some(shape) = open.pop() {
            if let GeometryDesc::Csg(csg) = &shape.geometry {
                // A hit is on a shape of an operand, which comes later: the number may be that of the first of them.
                open.extend(csg.operands.iter().flat_map(|operand| &**operand));
            }
            let material = shape.material.map(|id| id.0 as usize);
            shapes.insert(shape.index, Thing { kind: shape.geometry.name(), material });
        }
        Self { shapes, materials }
    }

    /// What kind of shape has this number, in the words of the scene language; the ground is of no file.
    pub(super) fn kind(&self, shape: u32) -> &'static str {
        self.shapes.get(&shape).map_or("ground", |thing| thing.kind)
    }

    /// Whether a shape is asked for by this name: its number, its kind, or the name of its material.
    pub(super) fn is_called(&self, shape: u32, name: &str) -> bool {
        let material = self.material(shape).and_then(|material| material.name.as_deref());
        name.parse() == Ok(shape) || self.kind(shape) == name || material == Some(name)
    }

    /// The names by which the shapes of the file can be asked for, beside their numbers.
    pub(super) fn names(&self) -> BTreeSet<&str> {
        let kinds = self.shapes.values().map(|thing| thing.kind);
        let materials = self.shapes.keys().filter_map(|shape| self.material(*shape)?.name.as_deref());
        kinds.chain(materials).collect()
    }

    /// What a shape is made of.
    pub(super) fn material(&self, shape: u32) -> Option<&Substance> {
        self.materials.get(self.shapes.get(&shape)?.material?)
    }
}
