//! Participating media in a scene, and the surfaces between them.
//!
//! Surfaces without material that separate two media are in a tree of their own: light passes straight through them, so
//! other rays need not test them. Surfaces with a material are among all others; their [`Boundary`] has the media on
//! both sides.

use std::ops::ControlFlow;
use std::sync::Arc;

use lumbre_geometry::{Ray, Surface};
use lumbre_kernel::{Accel, Hit};
use lumbre_shading::medium::{Medium, PassageNumbers, Way};
use lumbre_shading::spectrum::Wavelengths;
use lumbre_shading::{MaterialKind, Spectrum};

use crate::surface::{Form, SurfaceEntry};
use crate::{
    Boundary, BuildError, GeometryDesc, MediumId, NamedMaterial, ObjectDesc, Scene, SceneDesc, ShapeDesc,
};

/// The media of a scene.
#[derive(Clone, Debug, Default)]
pub(crate) struct Media {
    pub media: Vec<Arc<Medium>>,
    /// The surfaces without material between them; `None` if there are none.
    pub boundaries: Option<Arc<Boundaries>>,
}

/// A tree of surfaces that only separate media.
#[derive(Debug)]
pub(crate) struct Boundaries {
    pub accel: Arc<Accel>,
    pub entries: Vec<SurfaceEntry>,
}

/// A ray's crossing of a surface without material, from one medium to another.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Crossing {
    /// The position along the ray, in units of its direction.
    pub t: f64,
    /// The medium beyond; `None` is a vacuum.
    pub beyond: Option<MediumId>,
    /// Whether the ray leaves the inside of the surface.
    leaves: bool,
}

/// Removes the shapes that only separate media from a description, and returns them as shapes and objects of their own.
pub(crate) fn split(desc: &mut SceneDesc) -> Option<(Vec<ShapeDesc>, Vec<ObjectDesc>)> {
    let materials = &desc.materials;
    let mut found = false;
    let mut taken = |shapes: &mut Vec<ShapeDesc>| {
        let taken: Vec<_> = shapes.extract_if(.., |shape| separates(shape, materials)).collect();
        found |= !taken.is_empty();
        taken
    };
    let shapes = taken(&mut desc.shapes);
    let objects: Vec<_> = desc
        .objects
        .iter_mut()
        .map(|object| ObjectDesc {
            name: object.name.clone(),
            shapes: taken(&mut object.shapes),
            instances: object.instances.clone(),
        })
        .collect();
    found.then_some((shapes, objects))
}

/// Whether a shape has no material, and different media on its sides.
fn separates(shape: &ShapeDesc, materials: &[NamedMaterial]) -> bool {
    shape.boundary.is_some_and(|Boundary { inside, outside }| inside != outside)
        && is_interface(shape, materials)
}

/// Whether no part of a shape has a material.
fn is_interface(shape: &ShapeDesc, materials: &[NamedMaterial]) -> bool {
    if let GeometryDesc::Csg(csg) = &shape.geometry {
        return csg.operands.iter().flat_map(|operand| &**operand).all(|part| is_interface(part, materials));
    }
    let material = shape.material.and_then(|id| materials.get(id.0 as usize));
    match material {
        Some(named) => matches!(named.material.kind, MaterialKind::Interface),
        None => shape.material.is_none(),
    }
}

/// Whether anything is in a medium. Checks that every referenced medium exists.
pub(crate) fn check(desc: &SceneDesc) -> Result<bool, BuildError> {
    let count = desc.media.len();
    let shapes = desc.objects.iter().flat_map(|object| &object.shapes).chain(&desc.shapes);
    let of_shapes = shapes.filter_map(|shape| shape.boundary).flat_map(|b| [b.inside, b.outside]);
    let of_cameras = desc.cameras.iter().map(|camera| camera.medium);
    let mut is_used = false;
    for MediumId(medium) in of_shapes.chain(of_cameras).flatten() {
        is_used = true;
        if medium as usize >= count {
            return Err(BuildError::NoSuchMedium { medium, count });
        }
    }
    Ok(is_used)
}

