//! Shading: samples a light and a new direction at each vertex. Nothing is traced here.

use std::marker::PhantomData;

use lumbre_math::DVec3;
use lumbre_scene::light::Sampling;
use lumbre_scene::light::lanes::{LaneLightSample, Receiver};
use lumbre_shading::lanes::{LaneBsdf, LaneSample};
use lumbre_simd::{Double, Job, Mask, Real, UInt, V3};

use crate::caustics::radius;
use crate::transport::Strategy;
use crate::transport::sampler::LaneNumbers;
use crate::wave::lights::{at_wavelengths, pass_solids, push_panes};
use crate::wave::paths::{Departure, Paths, SCATTERED, Slots};
use crate::wave::setting::{Setting, TerminatorSegment, power_heuristic};
use crate::wave::shadows::{NEARLY_WHOLE, Segment, Shadows};
use crate::wave::traced::Traced;
use crate::wave::vertices::{
    FOLDS, HAS_TERMINATOR_OFFSET, LIT_FROM_BELOW, Place, SIDED, Vertices, gather3, gather64,
};

/// BSDFs of one kind, for any number of lanes.
pub(crate) trait Kind {
    type Bsdf<R: Real>: LaneBsdf<R>;
}

/// Shades the vertices of a queue. Appends continuing paths to `next`, and segments to lights to `shadows`.
pub(crate) struct Shade<'a, 's> {
    pub(crate) setting: &'a Setting<'s>,
    pub(crate) slots: &'a Slots<'s>,
    pub(crate) paths: &'a Paths,
    pub(crate) vertices: &'a Vertices<'s>,
    /// Indices of vertices, padded to a full vector.
    pub(crate) queue: &'a [u32],
    pub(crate) count: usize,
    pub(crate) next: &'a mut Paths,
    /// Segments from the faces to the origins of rays of `next`, for rays that start on a smooth surface.
    pub(crate) terminator_segments: &'a mut Vec<TerminatorSegment>,
    pub(crate) shadows: &'a mut Shadows<'s>,
    /// Vertices whose paths cross the surface, in scenes with solids or media.
    pub(crate) crossings: &'a mut Vec<u32>,
    /// Whether rays are rounded to single precision.
    pub(crate) is_single: bool,
    /// The journal of a wave of one path, if requested.
    pub(crate) traced: Option<&'a mut Traced>,
}

/// [`Shade`] with BSDFs of one kind, for any instruction set.
pub(crate) struct ShadeKind<'a, 'b, 's, K> {
    pub(crate) shade: &'b mut Shade<'a, 's>,
    pub(crate) kind: PhantomData<K>,
}

impl<K: Kind> Job for ShadeKind<'_, '_, '_, K> {
    type Output = ();

    #[inline(always)]
    fn run<R: Real>(self) {
        self.shade.run::<R, K::Bsdf<R>>();
    }
}

/// A surface as seen along a path, ready to scatter.
///
/// A shading normal differs from the surface's normal, so some directions that a BSDF reflects to are below the true
/// surface. They are folded back: mirrored in the plane of the surface. Transmitted directions likewise stay on the far
/// side. So no energy of the BSDF is lost (a white surface stays white for any normals), and no light leaks. A
/// reflection that would point into the surface at a grazing angle points out of it by as much. Others leave such
/// directions as they are (and get dark specks at silhouettes of coarse meshes), or turn the normal: A. Keller and
/// others, "The Iray Light Transport Simulation and Rendering System", 2017, A.3.
///
/// If the faces of a mesh approximate a smooth surface that bulges out over them, directions below a face but above
/// that surface stay as they are, and their rays start on it. So shadows end where the smooth surface turns away from
/// the light, not at the edge of a face. J. Hanika ("Hacking the Shadow Terminator", 2021) starts all rays there; here
/// only rays below the face do. An object between the face and the smooth surface blocks such a ray; this
/// stretch, the terminator segment, is tested separately.
#[derive(Clone, Copy)]
pub(super) struct Vertex<R: Real> {
    place: Place<R>,
    /// The normal for which lights are sampled.
    receiver_normal: V3<R>,
    /// The shading frame.
    s: V3<R>,
    t: V3<R>,
    n: V3<R>,
    /// To the viewer, in the frame.
    wo: V3<R>,
    /// [`FOLDS`], [`SIDED`] and [`HAS_TERMINATOR_OFFSET`].
    folds: R::Mask,
    sided: R::Mask,
    has_terminator_offset: R::Mask,
    /// See [`Vertices::smooth_normal`].
    smooth_normal: V3<R>,
    terminator_origin: V3<R::Double>,
}

