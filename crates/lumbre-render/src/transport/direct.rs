//! A surface as a path meets it, and direct light there.

use std::cell::OnceCell;

use lumbre_geometry::Ray;
use lumbre_math::{DVec3, Vec2, Vec3};
use lumbre_scene::{Interaction, LightSample, Scene};
use lumbre_shading::{Bsdf, LocalDir, Material, Scatter, ShadingFrame, ShadingNormals, Spectrum};

use crate::transport::Record;
use crate::transport::interior::{MediumStack, Solid};
use crate::transport::through::straight_on;

/// A surface as seen along a path, ready to scatter.
///
/// A shading normal differs from the surface's normal, so a sampled direction may lie below the true surface. It is
/// folded back: mirrored in the plane of the surface. Transmitted directions likewise stay on the far side. So no
/// energy of the BSDF is lost (a white surface stays white for any normals), and no light leaks. A reflection that
/// would point into the surface at a grazing angle points out of it by as much. Others leave such directions as they
/// are (and get dark specks at silhouettes of coarse meshes), or turn the normal: A. Keller and others, "The Iray Light
/// Transport Simulation and Rendering System", 2017, A.3.
///
/// If the faces of a mesh approximate a smooth surface that bulges out over them, directions below a face but above
/// that surface are valid: they stay as they are, and their rays start on it
/// ([`Scene::unoccluded_terminator_origin`]). So shadows end where the smooth surface turns away from the light,
/// not at the edge of a face. J. Hanika ("Hacking the Shadow Terminator", 2021) starts all rays there. Here only rays
/// below the face do, so that objects on the surface do not seem to hover.
///
/// [`ShadingNormals::Pbrt`] turns all of this off.
pub(crate) struct Vertex<'a, 's> {
    pub met: &'a Interaction<'s>,
    pub bsdf: Bsdf,
    pub material: &'s Material,
    frame: ShadingFrame,
    wo: LocalDir,
    /// The geometric normal on the side of `wo`, in whose plane directions are folded; `None` if it equals the shading
    /// normal, and in pbrt's mode.
    geometric: Option<Vec3>,
    /// That normal, if it only decides the side of a direction, as in pbrt.
    side: Option<Vec3>,
    scene: &'s Scene,
    /// [`Scene::unoccluded_terminator_origin`], computed on demand.
    terminator_origin: OnceCell<Option<DVec3>>,
}

/// The next direction of a path.
pub(crate) struct Bounce {
    /// Unit.
    pub direction: DVec3,
    /// f · |cos θ| / pdf.
    pub weight: Spectrum,
    /// How it was chosen; the density counts every strategy for the same direction.
    pub scatter: Scatter,
    /// Whether the BSDF transmits it.
    pub transmitted: bool,
    /// Whether it leads to the other side of the surface.
    pub crosses: bool,
    /// η of the side that it enters over that of the side that it leaves.
    pub eta: f32,
}

impl<'a, 's> Vertex<'a, 's> {
    /// `None` if nothing scatters.
    pub(crate) fn new(
        scene: &'s Scene,
        met: &'a Interaction<'s>,
        interiors: &MediumStack<'s>,
        normals: ShadingNormals,
    ) -> Option<Self> {
        Self::of(scene, met, met.resolved()?, interiors, normals)
    }

    /// One vertex for each material of a mixture, with its share: see [`Interaction::parts`].
    pub(crate) fn parts(
        scene: &'s Scene,
        met: &'a Interaction<'s>,
        least: f32,
        interiors: &'a MediumStack<'s>,
        normals: ShadingNormals,
    ) -> impl Iterator<Item = (f32, Self)> {
        let parts = met.parts(least);
        parts.filter_map(move |(share, material)| {
            Some((share, Self::of(scene, met, material, interiors, normals)?))
        })
    }

