//! Scene descriptions: plain data from a reader, without files, not resolved.

use std::sync::Arc;

use lumbre_geometry::{Curves, Shape};
use lumbre_image::Rgb;
use lumbre_kernel::{CustomGeometry, Placement};
use lumbre_math::{AnimatedTransform, DVec3, Transform, Vec2, Vec3, Vec4};
use lumbre_shading::medium::Medium;
use lumbre_shading::spectrum::{LightCurve, SensorCurves};
use lumbre_shading::{FURTHER_SETS, FloatTexture, Material, MipMap, ShadingNormals};

use crate::{Camera, Listing, MaterialId, MediumId, ObjectId};

/// A scene description.
#[derive(Clone, Debug, Default)]
pub struct SceneDesc {
    /// Cameras, the default first; if empty, an automatic one is used.
    pub cameras: Vec<Camera>,
    /// The picture's size, crop and exposure.
    pub film: FilmDesc,
    /// The pixel filter.
    pub filter: FilterDesc,
    /// The sampler.
    pub sampler: SamplerDesc,
    /// The integrator.
    pub integrator: IntegratorDesc,
    /// Materials; shapes refer to them by index.
    pub materials: Vec<NamedMaterial>,
    /// Participating media; shapes and cameras refer to them by index.
    pub media: Vec<Arc<Medium>>,
    /// Shapes in the world, in the order of the file.
    pub shapes: Vec<ShapeDesc>,
    /// Objects for instancing.
    pub objects: Vec<ObjectDesc>,
    /// Instances in the world.
    pub instances: Vec<InstanceDesc>,
    /// Lights other than shapes.
    pub lights: Vec<LightDesc>,
    /// The light to use if there is none at all, neither here nor on a shape.
    pub without_light: WithoutLight,
    /// The up axis of the automatic camera and light.
    pub up: UpAxis,
    /// Whether the up axis is a guess from the pose of the model.
    pub up_is_guessed: bool,
    /// The ground plane.
    pub ground: Option<GroundDesc>,
    /// The surroundings of a POV-Ray scene.
    pub pov: Option<Arc<crate::pov::PovWorld>>,
    /// The named items of its files.
    pub listing: Listing,
}

/// An infinite matte plane below everything.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct GroundDesc {
    /// A point of it.
    pub point: DVec3,
    /// The upward normal, of any non-zero length.
    pub normal: DVec3,
    /// The reflectance.
    pub reflectance: Rgb,
    /// Whether it is a shadow catcher: only the shadow on it is visible, over the background.
    pub catcher: bool,
}

/// The light of a description without lights.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum WithoutLight {
    /// Studio light, for a model alone.
    #[default]
    Studio,
    /// Studio light unless there are both a camera and lights other than surfaces: emissive parts of a model
    /// are seldom meant to light it, and a file without a camera is no complete scene.
    StudioUnlessStaged,
    /// None: a complete scene without light is black.
    Dark,
}

/// The up axis.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub enum UpAxis {
    /// y, as in most meshes (OBJ, PLY) and in glTF; the front is towards z.
    #[default]
    Y,
    /// z, as in most of engineering (STL); the front is towards -y.
    Z,
    /// Any direction, of any non-zero length; the front is that of y up, moved by the shortest rotation.
    Towards(DVec3),
}

/// A material with its name.
#[derive(Clone, Debug)]
pub struct NamedMaterial {
    /// The name, if the file gives one.
    pub name: Option<String>,
    /// The material.
    pub material: Arc<Material>,
}

impl NamedMaterial {
    /// Its label for people: its name and its kind, or the kind alone.
    pub fn label(&self) -> String {
        let kind = self.material.kind.name();
        self.name.as_ref().map_or_else(|| kind.to_owned(), |name| format!("{name} ({kind})"))
    }
}

