//! What a scene consists of, before it is built: cameras, shapes, materials, lights, and how to set them on a stage.
//!
//! The names are those of the crate `lumbre-scene`, but for three that mean something else elsewhere here:
//! [`ResolvedScene`] is its `Scene`, [`CameraView`] its `View` and [`DescriptionError`] its `BuildError`.

pub use lumbre_scene::light;
pub use lumbre_scene::{
    AreaLightDesc, Boundary, Buckets, BuildError as DescriptionError, BuildWarning, Camera, CameraKind,
    CameraRay, ClearSky, ClipPlane, ColouredShape, CsgDesc, CsgOperation, Emission, EnvironmentDesc,
    EnvironmentMapping, FilmDesc, FilmKind, FilmSpace, FilterDesc, Footprint, FurtherUvs, GeometryDesc,
    Ground, GroundDesc, GroundPlane, InstanceDesc, IntegratorDesc, IntegratorKind, Interaction, Light,
    LightDesc, LightId, LightSample, MaterialId, MediumId, MeshDesc, MeshMoment, MeshMotion, NamedMaterial,
    ObjectDesc, ObjectId, Placement, SamplerDesc, SamplerKind, Scene as ResolvedScene, SceneDesc, ShapeDesc,
    SkyDesc, SkyError, SphericalMapping, Stage, StageLight, Staged, SunPosition, SunPositionError,
    Surroundings, UpAxis, View as CameraView, WithoutLight,
};
