//! A scene as a reader describes it: plain data, no files, nothing resolved.

use std::sync::Arc;

use lumbre_geometry::Shape;
use lumbre_image::Rgb;
use lumbre_kernel::Placement;
use lumbre_math::{AnimatedTransform, DVec3, Transform, Vec2, Vec3, Vec4};
use lumbre_shading::{FURTHER_SETS, FloatTexture, Material, MipMap};

use crate::{Camera, MaterialId, ObjectId};

/// Everything that a scene file says.
#[derive(Clone, Debug, Default)]
pub struct SceneDesc {
    /// Cameras, the one to use first; none asks for an automatic one.
    pub cameras: Vec<Camera>,
    /// The picture's size, crop and exposure.
    pub film: FilmDesc,
    /// The pixel filter.
    pub filter: FilterDesc,
    /// The sampler.
    pub sampler: SamplerDesc,
    /// The integrator.
    pub integrator: IntegratorDesc,
    /// Materials; shapes name them by position.
    pub materials: Vec<NamedMaterial>,
    /// Shapes that stand in the world, in the order of the file.
    pub shapes: Vec<ShapeDesc>,
    /// Objects to be instanced.
    pub objects: Vec<ObjectDesc>,
    /// Objects placed in the world.
    pub instances: Vec<InstanceDesc>,
    /// Lights that are not shapes.
    pub lights: Vec<LightDesc>,
    /// What to do where there is no light at all, neither here nor on a shape.
    pub without_light: WithoutLight,
    /// The axis that the automatic camera and the automatic light take for up.
    pub up: UpAxis,
    /// What everything stands on.
    pub ground: Option<GroundDesc>,
}

/// An infinite matte plane, which nothing stands below.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct GroundDesc {
    /// A point of it.
    pub point: DVec3,
    /// Up from it, of any length but zero.
    pub normal: DVec3,
    /// What it reflects of the light that falls on it.
    pub reflectance: Rgb,
    /// Whether a camera sees of it only the shadow that falls on it, over what is behind.
    pub catcher: bool,
}

/// What a description without any light at all is lit by.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum WithoutLight {
    /// A studio's light: a mesh alone is worth a picture.
    #[default]
    Studio,
    /// A studio's light unless there are lights that are no surfaces, and a camera too: what glows in a model is seldom
    /// meant to light it, and what has no camera is no scene.
    StudioUnlessStaged,
    /// Nothing: whoever wrote a whole scene meant it, and it is black.
    Dark,
}

/// Which axis points up.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum UpAxis {
    /// y, as in most meshes and in glTF.
    #[default]
    Y,
    /// z, as in most of engineering (STL).
    Z,
}

/// A material under its name.
#[derive(Clone, Debug)]
pub struct NamedMaterial {
    /// Its name, where the file gives one.
    pub name: Option<String>,
    /// The material.
    pub material: Arc<Material>,
}

/// A shape and what it is made of.
#[derive(Clone, Debug)]
pub struct ShapeDesc {
    /// Its 0-based position among all shapes of its file, by which answers name it.
    pub index: u32,
    /// Its form.
    pub geometry: GeometryDesc,
    /// Where it stands.
    pub world_from_object: Transform,
    /// Whether the outside is the inside.
    pub reverse_orientation: bool,
    /// What it is made of; `None` for an interface, which is no surface at all.
    pub material: Option<MaterialId>,
    /// The light it gives.
    pub area_light: Option<AreaLightDesc>,
    /// Coverage in [0, 1]; `None` is opaque.
    pub alpha: Option<Arc<FloatTexture>>,
}

/// The forms of a shape.
#[derive(Clone, Debug)]
pub enum GeometryDesc {
    /// One exact shape.
    Exact(Shape),
    /// One exact shape with colours.
    Coloured(Box<ColouredShape>),
    /// Triangles and quads.
    Mesh(Arc<MeshDesc>),
    /// Bilinear patches (p00, p10, p01, p11 each) with shared vertices.
    BilinearMesh(Arc<MeshDesc>),
    /// A combination of solids, each surface keeping its own material.
    Csg(CsgDesc),
}

/// An exact shape with colours like those of a mesh's vertices, which run evenly from one place to another: a line between
/// two vertices with some thickness.
#[derive(Clone, Debug)]
pub struct ColouredShape {
    /// Its form.
    pub shape: Shape,
    /// The two places, in the space of the shape. Where they are the same, the first colour is that of the whole shape.
    pub ends: [DVec3; 2],
    /// Linear colours there, and beyond.
    pub colours: [Rgb; 2],
    /// Coverages, which go with the colours.
    pub coverages: [f32; 2],
}

