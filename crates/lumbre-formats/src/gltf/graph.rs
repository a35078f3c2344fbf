//! The node hierarchy and its transforms.

use std::collections::HashMap;

use lumbre_math::{DAffine3, DMat3, DMat4, DQuat, DVec3};

use super::animation::{Moved, Played, Weights};
use super::file::{File, List};
use super::json::{Read, Value};

/// The node hierarchy, known to be a forest.
pub(super) struct Graph<'a> {
    file: &'a File<'a>,
    parents: Vec<Option<u32>>,
    played: Played,
}

impl<'a> Graph<'a> {
    /// Reads all nodes. `played` is the effect of animations.
    pub(super) fn read(file: &'a File<'a>, played: Played) -> Read<Self> {
        let nodes = file.list(List::Nodes);
        let mut parents: Vec<Option<u32>> = file.budget.vec(nodes.len() as u64, "nodes")?;
        parents.resize(nodes.len(), None);
        for (index, node) in nodes.iter().enumerate() {
            let Some(children) = node.get("children")? else { continue };
            let mut is_empty = true;
            for name in children.array()? {
                is_empty = false;
                let (child, _) = file.at(List::Nodes, name)?;
                if let Some(other) = parents[child] {
                    let wrong = name
                        .wrong("node with two parents")
                        .found(format!("node {child}, a child of {other} and of {index}"));
                    return Err(wrong.into());
                }
                parents[child] = Some(index as u32);
            }
            if is_empty {
                file.breach(children.wrong("empty list").expected("one child or more, or no list"))?;
            }
        }
        let graph = Self { file, parents, played };
        graph.refuse_cycles()?;
        Ok(graph)
    }

    /// With one parent each, only a cycle has no root.
    fn refuse_cycles(&self) -> Read<()> {
        // For each node, the walk that visited it; 0 is none.
        let mut met = vec![0_u32; self.parents.len()];
        for start in 0..self.parents.len() {
            let walk = start as u32 + 1;
            let mut here = start;
            while met[here] == 0 {
                met[here] = walk;
                match self.parents[here] {
                    Some(parent) => here = parent as usize,
                    None => break,
                }
            }
            let is_ring = met[here] == walk && self.parents[here].is_some();
            if !is_ring {
                continue;
            }
            const SHOWN: usize = 8;
            let mut ring = vec![here];
            let mut next = here;
            while let Some(parent) = self.parents[next] {
                next = parent as usize;
                ring.push(next);
                if next == here {
                    break;
                }
                if ring.len() > SHOWN {
                    break;
                }
            }
            let mut said: Vec<String> = ring.iter().rev().map(usize::to_string).collect();
            if ring.len() > SHOWN {
                said.insert(0, "…".to_owned());
            }
            let node = self.file.list(List::Nodes)[here];
            return Err(node.wrong("node inside itself").found(format!("nodes {}", said.join(" > "))).into());
        }
        Ok(())
    }