/// A shape with its material.
#[derive(Clone, Debug)]
pub struct ShapeDesc {
    /// Its 0-based index among all shapes of its file, which identifies it in results.
    pub index: u32,
    /// Its geometry.
    pub geometry: GeometryDesc,
    /// Its placement.
    pub world_from_object: Transform,
    /// Whether inside and outside are swapped.
    pub reverse_orientation: bool,
    /// The material; `None` for an interface, which does not scatter.
    pub material: Option<MaterialId>,
    /// The media on its sides, if they differ; `None` if light stays in its medium.
    pub boundary: Option<Boundary>,
    /// The light it emits.
    pub area_light: Option<AreaLightDesc>,
    /// Alpha in [0, 1]; `None` is opaque.
    pub alpha: Option<Arc<FloatTexture>>,
}

/// The media on both sides of a surface; `None` is a vacuum.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Boundary {
    /// Behind the surface: the side that its normal points away from.
    pub inside: Option<MediumId>,
    /// In front of it.
    pub outside: Option<MediumId>,
}

/// The geometry of a shape.
#[derive(Clone, Debug)]
pub enum GeometryDesc {
    /// One exact shape.
    Exact(Shape),
    /// An exact shape with colours.
    Coloured(Box<ColouredShape>),
    /// Triangles and quads.
    Mesh(Arc<MeshDesc>),
    /// Bilinear patches (p00, p10, p01, p11 each) with shared vertices.
    BilinearMesh(Arc<MeshDesc>),
    /// CSG of solids, each surface with its own material.
    Csg(CsgDesc),
    /// Curves with a width: hair, fur, grass. Many of them are one shape.
    Curves(Arc<Curves>),
    /// Custom geometry of a program, such as a [`lumbre_geometry::ImplicitSurface`].
    Custom(Arc<dyn CustomGeometry>),
}

impl GeometryDesc {
    /// The name of its kind, in the scene language if that has one; `mesh` for the several ways to write a mesh.
    pub fn name(&self) -> &'static str {
        match self {
            Self::Exact(exact) => exact.name(),
            Self::Coloured(coloured) => coloured.shape.name(),
            Self::Mesh(_) => "mesh",
            Self::BilinearMesh(_) => "bilinearmesh",
            Self::Csg(_) => "csg",
            Self::Curves(_) => "curve",
            Self::Custom(_) => "custom",
        }
    }
}

/// An exact shape with vertex colours interpolated between two points, such as a thick line between two
/// vertices.
#[derive(Clone, Debug)]
pub struct ColouredShape {
    /// The shape.
    pub shape: Shape,
    /// The two points, in the space of the shape. If they coincide, the whole shape has the first colour.
    pub ends: [DVec3; 2],
    /// Linear colours at the points, constant beyond.
    pub colours: [Rgb; 2],
    /// Alphas at the points.
    pub coverages: [f32; 2],
}

/// Constructive solid geometry.
#[derive(Clone, Debug)]
pub struct CsgDesc {
    /// The operation.
    pub operation: CsgOperation,
    /// Two or more operands; each is the union of its shapes, with transforms relative to the CSG's own space. They
    /// are shared, so that nested CSG of the same objects takes no more memory than its file.
    pub operands: Vec<Arc<Vec<ShapeDesc>>>,
}

/// The operations on solids.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum CsgOperation {
    /// The points in any operand.
    Union,
    /// The points in all operands.
    Intersection,
    /// The points in the first operand and in no other.
    Difference,
}

