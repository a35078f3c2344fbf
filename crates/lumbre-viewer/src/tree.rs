//! The shapes of a scene by name, and which of them are hidden.

use std::collections::BTreeSet;
use std::sync::Arc;

use lumbre::SceneDesc;
use lumbre::description::ShapeDesc;

use crate::message::{HiddenShapes, ListedShape, ShapeGroup, ShapeTree};

/// Shapes that a page can list.
const MAX_LISTED: usize = 2000;
/// Shapes that a page can name at once.
pub(crate) const MAX_NAMED: usize = 1000;

/// Shapes of a scene that are not in its picture, by [`ShapeDesc::index`].
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Hidden {
    shapes: BTreeSet<u32>,
    /// Whether these are shown, and all others hidden.
    others: bool,
}

impl Hidden {
    /// Hides these shapes, or with `others` all but these. Nothing is hidden by no shapes at all.
    pub(crate) fn new(shapes: impl IntoIterator<Item = u32>, others: bool) -> Self {
        let shapes: BTreeSet<u32> = shapes.into_iter().collect();
        Self { others: others && !shapes.is_empty(), shapes }
    }

    /// Takes the hidden shapes out of a description. On a stage it is called when the stage is set, so that neither
    /// camera nor ground move.
    pub fn apply(&self, desc: &mut SceneDesc) {
        if self.shapes.is_empty() {
            return;
        }
        let is_shown = |shape: &ShapeDesc| self.shapes.contains(&shape.index) == self.others;
        desc.shapes.retain(is_shown);
        for object in &mut desc.objects {
            object.shapes.retain(is_shown);
        }
    }

    /// As a page lists them.
    pub(crate) fn listed(&self) -> HiddenShapes {
        HiddenShapes { shapes: self.shapes.iter().copied().collect(), others: self.others }
    }
}

/// What a shape is called. Shapes share the texts.
#[derive(Clone, Debug)]
pub(crate) struct Thing {
    /// The name of its kind.
    pub kind: &'static str,
    /// Its own name, if the file gives one.
    pub name: Option<Arc<str>>,
    /// That of its material.
    pub material: Option<MaterialInfo>,
    /// Whether it emits light.
    pub shines: bool,
}

/// What a material is called.
#[derive(Clone, Debug)]
pub(crate) struct MaterialInfo {
    /// Its name and its kind.
    label: Arc<str>,
    /// What its parameters belong to: [`lumbre::Parameter::owner`].
    owner: Arc<str>,
}

impl Default for Thing {
    /// What is of no file.
    fn default() -> Self {
        Self { kind: "ground", name: None, material: None, shines: false }
    }
}

impl Thing {
    fn new(shape: &ShapeDesc, desc: &SceneDesc, substances: &[MaterialInfo]) -> Self {
        Self {
            kind: shape.geometry.name(),
            name: desc.listing.shapes.get(&shape.index).cloned(),
            material: shape.material.and_then(|id| substances.get(id.0 as usize).cloned()),
            shines: shape.area_light.is_some(),
        }
    }

    /// As a page lists it.
    pub(crate) fn listed(&self, shape: u32) -> ListedShape {
        let Self { kind, name, material, shines } = self;
        let text = |text: &Arc<str>| text.as_ref().to_owned();
        ListedShape {
            shape,
            kind: (*kind).to_owned(),
            name: name.as_ref().map(text),
            material: material.as_ref().map(|of| text(&of.label)),
            owner: material.as_ref().map(|of| text(&of.owner)),
            shines: *shines,
        }
    }
}

fn substances(desc: &SceneDesc) -> Vec<MaterialInfo> {
    let all = desc.materials.iter().enumerate().map(|(index, material)| {
        let name = material.name.clone().unwrap_or_else(|| index.to_string());
        let owner = format!("material {name} ({})", material.material.kind.name());
        MaterialInfo { label: material.label().into(), owner: owner.into() }
    });
    all.collect()
}

/// All shapes of a description by their index.
pub(crate) fn things(desc: &SceneDesc) -> Vec<Thing> {
    let substances = substances(desc);
    let mut things = Vec::new();
    let in_objects = desc.objects.iter().flat_map(|object| &object.shapes);
    for shape in desc.shapes.iter().chain(in_objects) {
        let index = shape.index as usize;
        // Indices count the shapes of a file: a number that does not would be some other program's.
        if index >= things.len() && index < 50_000_000 {
            things.resize_with(index + 1, Thing::default);
        }
        let Some(thing) = things.get_mut(index) else { continue };
        *thing = Thing::new(shape, desc, &substances);
    }
    things
}

/// The shapes of the world and of each object, as a page lists them.
pub(crate) fn tree(desc: &SceneDesc) -> ShapeTree {
    let substances = substances(desc);
    let mut left = MAX_LISTED;
    let mut group = |name: Option<&str>, shapes: &[ShapeDesc]| {
        let listed = shapes.len().min(left);
        left -= listed;
        let shapes = shapes[..listed].iter();
        let shapes = shapes.map(|shape| Thing::new(shape, desc, &substances).listed(shape.index));
        ShapeGroup { name: name.map(str::to_owned), shapes: shapes.collect() }
    };
    let mut groups = vec![group(None, &desc.shapes)];
    groups.extend(
        desc.objects
            .iter()
            .filter(|object| !object.shapes.is_empty())
            .map(|object| group(Some(&object.name), &object.shapes)),
    );
    groups.retain(|group| !group.shapes.is_empty());
    let all = desc.shapes.len() + desc.objects.iter().map(|object| object.shapes.len()).sum::<usize>();
    ShapeTree { groups, left_out: all - (MAX_LISTED - left) }
}

#[cfg(test)]
mod tests {
    use lumbre::geometry::Sphere;
    use lumbre::{DVec3, SceneBuilder, ShapeBuilder};

    use super::*;

    #[test]
    fn shapes_are_hidden_by_their_index_in_the_world_and_in_objects() {
        let ball = |x: f64| ShapeBuilder::exact(Sphere::new(DVec3::new(x, 0.0, 0.0), 2.0).unwrap());
        let mut builder = SceneBuilder::new();
        for i in 0..4 {
            builder = builder.shape(ball(f64::from(i)));
        }
        let mut desc = builder.description().clone();
        let inner = desc.shapes.split_off(2);
        desc.objects.push(lumbre::description::ObjectDesc {
            name: "pair".into(),
            shapes: inner,
            ..Default::default()
        });
        let left = |hidden: &Hidden| {
            let mut desc = desc.clone();
            hidden.apply(&mut desc);
            let shapes = desc.shapes.iter().chain(&desc.objects[0].shapes);
            shapes.map(|shape| shape.index).collect::<Vec<_>>()
        };
        assert_eq!(left(&Hidden::default()), [0, 1, 2, 3]);
        assert_eq!(left(&Hidden::new([1, 2], false)), [0, 3]);
        assert_eq!(left(&Hidden::new([1, 2, 77], true)), [1, 2]);
        assert_eq!(left(&Hidden::new([], true)), [0, 1, 2, 3]);
        let tree = tree(&desc);
        assert_eq!(tree.groups[1].name.as_deref(), Some("pair"));
        assert_eq!(tree.groups[1].shapes[1].shape, 3);
        assert_eq!(tree.left_out, 0);
    }
}