impl Boundaries {
    /// Appends the crossings of a ray, in order.
    fn crossings(&self, ray: &Ray, crossings: &mut Vec<Crossing>) {
        let before = crossings.len();
        self.accel.all(ray, |hit| {
            crossings.extend(self.crossing(ray, hit));
            ControlFlow::Continue(())
        });
        // Where two surfaces touch, a ray leaves one solid before it enters the other.
        crossings[before..].sort_by(|a, b| a.t.total_cmp(&b.t).then(b.leaves.cmp(&a.leaves)));
    }

    fn crossing(&self, ray: &Ray, hit: &Hit) -> Option<Crossing> {
        let entry = &self.entries[hit.id as usize];
        let Boundary { inside, outside } = entry.boundary?;
        let geometric = self.accel.surface(ray, hit);
        let leaves = self.outward(entry, ray, hit, geometric).normal.dot(ray.direction) > 0.0;
        Some(Crossing { t: hit.root.t, beyond: if leaves { outside } else { inside }, leaves })
    }

    /// The surface with its normal on the outside.
    fn outward(&self, entry: &SurfaceEntry, ray: &Ray, hit: &Hit, geometric: Surface) -> Surface {
        let (part, local) = match entry.form {
            Form::Csg(_) => (0, hit.root.local),
            _ => entry.whole(hit.primitive, hit.root.local),
        };
        let placement = (!hit.instances.is_empty()).then(|| self.accel.world_from_object(ray, hit));
        entry.shading_geometry(&geometric, part, local, placement.as_ref(), ray.time).surface
    }
}

impl Scene {
    /// Whether there is any medium between its surfaces. (Scattering inside solids belongs to their materials.)
    pub fn has_media(&self) -> bool {
        !self.media.media.is_empty()
    }

    /// The medium of an index.
    ///
    /// # Panics
    /// If the scene has no medium of this index.
    pub fn medium(&self, id: MediumId) -> &Medium {
        &self.media.media[id.0 as usize]
    }

    /// Memory of the grids of all media, in bytes.
    pub fn media_memory(&self) -> usize {
        self.media.media.iter().map(|medium| medium.memory()).sum()
    }

    /// Appends the crossings of a ray with surfaces without material between media, in order.
    pub fn crossings(&self, ray: &Ray, crossings: &mut Vec<Crossing>) {
        if let Some(boundaries) = &self.media.boundaries {
            boundaries.crossings(ray, crossings);
        }
    }

    /// An estimate of the transmittance of media along a ray with a range, which starts in a medium. Other objects on
    /// the way do not count. `seed` selects one of the possible estimates. Channels are those of linear Rec. 709, or
    /// the given wavelengths.
    pub fn transmittance(
        &self,
        medium: Option<MediumId>,
        ray: &Ray,
        seed: u64,
        wavelengths: Option<&Wavelengths>,
    ) -> Spectrum {
        let mut crossings = Vec::new();
        self.crossings(ray, &mut crossings);
        let speed = ray.direction.length();
        let direction = ray.direction / speed;
        let (mut left, mut at, mut medium) = (Spectrum::WHITE, ray.t_min, medium);
        let ends = crossings.iter().map(|crossing| (crossing.t, crossing.beyond));
        for (part, (end, beyond)) in (0..).zip(ends.chain([(ray.t_max, None)])) {
            if let Some(id) = medium {
                let way = Way { origin: ray.at(at), direction, length: (end - at) * speed };
                let numbers = PassageNumbers::from_seed(seed.wrapping_add(part));
                left *= self.medium(id).transmittance(&way, numbers, wavelengths);
                if left.is_black() {
                    return left;
                }
            }
            (at, medium) = (end, beyond);
        }
        left
    }
}