/// A mesh as in a file. Every list has the length of `positions`, unless stated otherwise.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct MeshDesc {
    /// Vertices.
    pub positions: Vec<Vec3>,
    /// The same vertices in double precision, if rays are to meet the triangles there: see
    /// [`lumbre_kernel::PreciseMesh`]. Only for meshes of triangles that do not deform.
    pub precise_positions: Option<Vec<DVec3>>,
    /// Triangles, counter-clockwise from the front.
    pub triangles: Vec<[u32; 3]>,
    /// Quads, counter-clockwise from the front. (For a bilinear mesh, patches in their own order.)
    pub quads: Vec<[u32; 4]>,
    /// Shading normals.
    pub normals: Option<Vec<Vec3>>,
    /// Texture coordinates.
    pub uvs: Option<Vec<Vec2>>,
    /// Tangents, with the side of the bitangent of normal maps: 1 for normal × tangent, -1 for its opposite, in
    /// the mesh's own space (a mirror flips it); 0 for normal × tangent even under a mirror.
    pub tangents: Option<Vec<Vec4>>,
    /// The second, third and fourth uv set.
    pub further_uvs: FurtherUvs,
    /// Linear colours.
    pub colours: Option<Vec<Rgb>>,
    /// Alphas.
    pub coverages: Option<Vec<f32>>,
    /// A number for each face: triangles first, then quads.
    pub face_indices: Option<Vec<u32>>,
    /// Its deformation, if any; the vertices above are then those at some time. Its quads are split into
    /// triangles, flat or not, and its tangents do not change.
    pub motion: Option<MeshMotion>,
}

/// The second, third and fourth uv set of a mesh.
pub type FurtherUvs = [Option<Vec<Vec2>>; FURTHER_SETS];

/// The vertices of a deforming mesh, interpolated linearly between keys.
#[derive(Clone, Debug, PartialEq)]
pub struct MeshMotion {
    /// The time of the first key; the mesh is constant before.
    pub start: f64,
    /// The time of the last key, later than `start`; the others are evenly spaced.
    pub end: f64,
    /// Two or more keys.
    pub moments: Vec<MeshMoment>,
}

/// The vertices of a mesh at one key, one for each of the mesh.
#[derive(Clone, Debug, PartialEq)]
pub struct MeshMoment {
    /// The positions.
    pub positions: Vec<Vec3>,
    /// The normals, if the mesh has them; in all keys, or in none.
    pub normals: Option<Vec<Vec3>>,
}

/// Shapes for instancing.
#[derive(Clone, Debug, Default)]
pub struct ObjectDesc {
    /// Its name.
    pub name: String,
    /// Its shapes, in its own space.
    pub shapes: Vec<ShapeDesc>,
    /// Nested instances, in its own space. No object contains itself at any depth.
    pub instances: Vec<InstanceDesc>,
}

/// A placed object. Everything that moves is an instance, if need be of a single shape.
#[derive(Clone, Debug)]
pub struct InstanceDesc {
    /// The object.
    pub object: ObjectId,
    /// The placement, which may be animated.
    pub world_from_object: Placement,
}

/// The emission of a shape. Photometric units are already resolved, except for `power`.
#[derive(Clone, Debug)]
pub struct AreaLightDesc {
    /// Radiance.
    pub radiance: Rgb,
    /// A factor on the radiance, over uv.
    pub image: Option<Arc<MipMap>>,
    /// Whether vertex colours are a factor, too.
    pub by_vertices: bool,
    /// Whether the back emits, too.
    pub two_sided: bool,
    /// Total power in lumens that a `radiance` of 1 stands for, as in pbrt-v4; if given, `radiance` is a factor on it.
    pub power: Option<f32>,
    /// The spectrum of the radiance, with luminance 1, if it is more than a colour: for spectral renders.
    pub spectrum: Option<Arc<LightCurve>>,
}