    fn of(
        scene: &'s Scene,
        met: &'a Interaction<'s>,
        material: &'s Material,
        interiors: &MediumStack<'s>,
        normals: ShadingNormals,
    ) -> Option<Self> {
        let towards = met.towards_origin.as_vec3();
        let (frame, mut bsdf) = material.shading(&met.at, &met.shading, towards, normals)?;
        if material.is_solid() {
            let outside = interiors.index_outside(Solid::new(met, material), met.front);
            if outside != 1.0 {
                bsdf = bsdf.immersed(outside);
            }
        }
        let wo = frame.to_local(towards);
        let geometric = met.shading.geometric;
        let side = ShadingNormals::differ(frame.n, geometric)
            .then(|| if met.front { geometric } else { -geometric });
        let (geometric, side) = match normals {
            ShadingNormals::Lumbre => (side, None),
            ShadingNormals::Pbrt => (None, side),
        };
        let terminator_origin = OnceCell::new();
        Some(Self { met, bsdf, material, frame, wo, geometric, side, scene, terminator_origin })
    }

    /// The solid whose surface it is on.
    pub(crate) fn solid(&self) -> Solid<'s> {
        Solid::new(self.met, self.material)
    }

    /// Whether the BSDF reflects to a direction.
    fn reflects(&self, wi: Vec3) -> bool {
        match self.geometric {
            Some(normal) => normal.dot(wi) > 0.0 || self.stays(wi),
            None => self.wo.same_hemisphere(self.frame.to_local(wi)),
        }
    }

    /// Whether the smooth surface reflects to a direction below the plane of the face.
    fn stays(&self, wi: Vec3) -> bool {
        let Some(geometric) = self.geometric.filter(|_| self.met.has_terminator_offset()) else {
            return false;
        };
        let smooth = self.met.shading.normal;
        let smooth = if smooth.dot(geometric) < 0.0 { -smooth } else { smooth };
        geometric.dot(wi) <= 0.0
            && smooth.dot(wi) > 0.0
            && self.wo.same_hemisphere(self.frame.to_local(wi))
            && self.terminator_origin().is_some()
    }

    fn terminator_origin(&self) -> Option<DVec3> {
        *self.terminator_origin.get_or_init(|| self.scene.unoccluded_terminator_origin(self.met))
    }

    /// The BSDF directions that map to this one: itself, and the one that is folded onto it.
    fn unfolded(&self, wi: Vec3) -> [Option<LocalDir>; 2] {
        let is_above = self.geometric.is_none_or(|normal| normal.dot(wi) > 0.0);
        let reflects = self.reflects(wi);
        let own = self.frame.to_local(wi);
        let own = (self.wo.same_hemisphere(own) == reflects).then_some(own);
        let folded = self.geometric.map(|normal| mirrored(wi, normal)).and_then(|wi| {
            let folded = self.frame.to_local(wi);
            (self.wo.same_hemisphere(folded) == is_above && !self.stays(wi)).then_some(folded)
        });
        [own, folded]
    }

    /// f · |cos θ| for a unit direction of the world.
    pub(crate) fn eval(&self, wi: DVec3) -> Spectrum {
        self.eval_unfolded(self.unfolded(wi.as_vec3()))
    }

    fn eval_unfolded(&self, unfolded: [Option<LocalDir>; 2]) -> Spectrum {
        unfolded.into_iter().flatten().map(|wi| self.bsdf.eval(self.wo, wi)).sum()
    }

    /// The density with which [`Vertex::sample`] chooses a unit direction of the world, without delta parts.
    pub(crate) fn pdf(&self, wi: DVec3) -> f32 {
        self.pdf_unfolded(self.unfolded(wi.as_vec3()))
    }

    fn pdf_unfolded(&self, unfolded: [Option<LocalDir>; 2]) -> f32 {
        unfolded.into_iter().flatten().map(|wi| self.bsdf.pdf(self.wo, wi)).sum()
    }

    /// Samples the next direction.
    pub(crate) fn sample(&self, lobe: f32, u: Vec2) -> Option<Bounce> {
        let sample = self.bsdf.sample(self.wo, lobe, u)?;
        let mut bounce = self.bounce(&sample);
        if let (Scatter::Density(_), Some(_)) = (sample.scatter, self.geometric) {
            let pdf = self.pdf(bounce.direction);
            // On the border between the sides, rounding may leave no strategy at all.
            if pdf > 0.0 {
                bounce.scatter = Scatter::Density(pdf);
            }
        }
        Some(bounce)
    }

    /// All delta parts: mirrors and smooth glass.
    pub(crate) fn specular(&self) -> impl Iterator<Item = Bounce> {
        self.bsdf.specular(self.wo).map(|sample| self.bounce(&sample))
    }

    fn bounce(&self, sample: &lumbre_shading::BsdfSample) -> Bounce {
        let mut direction = self.frame.to_world(sample.wi);
        if let Some(normal) = self.geometric
            && (normal.dot(direction) > 0.0) == sample.transmitted
            && (sample.transmitted || !self.stays(direction))
        {
            direction = mirrored(direction, normal);
        }
        Bounce {
            direction: direction.as_dvec3().normalize(),
            weight: sample.weight,
            scatter: sample.scatter,
            transmitted: sample.transmitted,
            crosses: self.side.map_or(sample.transmitted, |normal| normal.dot(direction) < 0.0),
            eta: sample.eta,
        }
    }

    /// By how much a specular bounce concentrates the power of light from `wo`. Light is refracted by the shading
    /// normal, but falls on the surface by the geometric normal.
    ///
    /// E. Veach, "Robust Monte Carlo Methods for Light Transport Simulation", 1997, 5.3.2.
    pub(crate) fn concentration(&self, wi: DVec3) -> f32 {
        let normal = self.met.shading.geometric;
        if !ShadingNormals::differ(self.frame.n, normal) {
            return 1.0;
        }
        let (wo, wi) = (self.met.towards_origin.as_vec3(), wi.as_vec3());
        let ratio = |w: Vec3| (w.dot(normal) / w.dot(self.frame.n)).abs();
        let concentration = ratio(wi) / ratio(wo);
        if concentration.is_finite() { concentration } else { 0.0 }
    }

    /// The share of light from straight behind that passes without a change of direction: see [`Bsdf::straight_on`].
    pub(crate) fn straight_on(&self) -> Spectrum {
        self.bsdf.straight_on(self.wo)
    }

    /// The origin of rays in a unit direction, if it is off the face.
    pub(crate) fn terminator_origin_towards(&self, direction: DVec3) -> Option<DVec3> {
        if self.stays(direction.as_vec3()) { self.terminator_origin() } else { None }
    }

    fn start(&self, direction: DVec3) -> DVec3 {
        self.terminator_origin_towards(direction).unwrap_or_else(|| self.met.start(direction))
    }

    /// The ray of a bounce.
    pub(crate) fn leave(&self, bounce: &Bounce) -> Ray {
        self.met.leave_from(self.start(bounce.direction), bounce.direction)
    }

    /// See [`Interaction::shadow_ray`].
    pub(crate) fn shadow_ray(&self, sample: &LightSample) -> Ray {
        self.met.shadow_ray_from(self.start(sample.towards), sample)
    }

    /// The share of an unoccluded light sample that the solids around transmit.
    pub(crate) fn passes(&self, sample: &LightSample, interiors: &MediumStack<'s>) -> Spectrum {
        // Light from infinity was not inside any solid.
        let Some(end) = sample.end else { return Spectrum::WHITE };
        let crosses = self.crosses(sample);
        if !crosses && !interiors.attenuates() {
            return Spectrum::WHITE;
        }
        let around = self.around(crosses, interiors);
        around.transmittance((end.point - self.met.surface.point).length())
    }

    /// The share of a light sample that reaches the point: see [`straight_on`].
    pub(crate) fn passes_straight_on(
        &self,
        sample: &LightSample,
        interiors: &MediumStack<'s>,
        regularize: bool,
        record: &mut Record,
    ) -> Spectrum {
        let around = self.around(self.crosses(sample), interiors);
        straight_on(self.scene, self.shadow_ray(sample), sample, around, regularize, false, record)
    }

    /// Whether a light sample arrives through the solid of this surface.
    fn crosses(&self, sample: &LightSample) -> bool {
        let wi = sample.towards.as_vec3();
        self.material.is_solid()
            && self.side.map_or_else(|| !self.reflects(wi), |normal| normal.dot(wi) < 0.0)
    }

    /// The solids around the point, on either side of its surface.
    fn around(&self, crosses: bool, interiors: &MediumStack<'s>) -> MediumStack<'s> {
        let mut interiors = interiors.clone();
        if crosses {
            interiors.cross(self.solid(), self.met.front);
        }
        interiors
    }
}

fn mirrored(w: Vec3, normal: Vec3) -> Vec3 {
    w - normal * (2.0 * normal.dot(w))
}