/// f · |cos θ| for a direction, and the density with which the BSDF chooses it.
#[derive(Clone, Copy)]
pub(super) struct Scattered<R: Real> {
    pub(super) f: V3<R>,
    pub(super) pdf: R,
}

#[inline(always)]
fn none<R: Real>() -> R::Mask {
    R::Mask::splat(false)
}

#[inline(always)]
fn xnor<R: Real>(a: R::Mask, b: R::Mask) -> R::Mask {
    (a & b) | !(a | b)
}

#[inline(always)]
fn mirrored<R: Real>(w: V3<R>, normal: V3<R>) -> V3<R> {
    w - normal * (R::splat(2.0) * normal.dot(w))
}

impl<R: Real> Vertex<R> {
    #[inline(always)]
    pub(super) fn new(vertices: &Vertices<'_>, at: R::UInt, towards: V3<R>) -> Self {
        let flags = R::UInt::gather(&vertices.flags, at);
        let folds = has::<R>(flags, FOLDS);
        let has_terminator_offset = has::<R>(flags, HAS_TERMINATOR_OFFSET);
        let (s, n) = (gather3::<R>(&vertices.frame_s, at), gather3::<R>(&vertices.frame_n, at));
        let t = n.cross(s);
        let place = vertices.place(at);
        let (mut smooth_normal, mut terminator_origin) = (n, place.point);
        if has_terminator_offset.any() {
            smooth_normal = gather3(&vertices.smooth_normal, at);
            terminator_origin = gather64::<R>(&vertices.terminator_origin, at);
        }
        let wo = V3 { x: s.dot(towards), y: t.dot(towards), z: n.dot(towards) };
        let receiver_normal = place.normal.or_zero(!has::<R>(flags, LIT_FROM_BELOW));
        Self {
            place,
            receiver_normal,
            s,
            t,
            n,
            wo,
            folds,
            sided: has::<R>(flags, SIDED),
            has_terminator_offset,
            smooth_normal,
            terminator_origin,
        }
    }

    #[inline(always)]
    fn to_local(self, w: V3<R>) -> V3<R> {
        V3 { x: self.s.dot(w), y: self.t.dot(w), z: self.n.dot(w) }
    }

    #[inline(always)]
    fn to_world(self, w: V3<R>) -> V3<R> {
        self.s * w.x + self.t * w.y + self.n * w.z
    }

    /// Whether a direction of the frame is on the viewer's side of the shading normal.
    #[inline(always)]
    fn on_side(&self, local: V3<R>) -> R::Mask {
        R::zero().simd_lt(self.wo.z * local.z)
    }

    /// Whether the smooth surface reflects to a direction below the face.
    #[inline(always)]
    fn stays(&self, wi: V3<R>, local: V3<R>) -> R::Mask {
        let below = self.place.normal.dot(wi).simd_le(R::zero());
        self.has_terminator_offset
            & below
            & R::zero().simd_lt(self.smooth_normal.dot(wi))
            & self.on_side(local)
    }

    /// What the BSDF scatters to a world direction, directly and by folded directions.
    #[inline(always)]
    pub(super) fn eval<B: LaneBsdf<R>>(&self, bsdf: &B, wi: V3<R>) -> Scattered<R> {
        let local = self.to_local(wi);
        let (f, pdf) = bsdf.eval(self.wo, local);
        if self.folds.none() {
            return Scattered { f, pdf };
        }
        let above = R::zero().simd_lt(self.place.normal.dot(wi));
        let stays = self.stays(wi, local);
        let own = !self.folds | xnor::<R>(self.on_side(local), above | stays);
        let mirrored = mirrored(wi, self.place.normal);
        let image = self.to_local(mirrored);
        let folded = self.folds & xnor::<R>(self.on_side(image), above) & !self.stays(mirrored, image);
        let (image_f, image_pdf) = bsdf.eval(self.wo, image);
        Scattered {
            f: f.or_zero(own) + image_f.or_zero(folded),
            pdf: pdf.or_zero(own) + image_pdf.or_zero(folded),
        }
    }