/// Lights other than shapes, in world space, with photometric units resolved.
#[derive(Clone, Debug, PartialEq)]
pub enum LightDesc {
    /// A point light.
    Point {
        /// The position.
        from: DVec3,
        /// Radiant intensity.
        intensity: Rgb,
    },
    /// A spot light.
    Spot {
        /// The placement; the cone opens along +z.
        world_from_light: Transform,
        /// Radiant intensity along the axis.
        intensity: Rgb,
        /// Half-angle of the cone in degrees.
        cone_angle: f32,
        /// The width of the falloff inside it in degrees (smoothstep).
        cone_delta_angle: f32,
    },
    /// A point light with an image of intensity by direction.
    Goniometric {
        /// The placement; z is the pole of the image. Scale is ignored.
        world_from_light: Transform,
        /// A factor on the image.
        intensity: Rgb,
        /// Radiant intensity by direction.
        image: EnvironmentDesc,
    },
    /// A projected picture.
    Projection {
        /// The placement; the picture is along +z, its top towards +y, and its right towards +x.
        world_from_light: Transform,
        /// A factor on the picture.
        intensity: Rgb,
        /// Radiant intensity by direction.
        image: Arc<lumbre_image::Image>,
        /// The angle in degrees between the nearer pair of the picture's sides.
        fov: f32,
    },
    /// A directional light.
    Distant {
        /// Unit vector towards the light.
        towards: DVec3,
        /// Irradiance on a perpendicular surface.
        irradiance: Rgb,
    },
    /// A disc at infinity, such as the sun.
    Disc {
        /// Unit vector towards its centre.
        towards: DVec3,
        /// Its diameter in degrees: more than 0, and at most 180.
        angle: f64,
        /// Irradiance on a perpendicular surface.
        irradiance: Rgb,
    },
    /// An environment light.
    Infinite {
        /// The placement: z is up.
        world_from_light: Transform,
        /// Radiance, or a factor on the image.
        radiance: Rgb,
        /// Radiance by direction; `None` for uniform.
        image: Option<EnvironmentDesc>,
    },
    /// An environment light through a rectangle only.
    Portal {
        /// The placement of the environment: z is up.
        world_from_light: Transform,
        /// Radiance, or a factor on the image.
        radiance: Rgb,
        /// Radiance by direction; `None` for uniform.
        image: Option<EnvironmentDesc>,
        /// The corners of the rectangle in the world, in order around it. The cross product of the sides from the first
        /// to the fourth corner and from the first to the second points to the sky.
        corners: [DVec3; 4],
    },
    /// A light by POV-Ray's laws.
    Pov(Arc<crate::pov::PovLight>),
    /// A light with a spectrum, whose colours are multiples of one colour.
    Spectral {
        /// The light. Its image, if it has one, is grey.
        light: Box<LightDesc>,
        /// Its spectrum with luminance 1, for renders that carry wavelengths.
        spectrum: Arc<LightCurve>,
    },
    /// A moving light other than an infinite one.
    Moving {
        /// The light, in its own space.
        light: Box<LightDesc>,
        /// The placement, by rotations, mirrors and translations only, since lights do not scale.
        world_from_light: Arc<AnimatedTransform>,
    },
}

impl LightDesc {
    /// The light without its spectrum.
    pub fn bare(&self) -> &Self {
        match self {
            Self::Spectral { light, .. } => light.bare(),
            light => light,
        }
    }
}

/// An environment map: linear radiance by direction.
#[derive(Clone, Debug, PartialEq)]
pub struct EnvironmentDesc {
    /// Its pixels.
    pub image: Arc<lumbre_image::Image>,
    /// The mapping of directions to it.
    pub mapping: EnvironmentMapping,
}

/// The mapping of an environment map to the sphere.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum EnvironmentMapping {
    /// Square, equal areas, octahedral, z up (Clarberg 2008), as pbrt-v4.
    EqualArea,
    /// Twice as wide as high, z up, the centre towards +x, three quarters of the width towards +y.
    LatitudeLongitude,
}

/// What a film keeps of samples.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub enum FilmKind {
    /// Red, green and blue.
    #[default]
    Rgb,
    /// Besides, what samples see of surfaces, and the variance of their colours: pbrt's film `gbuffer`.
    GBuffer(FilmSpace),
    /// Besides, radiance by wavelength: pbrt's film `spectral`.
    Spectral(Buckets),
}

/// The space in which a film keeps points and directions.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum FilmSpace {
    /// That of the camera: x to the right, y up, z ahead.
    #[default]
    Camera,
    /// That of the scene.
    World,
}

