//! The solids that a path is inside of.

use lumbre_math::Elementary;
use lumbre_scene::Interaction;
use lumbre_shading::{HomogeneousMedium, Material, Spectrum};
use smallvec::SmallVec;

/// The solids around a point of a path, the innermost last: what was entered and not left yet.
///
/// Solids are told apart by their materials, so that one made of several meshes may be entered by one and left by another. A
/// solid that stands wholly inside another takes its place there: light inside it is its own affair, and at its surface its
/// index of refraction counts against that of the solid around it. Where solids overlap without one holding the other,
/// the one that was entered last counts.
#[derive(Clone, Debug, Default)]
pub(crate) struct Interiors<'s> {
    around: SmallVec<[&'s Material; 2]>,
}

impl<'s> Interiors<'s> {
    /// Comes to a surface, whose material there is `material`. A solid that is met from inside without having been entered is
    /// one that the path began in; until then nothing is known of it.
    pub(crate) fn arrive(&mut self, here: &Interaction<'s>, material: Option<&'s Material>) {
        if let Some(material) = material.filter(|material| !here.front && material.is_solid())
            && !self.around.iter().any(|&solid| std::ptr::eq(solid, material))
        {
            self.around.insert(0, material);
        }
    }

    /// What scatters light in the innermost solid.
    pub(crate) fn medium(&self) -> Option<HomogeneousMedium> {
        self.around.last().and_then(|solid| solid.interior_medium())
    }

    /// What is left of light after a distance inside the innermost solid.
    pub(crate) fn transmittance(&self, distance: f64) -> Spectrum {
        let sigma = self.around.last().and_then(|solid| solid.interior_attenuation());
        sigma.map_or(Spectrum::WHITE, |sigma| {
            sigma.map(|sigma| (-f64::from(sigma) * distance).exponential() as f32)
        })
    }

    /// Whether there is none.
    pub(crate) fn is_empty(&self) -> bool {
        self.around.is_empty()
    }

    /// Whether light loses anything here.
    pub(crate) fn attenuates(&self) -> bool {
        self.around.last().is_some_and(|solid| solid.interior_attenuation().is_some())
    }

    /// Goes through a surface, into the solid behind it or out of it.
    pub(crate) fn cross(&mut self, material: &'s Material, inwards: bool) {
        if !material.is_solid() {
            return;
        }
        if inwards {
            // Open meshes are entered time and again and never left.
            if self.around.len() < 64 {
                self.around.push(material);
            }
        } else if let Some(place) = self.around.iter().rposition(|&solid| std::ptr::eq(solid, material)) {
            self.around.remove(place);
        }
    }

    /// The index of refraction outside a solid whose surface the path is at.
    pub(crate) fn index_outside(&self, material: &Material, from_outside: bool) -> f32 {
        let mut outer = self.around.iter().rev();
        let solid = if from_outside {
            outer.next()
        } else {
            let mut is_left = false;
            outer.find(|&&solid| {
                let this = !is_left && std::ptr::eq(solid, material);
                is_left |= this;
                !this
            })
        };
        solid.and_then(|solid| solid.interior_index()).unwrap_or(1.0)
    }
}
