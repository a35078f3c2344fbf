//! The motion of nodes during the exposure.

use std::collections::HashMap;
use std::sync::Arc;

use lumbre_math::{AnimatedTransform, DAffine3, DMat4, SingularTransformError, Transform};

use super::animation::Playing;
use super::file::{File, List};
use super::graph::Graph;
use super::json::Read;
use super::options::GltfOptions;
use super::scene;

/// The number of segments of the exposure. Within one, a node must rotate by less than half a turn, or it would
/// interpolate the other way.
const STEPS: usize = 16;

/// The same for vertices, which move linearly within a segment.
const MESH_STEPS: usize = 8;

/// The nodes at several times, from 0, when the shutter opens, to 1, when it closes.
pub(super) struct Exposure<'f> {
    file: &'f File<'f>,
    /// Empty for an exposure without duration.
    moments: Vec<Moment<'f>>,
}

/// A mesh at one time: see [`super::mesh::Pose`].
pub(super) struct OwnPose {
    pub weights: Vec<f64>,
    pub joints: Option<Vec<DMat4>>,
}

struct Moment<'f> {
    time: f64,
    graph: Graph<'f>,
    known: HashMap<usize, DAffine3>,
}

impl<'f> Exposure<'f> {
    pub(super) fn read(file: &'f File<'f>, playing: &Playing<'_>, options: &GltfOptions) -> Read<Self> {
        let mut moments = vec![];
        if let Some(middle) = options.frame
            && options.shutter > 0.0
            && !playing.is_empty()
        {
            let times: Vec<f64> = (0..=STEPS).map(|step| step as f64 / STEPS as f64).collect();
            let of_file = |time: f64| middle + (time - 0.5) * options.shutter;
            for &time in &times {
                let graph = Graph::read(file, playing.at(of_file(time))?)?;
                moments.push(Moment { time, graph, known: HashMap::new() });
            }
            let times: Vec<f64> = times.into_iter().map(of_file).collect();
            playing.warn_of_changes(&times)?;
        }
        Ok(Self { file, moments })
    }

    /// The transform of a node at each time.
    fn worlds(&mut self, node: usize) -> Read<Vec<(f64, DAffine3)>> {
        let world = |moment: &mut Moment<'_>| Ok((moment.time, moment.graph.world(node, &mut moment.known)?));
        self.moments.iter_mut().map(world).collect()
    }

    /// Whether a node moves.
    pub(super) fn moves(&mut self, node: usize) -> Read<bool> {
        let worlds = self.worlds(node)?;
        Ok(worlds.iter().any(|(_, world)| *world != worlds[0].1))
    }

    /// The mesh at each sampled time while it deforms; empty if it does not.
    pub(super) fn poses(&mut self, node: usize, skin: Option<usize>) -> Read<Vec<OwnPose>> {
        if !self.deforms(node, skin)? {
            return Ok(vec![]);
        }
        let file = self.file;
        let moments = self.moments.iter_mut().step_by(STEPS / MESH_STEPS);
        let pose = |moment: &mut Moment<'_>| {
            Ok(OwnPose {
                weights: scene::weights(&moment.graph, node)?,
                joints: skin
                    .map(|skin| scene::joints(file, &moment.graph, &mut moment.known, skin))
                    .transpose()?,
            })
        };
        moments.map(pose).collect()
    }

    /// Whether the mesh of a node deforms: by its morph targets, or by its skin's joints.
    pub(super) fn deforms(&mut self, node: usize, skin: Option<usize>) -> Read<bool> {
        if let Some((first, others)) = self.moments.split_first() {
            let first = first.graph.weights(node)?;
            for moment in others {
                if moment.graph.weights(node)? != first {
                    return Ok(true);
                }
            }
        }
        let Some(skin) = skin else { return Ok(false) };
        for name in self.file.list(List::Skins)[skin].need("joints")?.array()? {
            let (joint, _) = self.file.at(List::Nodes, name)?;
            if self.moves(joint)? {
                return Ok(true);
            }
        }
        Ok(false)
    }

    /// The motion of something at `place` in a node's space, relative to the node's transform; `None` if
    /// nothing moves.
    pub(super) fn motion(
        &mut self,
        node: usize,
        place: impl Fn(&DAffine3) -> Result<Transform, SingularTransformError>,
    ) -> Read<Option<Arc<AnimatedTransform>>> {
        if !self.moves(node)? {
            return Ok(None);
        }
        let worlds = self.worlds(node)?;
        let keys: Result<Vec<_>, _> = worlds.iter().map(|(time, world)| Ok((*time, place(world)?))).collect();
        let motion = keys.map_err(|error: SingularTransformError| error.to_string());
        let motion = motion.and_then(|keys| simplest(keys).map_err(|error| error.to_string()));
        match motion {
            Ok(motion) => Ok(Some(Arc::new(motion))),
            Err(error) => {
                let value = self.file.list(List::Nodes)[node];
                self.file.warn(value, &format!("the motion of a node is left out: {error}"));
                Ok(None)
            }
        }
    }
}

/// The motion through all keys, or through the first and the last if those pass through the others.
fn simplest(keys: Vec<(f64, Transform)>) -> Result<AnimatedTransform, lumbre_math::AnimationError> {
    let largest = |map: DAffine3| map.to_cols_array().into_iter().fold(0.0, |most: f64, x| most.max(x.abs()));
    let size = keys.iter().fold(0.0, |most: f64, (_, map)| most.max(largest(*map.affine())));
    let ends = AnimatedTransform::new(vec![keys[0], keys[keys.len() - 1]]);
    let passes = |ends: &AnimatedTransform, time: f64, map: &Transform| {
        let (a, b) = (*ends.at(time).affine(), *map.affine());
        let apart = DAffine3 { matrix3: a.matrix3 - b.matrix3, translation: a.translation - b.translation };
        largest(apart) <= 1e-6 * size
    };
    match ends {
        Ok(ends) if keys.iter().all(|(time, map)| passes(&ends, *time, map)) => Ok(ends),
        _ => AnimatedTransform::new(keys),
    }
}