/// A range of wavelengths, cut into equal parts. A film with buckets samples the wavelengths of the range evenly, and
/// none outside.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Buckets {
    /// The parts: at least one.
    pub count: u32,
    /// The first wavelength, in nm.
    pub low: f32,
    /// The last one, above the first.
    pub high: f32,
}

impl Buckets {
    /// The most parts: one a nanometre of the visible range.
    pub const MAX: u32 = 471;

    /// The part that a wavelength falls into; the first or the last one for those outside.
    pub fn of(&self, nm: f32) -> usize {
        let part = f64::from(nm - self.low) / f64::from(self.high - self.low);
        // A cast from a float saturates.
        ((part * f64::from(self.count)) as usize).min(self.count as usize - 1)
    }

    /// The wavelength in the middle of a part.
    pub fn middle(&self, part: usize) -> f64 {
        let width = f64::from(self.high - self.low) / f64::from(self.count);
        f64::from(self.low) + (part as f64 + 0.5) * width
    }
}

/// The film settings.
#[derive(Clone, Debug, PartialEq)]
pub struct FilmDesc {
    /// What it keeps.
    pub kind: FilmKind,
    /// The output name, if the file gives one.
    pub filename: Option<String>,
    /// Width in pixels; `None` leaves the choice to the program.
    pub width: Option<u32>,
    /// Height in pixels.
    pub height: Option<u32>,
    /// Pixels to render: x0, x1, y0, y1 (upper ends excluded).
    pub pixel_bounds: Option<[u32; 4]>,
    /// The part of the picture to render in [0, 1]: x0, x1, y0, y1.
    pub crop_window: Option<[f64; 4]>,
    /// Factor from radiance to pixel values: shutter time × ISO / 100.
    pub exposure: f32,
    /// The ISO speed that `exposure` contains.
    pub iso: f32,
    /// The largest component of one sample; infinite by default.
    pub max_component: f32,
    /// The sensor's colour matrix: from linear Rec. 709, after `max_component`, to the red, green and blue of the
    /// picture. The identity by default.
    pub sensor: [[f32; 3]; 3],
    /// The sensitivities of the camera with this sensor: for spectral renders, instead of `sensor`.
    pub camera: Option<Arc<SensorCurves>>,
    /// Whether paths carry wavelengths, with the integrator `path`.
    pub spectral: bool,
    /// Whether image files of light have single precision; half precision by default.
    pub single_precision: bool,
}

impl Default for FilmDesc {
    fn default() -> Self {
        Self {
            kind: FilmKind::Rgb,
            filename: None,
            width: None,
            height: None,
            pixel_bounds: None,
            crop_window: None,
            exposure: 1.0,
            iso: 100.0,
            max_component: f32::INFINITY,
            sensor: [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]],
            camera: None,
            spectral: false,
            single_precision: false,
        }
    }
}

/// The pixel filter, radii in pixels.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum FilterDesc {
    /// Truncated Gaussian.
    Gaussian {
        /// Half-widths.
        radius: Vec2,
        /// Standard deviation.
        sigma: f32,
    },
    /// A box filter.
    Box {
        /// Half-widths.
        radius: Vec2,
    },
    /// Mitchell and Netravali 1988.
    Mitchell {
        /// Half-widths.
        radius: Vec2,
        /// B.
        b: f32,
        /// C.
        c: f32,
    },
    /// Lanczos-windowed sinc.
    Sinc {
        /// Half-widths.
        radius: Vec2,
        /// Lobes of the window.
        tau: f32,
    },
    /// A tent filter.
    Triangle {
        /// Half-widths.
        radius: Vec2,
    },
}

impl Default for FilterDesc {
    fn default() -> Self {
        Self::Gaussian { radius: Vec2::splat(1.5), sigma: 0.5 }
    }
}

/// The sampler settings.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SamplerDesc {
    /// The kind.
    pub kind: SamplerKind,
    /// Samples per pixel; `None` leaves the choice to the program.
    pub spp: Option<u32>,
    /// The seed.
    pub seed: u64,
}