    /// The nodes without a parent.
    pub(super) fn roots(&self) -> impl Iterator<Item = usize> + '_ {
        (0..self.parents.len()).filter(|&node| self.parents[node].is_none())
    }

    /// Whether a node has a parent.
    pub(super) fn is_child(&self, node: usize) -> bool {
        self.parents[node].is_some()
    }

    /// The effect of animations on a node.
    pub(super) fn moved(&self, node: usize) -> Option<&Moved> {
        self.played.nodes.get(&node)
    }

    /// The weights of morph targets of a node's mesh, animations included; `None` if there are none.
    pub(super) fn weights(&self, node: usize) -> Read<Option<Vec<f64>>> {
        let value = self.file.list(List::Nodes)[node];
        let still = |value: Value<'_>| -> Read<Option<Vec<f64>>> {
            value.get("weights")?.map(|list| list.array()?.map(Value::number).collect()).transpose()
        };
        let over = |moved: Option<&Weights>, still: Option<Vec<f64>>| match moved {
            Some(moved) => moved.over(still),
            None => still,
        };
        let of_mesh = match self.file.named(List::Meshes, value, "mesh")? {
            Some((index, mesh)) => over(self.played.meshes.get(&index), still(mesh)?),
            None => None,
        };
        Ok(over(self.moved(node).map(|moved| &moved.weights), still(value)?.or(of_mesh)))
    }

    /// The transform from node to parent space.
    pub(super) fn local(&self, node: usize) -> Read<DAffine3> {
        local(self.file, self.file.list(List::Nodes)[node], self.moved(node))
    }

    /// The transform from node to world space. Ancestors' transforms are cached in `known`.
    pub(super) fn world(&self, node: usize, known: &mut HashMap<usize, DAffine3>) -> Read<DAffine3> {
        let mut path = vec![];
        let mut here = Some(node);
        let mut world = DAffine3::IDENTITY;
        while let Some(node) = here {
            if let Some(found) = known.get(&node) {
                world = *found;
                break;
            }
            path.push(node);
            here = self.parents[node].map(|parent| parent as usize);
        }
        for node in path.into_iter().rev() {
            world *= self.local(node)?;
            known.insert(node, world);
        }
        Ok(world)
    }

    /// Visits all nodes below `roots`, parents first, with their world transforms, and whether they and all
    /// above them are visible (`KHR_node_visibility`).
    pub(super) fn walk(
        &self,
        roots: &[usize],
        mut visit: impl FnMut(usize, &DAffine3, bool) -> Read<()>,
    ) -> Read<()> {
        let mut waiting: Vec<(usize, DAffine3, bool)> = vec![];
        for &root in roots {
            waiting.push((root, DAffine3::IDENTITY, true));
            while let Some((node, parent, is_visible)) = waiting.pop() {
                let world = parent * self.local(node)?;
                let value = self.file.list(List::Nodes)[node];
                let own = value.extension("KHR_node_visibility")?;
                let is_visible = is_visible && own.map_or(Ok(true), |own| own.bool_or("visible", true))?;
                visit(node, &world, is_visible)?;
                if let Some(children) = value.get("children")? {
                    let first = waiting.len();
                    for child in children.array()? {
                        waiting.push((self.file.at(List::Nodes, child)?.0, world, is_visible));
                    }
                    // The first child comes next.
                    waiting[first..].reverse();
                }
            }
        }
        Ok(())
    }
}

/// The transform from node to parent space.
fn local(file: &File<'_>, node: Value<'_>, moved: Option<&Moved>) -> Read<DAffine3> {
    let any = f64::NEG_INFINITY..=f64::INFINITY;
    let parts = ["translation", "rotation", "scale"];
    let moved_parts = moved.is_some_and(Moved::places);
    if let Some(value) = node.get("matrix")? {
        for part in parts {
            if let Some(part) = node.get(part)? {
                file.breach(part.wrong("node with a matrix and with parts of one"))?;
            }
        }
        let matrix = DMat4::from_cols_array(&value.numbers::<16>()?);
        if matrix.row(3).to_array() != [0.0, 0.0, 0.0, 1.0] {
            file.breach(value.wrong("matrix that is not affine").expected("0, 0, 0, 1 as the last row"))?;
        }
        let columns = [matrix.x_axis, matrix.y_axis, matrix.z_axis].map(|c| c.truncate().normalize_or_zero());
        let skew = columns[0].dot(columns[1]).abs()
            + columns[1].dot(columns[2]).abs()
            + columns[2].dot(columns[0]).abs();
        if skew > 1e-2 {
            file.breach(
                value.wrong("matrix that shears").expected("a scale, then a rotation, then a translation"),
            )?;
        }
        if !moved_parts {
            return Ok(DAffine3 { matrix3: DMat3::from_mat4(matrix), translation: matrix.w_axis.truncate() });
        }
        file.breach(
            value
                .wrong("matrix of a node that an animation moves")
                .expected("translation, rotation and scale"),
        )?;
    }
    let translation = node.numbers_or("translation", [0.0; 3], any.clone())?;
    let rotation = node.numbers_or("rotation", [0.0, 0.0, 0.0, 1.0], any.clone())?;
    let scale = node.numbers_or("scale", [1.0; 3], any)?;
    let rotation = DQuat::from_array(rotation);
    if (rotation.length_squared() - 1.0).abs() > 0.01 {
        file.breach(node.need("rotation")?.wrong("rotation that is not a unit quaternion").found(rotation))?;
    }
    let still = Moved::default();
    let moved = moved.unwrap_or(&still);
    let translation = moved.translation.unwrap_or(DVec3::from_array(translation));
    let rotation = moved.rotation.unwrap_or(rotation);
    let scale = moved.scale.unwrap_or(DVec3::from_array(scale));
    let length = rotation.length();
    let rotation = if length > 0.0 { rotation * (1.0 / length) } else { DQuat::IDENTITY };
    Ok(DAffine3::from_scale_rotation_translation(scale, rotation, translation))
}