/// A combination of solids.
#[derive(Clone, Debug)]
pub struct CsgDesc {
    /// What is done with them.
    pub operation: CsgOperation,
    /// Two or more; each is the union of its shapes (whose transforms are relative to the CSG's own space).
    pub operands: Vec<Vec<ShapeDesc>>,
}

/// The operations on solids.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum CsgOperation {
    /// What any holds.
    Union,
    /// What all hold.
    Intersection,
    /// What the first holds and no other does.
    Difference,
}

/// A mesh as files have it. Every list that is there is as long as `positions`, unless it says otherwise.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct MeshDesc {
    /// Vertices.
    pub positions: Vec<Vec3>,
    /// Triangles, counter-clockwise from the front.
    pub triangles: Vec<[u32; 3]>,
    /// Quads, counter-clockwise from the front. (A bilinear mesh has its patches here, in its own order.)
    pub quads: Vec<[u32; 4]>,
    /// Shading normals.
    pub normals: Option<Vec<Vec3>>,
    /// Texture coordinates.
    pub uvs: Option<Vec<Vec2>>,
    /// Tangents, with the side on which the bitangent of normal maps lies: 1 for that of normal × tangent, -1 for the other,
    /// as the mesh stands here (a mirror turns it over); 0 for that of normal × tangent come what may.
    pub tangents: Option<Vec<Vec4>>,
    /// Further sets of texture coordinates: the second, the third and the fourth.
    pub further_uvs: [Option<Vec<Vec2>>; FURTHER_SETS],
    /// Linear colours.
    pub colours: Option<Vec<Rgb>>,
    /// Coverages, which go with the colours.
    pub coverages: Option<Vec<f32>>,
    /// A number for each face: triangles first, then quads.
    pub face_indices: Option<Vec<u32>>,
    /// How it changes its form, if it does; what is above is then how it is at some time, for whoever looks at one. Its quads
    /// are halved, flat or not, and its tangents stay what they are.
    pub motion: Option<MeshMotion>,
}

/// The vertices of a mesh while it changes its form: each goes straight from one moment to the next.
#[derive(Clone, Debug, PartialEq)]
pub struct MeshMotion {
    /// The time of the first moment; before, the mesh is as then.
    pub start: f64,
    /// The time of the last one, more than `start`; the others are evenly spaced between.
    pub end: f64,
    /// Two or more.
    pub moments: Vec<MeshMoment>,
}

/// The vertices of a mesh at one moment, as many as in the mesh.
#[derive(Clone, Debug, PartialEq)]
pub struct MeshMoment {
    /// Where they are.
    pub positions: Vec<Vec3>,
    /// Their normals, where the mesh has some; in all moments, or in none.
    pub normals: Option<Vec<Vec3>>,
}

/// Shapes to be placed many times.
#[derive(Clone, Debug, Default)]
pub struct ObjectDesc {
    /// Its name.
    pub name: String,
    /// Its shapes, in its own space.
    pub shapes: Vec<ShapeDesc>,
    /// Other objects inside it, in its own space. No object holds itself at any depth.
    pub instances: Vec<InstanceDesc>,
}

/// An object, placed. What moves is an instance: a single shape too stands in an object of its own then.
#[derive(Clone, Debug)]
pub struct InstanceDesc {
    /// Which.
    pub object: ObjectId,
    /// Where, at which time.
    pub world_from_object: Placement,
}

/// The light that a shape gives off. Photometric units are already resolved but for `power`.
#[derive(Clone, Debug)]
pub struct AreaLightDesc {
    /// Radiance.
    pub radiance: Rgb,
    /// A factor on the radiance, over the surface's uv.
    pub image: Option<Arc<MipMap>>,
    /// Whether the colours of a mesh's vertices are a factor too.
    pub by_vertices: bool,
    /// Whether the back shines too.
    pub two_sided: bool,
    /// Total power in lumens; when there, `radiance` gives only the colour (luminance 1).
    pub power: Option<f32>,
}