impl Default for SamplerDesc {
    fn default() -> Self {
        Self { kind: SamplerKind::Sobol, spp: None, seed: 0 }
    }
}

/// The kinds of sampler.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum SamplerKind {
    /// Owen-scrambled Sobol points.
    #[default]
    Sobol,
    /// Independent uniform numbers.
    Independent,
}

/// The integrator with its parameters.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct IntegratorDesc {
    /// The kind.
    pub kind: IntegratorKind,
    /// The maximal number of bounces.
    pub max_depth: u32,
    /// The treatment of shading normals that differ from the surface's.
    pub shading_normals: ShadingNormals,
}

impl Default for IntegratorDesc {
    fn default() -> Self {
        let kind = IntegratorKind::Path { regularize: false };
        Self { kind, max_depth: 5, shading_normals: ShadingNormals::default() }
    }
}

/// The kinds of integrator.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum IntegratorKind {
    /// Path tracing with next-event estimation and multiple importance sampling.
    Path {
        /// Whether to roughen surfaces after the first diffuse bounce.
        regularize: bool,
    },
    /// Path tracing with photons for caustics over mirrors and smooth glass.
    Caustics,
    /// Whitted 1980: direct light, perfect reflection and refraction.
    Whitted {
        /// Samples on each area light, at least 1.
        light_samples: u32,
        /// Whether infinite lights illuminate surfaces, beyond being visible as background.
        sky: bool,
    },
    /// POV-Ray's local illumination, with mirrors, refractions and shadows, for POV-Ray scenes.
    Pov,
    /// Ambient occlusion.
    AmbientOcclusion {
        /// Cosine-weighted or uniform.
        cosine: bool,
        /// The maximal distance of occluders.
        max_distance: f64,
    },
    /// The shading normal, (n + 1) / 2.
    Normals,
    /// Depth along the camera's axis.
    Depth,
    /// Reflectance.
    Albedo,
    /// uv.
    Uv,
}

impl IntegratorKind {
    /// Whether its picture of a scene without light is black.
    pub fn needs_light(&self) -> bool {
        match self {
            Self::Path { .. } | Self::Caustics | Self::Whitted { .. } | Self::Pov => true,
            Self::AmbientOcclusion { .. } | Self::Normals | Self::Depth | Self::Albedo | Self::Uv => false,
        }
    }

    /// Whether its picture shows the geometry, and not a noisy estimate of light.
    pub fn is_feature(&self) -> bool {
        match self {
            Self::Path { .. } | Self::Caustics | Self::Whitted { .. } | Self::Pov => false,
            Self::AmbientOcclusion { .. } => false,
            Self::Normals | Self::Depth | Self::Albedo | Self::Uv => true,
        }
    }

    /// Whether its paths can carry wavelengths in place of linear Rec. 709.
    pub fn carries_wavelengths(&self) -> bool {
        matches!(self, Self::Path { .. } | Self::Caustics)
    }

    /// The names of all integrators.
    pub const NAMES: [&'static str; 9] =
        ["path", "caustics", "whitted", "pov", "ambientocclusion", "normals", "depth", "albedo", "uv"];

    /// The integrator of a name in the scene language, with default parameters.
    pub fn from_name(name: &str) -> Option<Self> {
        match name {
            "path" => Some(Self::Path { regularize: false }),
            "caustics" => Some(Self::Caustics),
            "whitted" => Some(Self::Whitted { light_samples: 1, sky: false }),
            "pov" => Some(Self::Pov),
            "ambientocclusion" => Some(Self::AmbientOcclusion { cosine: true, max_distance: f64::INFINITY }),
            "normals" => Some(Self::Normals),
            "depth" => Some(Self::Depth),
            "albedo" => Some(Self::Albedo),
            "uv" => Some(Self::Uv),
            _ => None,
        }
    }
}