    /// The world direction of a sample.
    #[inline(always)]
    fn leave(&self, sample: &LaneSample<R>) -> V3<R> {
        let direction = self.to_world(sample.wi);
        if self.folds.none() {
            return direction.normalize();
        }
        let above = R::zero().simd_lt(self.place.normal.dot(direction));
        let stays = self.stays(direction, sample.wi);
        let folds = self.folds & xnor::<R>(above, sample.transmitted) & (sample.transmitted | !stays);
        V3::select(folds, mirrored(direction, self.place.normal), direction).normalize()
    }

    /// The origin of a ray in this direction, and whether it is on the smooth surface over the face.
    #[inline(always)]
    fn start(&self, wi: V3<R>) -> (V3<R::Double>, R::Mask) {
        let start = self.place.start(wi);
        if self.has_terminator_offset.none() {
            return (start, none::<R>());
        }
        let stays = self.folds & self.stays(wi, self.to_local(wi));
        (select64::<R>(stays, self.terminator_origin, start), stays)
    }

    /// Whether a direction leads to the other side of the surface, and whether the BSDF transmits.
    #[inline(always)]
    fn crosses(&self, wi: V3<R>, transmitted: R::Mask) -> R::Mask {
        let below = self.place.normal.dot(wi).simd_lt(R::zero());
        (self.sided & below) | (!self.sided & transmitted)
    }
}

#[inline(always)]
fn has<R: Real>(flags: R::UInt, flag: u32) -> R::Mask {
    (flags & R::UInt::splat(flag)).simd_eq(R::UInt::splat(flag))
}

#[inline(always)]
fn select64<R: Real>(mask: R::Mask, a: V3<R::Double>, b: V3<R::Double>) -> V3<R::Double> {
    V3 {
        x: R::Double::select(mask, a.x, b.x),
        y: R::Double::select(mask, a.y, b.y),
        z: R::Double::select(mask, a.z, b.z),
    }
}

/// Whether a colour is not black; true for NaN, which the film reports.
#[inline(always)]
fn is_light<R: Real>(colour: V3<R>) -> R::Mask {
    !(colour.x + colour.y + colour.z).simd_le(R::zero())
}

/// The lanes of a chunk of the queue.
#[derive(Clone, Copy)]
struct Arrived<R: Real> {
    /// The index of the vertex, and that of its path.
    vertex_at: R::UInt,
    at: R::UInt,
    slot: R::UInt,
    depth: R::UInt,
    throughput: V3<R>,
    vertex: Vertex<R>,
}