/// Lights that are not shapes. All in world space, photometric units resolved.
#[derive(Clone, Debug)]
pub enum LightDesc {
    /// The same in all directions from a point.
    Point {
        /// Where.
        from: DVec3,
        /// Radiant intensity.
        intensity: Rgb,
    },
    /// A cone from a point.
    Spot {
        /// Where; the cone opens along +z of this space.
        world_from_light: Transform,
        /// Radiant intensity along the axis.
        intensity: Rgb,
        /// Half-angle in degrees beyond which there is nothing.
        cone_angle: f32,
        /// Degrees inside it over which it fades (smoothstep).
        cone_delta_angle: f32,
    },
    /// From a point, by direction as a picture says.
    Goniometric {
        /// Where; the picture is in this space, z its pole. It is not stretched.
        world_from_light: Transform,
        /// A factor on the picture.
        intensity: Rgb,
        /// Radiant intensity by direction.
        image: EnvironmentDesc,
    },
    /// Parallel light.
    Distant {
        /// Unit vector towards the light.
        towards: DVec3,
        /// Irradiance on a surface that faces it.
        irradiance: Rgb,
    },
    /// Light from all around.
    Infinite {
        /// Where its poles are: z of this space is up.
        world_from_light: Transform,
        /// Radiance, or a factor on the image.
        radiance: Rgb,
        /// Radiance by direction, where it varies.
        image: Option<EnvironmentDesc>,
    },
    /// One of the above, though not an infinite one, that moves.
    Moving {
        /// The light, in a space of its own.
        light: Box<LightDesc>,
        /// Where that space is: by rotations, mirrors and translations alone, as a light cannot be stretched.
        world_from_light: Arc<AnimatedTransform>,
    },
}

/// An environment map: linear radiance by direction.
#[derive(Clone, Debug, PartialEq)]
pub struct EnvironmentDesc {
    /// Its pixels.
    pub image: Arc<lumbre_image::Image>,
    /// How directions fall on it.
    pub mapping: EnvironmentMapping,
}

/// How an environment map covers the sphere.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum EnvironmentMapping {
    /// Square, equal areas, octahedral, z up (Clarberg 2008), as pbrt-v4.
    EqualArea,
    /// Twice as wide as high, z up, the middle of the picture towards +x, three quarters of its width towards +y.
    LatitudeLongitude,
}

/// The picture.
#[derive(Clone, Debug, PartialEq)]
pub struct FilmDesc {
    /// The name to save under, where the file gives one.
    pub filename: Option<String>,
    /// Pixels across; `None` leaves the choice to the program.
    pub width: Option<u32>,
    /// Pixels down.
    pub height: Option<u32>,
    /// Pixels to render: x0, x1, y0, y1 (upper ends excluded).
    pub pixel_bounds: Option<[u32; 4]>,
    /// Part of the picture to render in [0, 1]: x0, x1, y0, y1.
    pub crop_window: Option<[f64; 4]>,
    /// Factor from radiance to pixel values: shutter time × ISO / 100.
    pub exposure: f32,
    /// Largest component of one sample; infinite by default.
    pub max_component: f32,
}

impl Default for FilmDesc {
    fn default() -> Self {
        Self {
            filename: None,
            width: None,
            height: None,
            pixel_bounds: None,
            crop_window: None,
            exposure: 1.0,
            max_component: f32::INFINITY,
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
    /// All alike.
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
    /// A tent.
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

/// The sampler.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SamplerDesc {
    /// Which numbers.
    pub kind: SamplerKind,
    /// Samples a pixel; `None` leaves the choice to the program.
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
    /// Which.
    pub kind: IntegratorKind,
    /// Bounces at most.
    pub max_depth: u32,
}

impl Default for IntegratorDesc {
    fn default() -> Self {
        Self { kind: IntegratorKind::Path { regularize: false }, max_depth: 5 }
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
    /// Whitted 1980: direct light, perfect reflection and refraction.
    Whitted {
        /// Points on each light that has a surface, at least 1.
        light_samples: u32,
        /// Whether lights at infinity light surfaces, and are not seen as a background alone.
        sky: bool,
    },
    /// Ambient occlusion.
    AmbientOcclusion {
        /// By the cosine, or uniformly.
        cosine: bool,
        /// How far to look.
        max_distance: f64,
    },
    /// The shading normal, (n + 1) / 2.
    Normals,
    /// Distance along the camera's axis.
    Depth,
    /// Reflectance.
    Albedo,
    /// Surface parameters.
    Uv,
}

impl IntegratorKind {
    /// Whether its picture of a scene without light is black.
    pub fn needs_light(&self) -> bool {
        match self {
            Self::Path { .. } | Self::Whitted { .. } => true,
            Self::AmbientOcclusion { .. } | Self::Normals | Self::Depth | Self::Albedo | Self::Uv => false,
        }
    }

    /// The integrator of a name in the scene language, with its default parameters.
    pub fn from_name(name: &str) -> Option<Self> {
        match name {
            "path" => Some(Self::Path { regularize: false }),
            "whitted" => Some(Self::Whitted { light_samples: 1, sky: false }),
            "ambientocclusion" => Some(Self::AmbientOcclusion { cosine: true, max_distance: f64::INFINITY }),
            "normals" => Some(Self::Normals),
            "depth" => Some(Self::Depth),
            "albedo" => Some(Self::Albedo),
            "uv" => Some(Self::Uv),
            _ => None,
        }
    }
}
