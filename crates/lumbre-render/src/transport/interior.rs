//! The solids that a path is inside of.

use lumbre_math::Elementary;
use lumbre_scene::{Interaction, MaterialId};
use lumbre_shading::spectrum::{SpectralLookup, Wavelengths};
use lumbre_shading::{HomogeneousMedium, Material, Spectrum};
use smallvec::SmallVec;

/// The solids around a point of a path, the innermost last: entered and not yet left.
///
/// Solids are identified by the materials of their surfaces, so that one made of several meshes may be entered by one
/// and left by another. Only the innermost medium applies. At its surface, its index of refraction is relative to that
/// of the solid around it. If solids overlap without one containing the other, the one that was entered last counts.
#[derive(Clone, Debug, Default)]
pub(crate) struct MediumStack<'s> {
    around: SmallVec<[Entered<'s>; 2]>,
    /// The wavelengths of the channels, unless these are linear Rec. 709.
    wavelengths: Option<Wavelengths>,
}

/// A solid, at a surface of it.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Solid<'s> {
    /// The material of the surface, which all surfaces of the solid have.
    pub(crate) id: MaterialId,
    /// Which of its materials this is, if it is a mixture.
    pub(crate) material: &'s Material,
}

impl<'s> Solid<'s> {
    /// The solid of a surface whose material resolves to this one.
    pub(crate) fn new(here: &Interaction<'s>, material: &'s Material) -> Self {
        Self { id: here.material_id, material }
    }
}

/// A solid around a point.
#[derive(Clone, Copy, Debug)]
struct Entered<'s> {
    solid: Solid<'s>,
    /// The scattering medium, as it was where the path entered.
    medium: Option<HomogeneousMedium>,
}

impl Entered<'_> {
    fn is(&self, solid: Solid<'_>) -> bool {
        self.solid.id == solid.id
    }

    /// σ of the law of Beer and Lambert.
    fn attenuation(&self, wavelengths: Option<&Wavelengths>) -> Option<Spectrum> {
        let of_medium = self.medium.map(|medium| medium.extinction);
        of_medium.or_else(|| self.solid.material.interior_attenuation(wavelengths))
    }
}

impl<'s> MediumStack<'s> {
    /// An empty stack, for light of some wavelengths or in RGB.
    pub(crate) fn of(wavelengths: Option<Wavelengths>) -> Self {
        Self { around: SmallVec::new(), wavelengths }
    }

    /// How light looks up spectra here.
    pub(crate) fn spectral(&self) -> Option<SpectralLookup> {
        Some(SpectralLookup { wavelengths: self.wavelengths?, is_unbounded: false })
    }

    /// Arrives at a surface with this material. A solid that is met from inside but was never entered contains the
    /// start of the path; before that, it is unknown.
    pub(crate) fn arrive(&mut self, here: &Interaction<'s>, material: Option<&'s Material>) {
        if let Some(material) = material.filter(|material| !here.front && material.is_solid())
            && !self.around.iter().any(|around| around.solid.id == here.material_id)
        {
            let solid = Solid::new(here, material);
            self.around.insert(0, Entered { solid, medium: material.interior_medium(&here.at) });
        }
    }

    /// The scattering medium of the innermost solid.
    pub(crate) fn medium(&self) -> Option<HomogeneousMedium> {
        self.around.last().and_then(|solid| solid.medium)
    }

    /// The transmittance of a distance inside the innermost solid.
    pub(crate) fn transmittance(&self, distance: f64) -> Spectrum {
        let sigma = self.around.last().and_then(|solid| solid.attenuation(self.wavelengths.as_ref()));
        sigma.map_or(Spectrum::WHITE, |sigma| {
            sigma.map(|sigma| (-f64::from(sigma) * distance).exponential() as f32)
        })
    }

    /// Whether there is no solid.
    pub(crate) fn is_empty(&self) -> bool {
        self.around.is_empty()
    }

    /// Whether light is attenuated here.
    pub(crate) fn attenuates(&self) -> bool {
        self.around.last().is_some_and(|solid| solid.attenuation(self.wavelengths.as_ref()).is_some())
    }

    /// Crosses a surface, into the solid behind it or out of it.
    pub(crate) fn cross(&mut self, solid: Solid<'s>, inwards: bool) {
        if !solid.material.is_solid() {
            return;
        }
        if inwards {
            self.push(solid, None);
        } else if let Some(place) = self.around.iter().rposition(|around| around.is(solid)) {
            self.around.remove(place);
        }
    }

    /// Crosses a surface into a solid with this scattering medium.
    pub(crate) fn enter(&mut self, solid: Solid<'s>, medium: HomogeneousMedium) {
        self.push(solid, Some(medium));
    }

    fn push(&mut self, solid: Solid<'s>, medium: Option<HomogeneousMedium>) {
        // Open meshes may be entered repeatedly and never left.
        if self.around.len() < 64 {
            self.around.push(Entered { solid, medium });
        }
    }

    /// The index of refraction outside a solid whose surface the path is at.
    pub(crate) fn index_outside(&self, solid: Solid<'_>, from_outside: bool) -> f32 {
        let mut outer = self.around.iter().rev();
        let around = if from_outside {
            outer.next()
        } else {
            let mut is_left = false;
            outer.find(|around| {
                let this = !is_left && around.is(solid);
                is_left |= this;
                !this
            })
        };
        around.and_then(|around| around.solid.material.interior_index()).unwrap_or(1.0)
    }
}