impl<'s> Shade<'_, 's> {
    /// Shades the whole queue.
    #[inline(always)]
    fn run<R: Real, B: LaneBsdf<R>>(&mut self) {
        let mut done = 0;
        while done < self.count {
            let lanes = R::Mask::first(self.count - done);
            let vertex_at = R::UInt::from_slice(&self.queue[done..]);
            let at = R::UInt::gather(&self.vertices.path, vertex_at);
            done += R::LANES;
            let paths = self.paths;
            let slot = R::UInt::gather(&paths.slot, at);
            let towards = -gather3::<R>(&paths.direction, at);
            let arrived = Arrived {
                vertex_at,
                at,
                slot,
                depth: R::UInt::gather(&paths.depth, at) & R::UInt::splat(!SCATTERED),
                throughput: gather3(&paths.throughput, at),
                vertex: Vertex::new(self.vertices, vertex_at, towards),
            };
            let numbers = LaneNumbers::<R> {
                kind: self.setting.sampler,
                pixel: [
                    R::UInt::gather(&self.slots.pixel[0], slot),
                    R::UInt::gather(&self.slots.pixel[1], slot),
                ],
                index: R::UInt::gather(&self.slots.index, slot),
            };
            let bsdf: B = self.vertices.rows.load(R::UInt::gather(&self.vertices.bsdf, vertex_at));
            let useful = lanes & !bsdf.is_delta();
            if useful.any() {
                self.sample_light(useful, &arrived, &bsdf, numbers.light(arrived.depth));
            }
            self.scatter(lanes, &arrived, &bsdf, numbers.scatter(arrived.depth));
        }
    }

    /// Samples one light.
    #[inline(always)]
    fn sample_light<R: Real, B: LaneBsdf<R>>(
        &mut self,
        useful: R::Mask,
        arrived: &Arrived<R>,
        bsdf: &B,
        u: [R; 4],
    ) {
        let vertex = &arrived.vertex;
        let scene = self.setting.scene;
        let receiver = Receiver {
            from: vertex.place.start(vertex.place.normal),
            normal: vertex.receiver_normal,
            time: self.setting.moves.then_some(R::Double::gather(&self.slots.time, arrived.slot)),
        };
        let sampling = match self.setting.strategy {
            Strategy::Lights => Sampling::LightsOnly,
            Strategy::Both | Strategy::Bsdf => Sampling::Mis,
        };
        let mut light: LaneLightSample<R> =
            scene.lane_lights().sample(useful, &receiver, [u[2], u[0], u[1], u[3]], sampling);
        if self.setting.is_spectral {
            light.radiance = at_wavelengths(self, useful & light.valid, arrived.slot, &light);
        }
        let Scattered { f, pdf: bsdf_pdf } = vertex.eval(bsdf, light.towards);
        let weight = match self.setting.strategy {
            Strategy::Both => power_heuristic(light.pdf, bsdf_pdf),
            Strategy::Lights => R::one(),
            Strategy::Bsdf => R::zero(),
        };
        let weight = R::select(light.delta, R::one(), weight);
        let weight_over_pdf = R::select(light.delta, R::one(), weight / light.pdf);
        let value = f * light.radiance;
        let mut arriving = arrived.throughput * (value * weight_over_pdf);
        let found = useful & light.valid & is_light(value) & !weight_over_pdf.simd_le(R::zero());
        let (start, stays) = vertex.start(light.towards);
        let crosses = vertex.crosses(light.towards, !vertex.on_side(vertex.to_local(light.towards)));
        let through_panes = found & light.delta & R::Mask::splat(self.setting.has_panes);
        if self.setting.has_solids && found.any() {
            // Light through panes is recorded with the panes.
            let through_air = found & !through_panes;
            let at = arrived.vertex_at;
            arriving = pass_solids(self, through_air, at, arrived.slot, crosses, &light, arriving);
        }
        let error = self.setting.rounding(self.is_single).grow::<R>(light.point, light.error);
        let end = Place::<R>::new(light.point, error, light.normal).start(-light.towards);
        let infinite = light.infinite;
        let segment = Segment {
            slot: arrived.slot,
            origin: start,
            to_light: select64::<R>(infinite, light.towards.to_double(), end - start),
            end: R::Double::select(infinite, R::Double::splat(f64::INFINITY), R::Double::splat(NEARLY_WHOLE)),
            contribution: arriving,
        };
        if let Some(traced) = &mut self.traced {
            traced.light(found, &light, f, bsdf_pdf, weight, &segment);
        }
        if !found.any() {
            return;
        }
        let first = self.shadows.len;
        if self.setting.has_media {
            let [before, behind] = &self.vertices.media;
            let at = arrived.vertex_at;
            let medium = R::UInt::select(crosses, R::UInt::gather(behind, at), R::UInt::gather(before, at));
            medium.compress_store(found, &mut self.shadows.medium[first..]);
        }
        self.shadows.push(found, &segment);
        if (found & stays).any() {
            push_terminator_segments::<R>(
                &mut self.shadows.terminator_segments,
                first,
                found,
                found & stays,
                receiver.from,
            );
        }
        if through_panes.any() {
            push_panes(self, first, found, through_panes, arrived.vertex_at, arrived.slot, crosses, &light);
        }
    }

    /// Samples the next direction.
    #[inline(always)]
    fn scatter<R: Real, B: LaneBsdf<R>>(
        &mut self,
        lanes: R::Mask,
        arrived: &Arrived<R>,
        bsdf: &B,
        u: [R; 4],
    ) {
        let (vertex, at) = (&arrived.vertex, arrived.at);
        let sample = bsdf.sample(vertex.wo, u[2], [u[0], u[1]]);
        let direction = vertex.leave(&sample);
        let mut pdf = sample.pdf;
        if vertex.folds.any() {
            let folded = vertex.eval(bsdf, direction).pdf;
            // On the border between the sides, rounding may leave no strategy at all.
            pdf = R::select(vertex.folds & R::zero().simd_lt(folded), folded, pdf);
        }
        let pdf = R::select(sample.delta, R::splat(f32::INFINITY), pdf);
        let mut throughput = arrived.throughput * sample.weight;
        let eta_scale = R::gather(&self.paths.eta_scale, at);
        let eta_scale = R::select(sample.transmitted, eta_scale * sample.eta * sample.eta, eta_scale);
        let goes_on = lanes & sample.valid & is_light(throughput);

        let depth = arrived.depth + R::UInt::splat(1);
        let survival = throughput.max_component() * eta_scale;
        let plays_roulette =
            R::UInt::splat(self.setting.roulette_start).simd_lt(depth) & survival.simd_lt(R::one());
        let survives = goes_on & (!plays_roulette | u[3].simd_lt(survival));
        throughput = V3::select(plays_roulette, throughput * survival.recip(), throughput);

        let scattered = R::UInt::gather(&self.paths.depth, at) & R::UInt::splat(SCATTERED);
        let scattered = R::UInt::select(sample.delta, scattered, R::UInt::splat(SCATTERED));
        let (origin, stays) = vertex.start(direction);
        let (receiver_normal, merge_pdf) = self.receiver_and_merge_pdf(arrived, sample.delta, pdf);
        let path = Departure {
            slot: arrived.slot,
            origin,
            receiver_normal,
            direction,
            throughput,
            eta_scale,
            pdf,
            merge_pdf,
            depth: depth | scattered,
            width: R::gather(&self.vertices.width, arrived.vertex_at),
            spread: R::gather(&self.vertices.spread, arrived.vertex_at),
        };
        if let Some(traced) = &mut self.traced {
            traced.scattered(goes_on, plays_roulette, survives, survival, &sample, &path);
        }
        if !survives.any() {
            return;
        }
        let first = self.next.len;
        self.next.push(survives, &path);
        if (survives & stays).any() {
            let from = vertex.place.start(vertex.place.normal);
            push_terminator_segments::<R>(self.terminator_segments, first, survives, survives & stays, from);
        }
        if self.setting.has_solids || self.setting.has_media {
            let crosses = survives & vertex.crosses(direction, sample.transmitted);
            push_crossings::<R>(self.crossings, crosses, arrived.vertex_at);
        }
    }
}

impl Shade<'_, '_> {
    /// [`Paths::receiver_normal`] and [`Paths::merge_pdf`] of the next ray. Photons reach specular surfaces from every
    /// side, so after one of these the receiver has no normal.
    #[inline(always)]
    fn receiver_and_merge_pdf<R: Real>(&self, arrived: &Arrived<R>, delta: R::Mask, pdf: R) -> (V3<R>, R) {
        let Some(merging) = &self.setting.merging else {
            return (arrived.vertex.receiver_normal, R::splat(f32::INFINITY));
        };
        let flags = R::UInt::gather(&self.paths.depth, arrived.at) & R::UInt::splat(SCATTERED);
        let has_scattered = !flags.simd_eq(R::UInt::splat(0));
        let width = R::gather(&self.vertices.width, arrived.vertex_at);
        let radius = radius::<R>(R::gather(&self.slots.widths, arrived.slot), width, has_scattered);
        let own = pdf * merging.spread(radius);
        let receiver_normal = arrived.vertex.receiver_normal.or_zero(!delta);
        (receiver_normal, R::select(delta, R::gather(&self.paths.merge_pdf, arrived.at), own))
    }
}

/// Records the terminator segments of rays for the lanes of `some`; the rays of the lanes `all` were appended from
/// index `first` on.
#[inline(always)]
fn push_terminator_segments<R: Real>(
    segments: &mut Vec<TerminatorSegment>,
    first: usize,
    all: R::Mask,
    some: R::Mask,
    from: V3<R::Double>,
) {
    let (all, mut some) = (all.to_bitmask(), some.to_bitmask());
    let from = [from.x.to_lanes(), from.y.to_lanes(), from.z.to_lanes()];
    while some != 0 {
        let lane = some.trailing_zeros() as usize;
        some &= some - 1;
        let before = (all & ((1 << lane) - 1)).count_ones();
        let from = DVec3::new(from[0][lane], from[1][lane], from[2][lane]);
        segments.push(TerminatorSegment { ray: first as u32 + before, from });
    }
}

/// Records which paths cross a surface.
#[inline(always)]
fn push_crossings<R: Real>(crossings: &mut Vec<u32>, mask: R::Mask, at: R::UInt) {
    let at = at.to_lanes();
    let mut bits = mask.to_bitmask();
    while bits != 0 {
        crossings.push(at[bits.trailing_zeros() as usize]);
        bits &= bits - 1;
    }
}
