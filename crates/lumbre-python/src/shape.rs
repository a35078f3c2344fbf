//! What scenes are made of. Each is checked when it is made, so that a wrong number is refused where it stands.

use std::sync::Arc;

use lumbre::description::{
    Camera as CameraDesc, CameraKind, CameraView, ClearSky, CsgOperation, LightDesc, MeshDesc, SkyDesc,
    SunPosition,
};
use lumbre::geometry::{
    BilinearPatch, Capsule, Cone, Csg, Cuboid, CurveKind, Curves, Cylinder, Disk, Hyperboloid, Paraboloid,
    Plane, Quadric, Shape, ShapeError, Sphere, Strand, Torus, Triangle,
};
use lumbre::image::Rgb;
use lumbre::math::{DMat4, Vec2, Vec3};
use lumbre::shading::{Material as MaterialDesc, MaterialKind, SpectrumTexture};
use lumbre::{DVec2, DVec3, EnvironmentDesc, ShapeBuilder, Transform};
use numpy::ndarray::ArrayView2;
use numpy::{
    PyArray1, PyArray3, PyArrayMethods, PyReadonlyArray1, PyReadonlyArray2, PyReadonlyArray3,
    PyUntypedArrayMethods,
};
use pyo3::prelude::*;

use crate::errors::{invalid, list, tuple, unknown};
use crate::expression;
use crate::material::{Material, colour};
use crate::medium::Medium;
use crate::picture::image_of;

type Triple = [f64; 3];

/// A geometry without a place, material and light.
#[pyclass(frozen, module = "lumbre._lumbre")]
pub(crate) struct Geometry {
    shape: ShapeBuilder,
    /// Shapes in it, each as often as it stands there.
    leaves: u64,
    /// CSG in CSG.
    depth: usize,
}

/// As deep as scenes have CSG.
const MAX_NESTED: usize = Csg::MAX_DEPTH / 2;
/// A scene has a description of each, of some 500 bytes.
const MAX_LEAVES: u64 = 1 << 22;

impl From<ShapeBuilder> for Geometry {
    fn from(shape: ShapeBuilder) -> Self {
        Self { shape, leaves: 1, depth: 0 }
    }
}

/// A geometry with its place, material, emitted radiance and medium.
pub(crate) type Placed<'py> = (
    Bound<'py, Geometry>,
    Option<[[f64; 4]; 4]>,
    Option<Bound<'py, Material>>,
    Option<[f32; 3]>,
    Option<Bound<'py, Medium>>,
);

/// The shape of these.
pub(crate) fn placed((geometry, place, material, emission, medium): &Placed<'_>) -> PyResult<ShapeBuilder> {
    let mut shape = geometry.get().shape.clone();
    if let Some(place) = place {
        shape = shape.at(transform(*place)?);
    }
    if let Some(material) = material {
        shape = shape.material(Arc::clone(&material.get().desc));
    }
    if let Some(emission) = emission {
        shape = shape.shining(colour("emission", *emission)?);
    }
    if let Some(medium) = medium {
        shape = shape.medium(Arc::clone(&medium.get().0));
    }
    Ok(shape)
}

fn exact<S: Into<Shape>>(shape: Result<S, ShapeError>) -> PyResult<Geometry> {
    Ok(ShapeBuilder::exact(shape.map_err(invalid)?).into())
}

fn rows<const N: usize, T: Copy, U>(view: &ArrayView2<'_, T>, of: impl Fn([T; N]) -> U) -> PyResult<Vec<U>> {
    let mut rows = list(view.nrows())?;
    rows.extend((0..view.nrows()).map(|row| of(std::array::from_fn(|column| view[[row, column]]))));
    Ok(rows)
}

fn check_width<T: numpy::Element>(name: &str, array: &PyReadonlyArray2<'_, T>, width: usize) -> PyResult<()> {
    if array.shape()[1] == width {
        return Ok(());
    }
    let found = tuple(array.shape());
    Err(invalid(format!("{name} has the wrong shape (found {found}; expected (N, {width}))")))
}

#[pymethods]
impl Geometry {
    #[staticmethod]
    fn sphere(center: Triple, radius: f64) -> PyResult<Self> {
        exact(Sphere::new(center.into(), radius))
    }

    #[staticmethod]
    fn plane(point: Triple, normal: Triple) -> PyResult<Self> {
        exact(Plane::new(point.into(), normal.into()))
    }

    #[staticmethod]
    fn disk(center: Triple, normal: Triple, radius: f64, inner_radius: f64) -> PyResult<Self> {
        exact(Disk::new(center.into(), normal.into(), radius, inner_radius))
    }

    #[staticmethod]
    fn cuboid(p0: Triple, p1: Triple) -> PyResult<Self> {
        exact(Cuboid::new(p0.into(), p1.into()))
    }

    #[staticmethod]
    fn cylinder(p0: Triple, p1: Triple, radius: f64, caps: bool) -> PyResult<Self> {
        exact(Cylinder::new(p0.into(), p1.into(), radius, caps))
    }

    #[staticmethod]
    fn cone(p0: Triple, p1: Triple, r0: f64, r1: f64, caps: bool) -> PyResult<Self> {
        exact(Cone::new(p0.into(), p1.into(), r0, r1, caps))
    }

    #[staticmethod]
    fn capsule(p0: Triple, p1: Triple, radius: f64) -> PyResult<Self> {
        exact(Capsule::new(p0.into(), p1.into(), radius))
    }

    #[staticmethod]
    fn torus(center: Triple, axis: Triple, major: f64, minor: f64) -> PyResult<Self> {
        exact(Torus::new(center.into(), axis.into(), major, minor))
    }

    #[staticmethod]
    fn paraboloid(radius: f64, zmin: f64, zmax: f64, phimax: f64) -> PyResult<Self> {
        exact(Paraboloid::new(radius, zmin, zmax, phimax))
    }

    #[staticmethod]
    fn hyperboloid(p1: Triple, p2: Triple, phimax: f64) -> PyResult<Self> {
        exact(Hyperboloid::new(p1.into(), p2.into(), phimax))
    }

    #[staticmethod]
    fn quadric(coefficients: [f64; 10], clip: Option<(Triple, Triple)>) -> PyResult<Self> {
        let clip = clip.map(|(p0, p1)| {
            let (p0, p1) = (DVec3::from(p0), DVec3::from(p1));
            lumbre::geometry::Aabb { min: p0.min(p1), max: p0.max(p1) }
        });
        exact(Quadric::new(coefficients, clip))
    }

    #[staticmethod]
    fn triangle(p0: Triple, p1: Triple, p2: Triple) -> PyResult<Self> {
        exact(Triangle::new(p0.into(), p1.into(), p2.into()))
    }

    #[staticmethod]
    fn patch(p00: Triple, p10: Triple, p01: Triple, p11: Triple) -> PyResult<Self> {
        exact(BilinearPatch::new(p00.into(), p10.into(), p01.into(), p11.into()))
    }

    /// Smooth curves through (P, 3) points, with a width at each; `counts` is how many points each curve has.
    #[staticmethod]
    fn curves(
        points: PyReadonlyArray2<'_, f64>,
        widths: PyReadonlyArray1<'_, f64>,
        counts: PyReadonlyArray1<'_, i64>,
        kind: &str,
        normals: Option<PyReadonlyArray2<'_, f64>>,
    ) -> PyResult<Self> {
        let kind = match kind {
            "flat" => CurveKind::Flat,
            "cylinder" => CurveKind::Cylinder,
            "ribbon" => CurveKind::Ribbon,
            _ => return Err(unknown("kind", kind, &["flat", "cylinder", "ribbon"])),
        };
        if normals.is_some() != (kind == CurveKind::Ribbon) {
            return Err(invalid(
                "normals are for ribbons, and ribbons need them (expected kind=\"ribbon\", and a normal at each point)",
            ));
        }
        let normals: Vec<DVec3> = match &normals {
            Some(normals) => {
                check_width("normals", normals, 3)?;
                rows(&normals.as_array(), |normal: Triple| normal.into())?
            }
            None => Vec::new(),
        };
        check_width("points", &points, 3)?;
        let places: Vec<DVec3> = rows(&points.as_array(), |place: Triple| place.into())?;
        let widths: Vec<f64> = widths.as_array().iter().copied().collect();
        let mut curves = Curves::new(kind);
        let mut first = 0_usize;
        for (number, &count) in counts.as_array().iter().enumerate() {
            let last = usize::try_from(count).ok().and_then(|count| first.checked_add(count));
            let has_normals = |last: usize| normals.is_empty() || last <= normals.len();
            let part = last.filter(|&last| last <= places.len() && last <= widths.len() && has_normals(last));
            let Some(last) = part else { return Err(invalid(format!("curve {number} has no points"))) };
            let strand = Strand::through(&places[first..last], &widths[first..last]);
            let strand = strand.and_then(|strand| match normals.get(first..last) {
                Some(normals) if !normals.is_empty() => strand.with_normals(normals),
                _ => Ok(strand),
            });
            strand
                .and_then(|strand| curves.push(&strand))
                .map_err(|wrong| invalid(format!("curve {number}: {wrong}")))?;
            first = last;
        }
        Ok(ShapeBuilder::curves(curves).into())
    }

    /// The surface where an expression in x, y and z is zero, within a box; it is negative inside.
    #[staticmethod]
    fn implicit(text: &str, p0: Triple, p1: Triple) -> PyResult<Self> {
        let (p0, p1) = (DVec3::from(p0), DVec3::from(p1));
        let bounds = lumbre::geometry::Aabb { min: p0.min(p1), max: p0.max(p1) };
        Ok(ShapeBuilder::custom(expression::surface(text, bounds)?).into())
    }

    /// CSG of operands, each the union of its shapes.
    #[staticmethod]
    fn csg(operation: &str, operands: Vec<Vec<Placed<'_>>>) -> PyResult<Self> {
        let operation = match operation {
            "union" => CsgOperation::Union,
            "intersection" => CsgOperation::Intersection,
            "difference" => CsgOperation::Difference,
            _ => return Err(unknown("operation", operation, &["union", "intersection", "difference"])),
        };
        let operand = |shapes: &Vec<Placed<'_>>| shapes.iter().map(placed).collect::<PyResult<Vec<_>>>();
        let parts = || operands.iter().flatten().map(|(geometry, ..)| geometry.get());
        let leaves = parts().fold(0, |leaves: u64, part| leaves.saturating_add(part.leaves));
        let depth = 1 + parts().map(|part| part.depth).max().unwrap_or(0);
        if leaves > MAX_LEAVES {
            return Err(invalid(format!(
                "CSG of too many shapes (found {leaves}; expected at most {MAX_LEAVES})"
            )));
        }
        if depth > MAX_NESTED {
            return Err(invalid(format!(
                "CSG stands in CSG more than {MAX_NESTED} deep (Union(*shapes) makes one of many)"
            )));
        }
        let operands = operands.iter().map(operand).collect::<PyResult<_>>()?;
        Ok(Self { shape: ShapeBuilder::csg(operation, operands), leaves, depth })
    }

    /// Triangles or quads of (V, 3) vertices in double precision and (F, 3) or (F, 4) faces. `is_precise` says whether
    /// rays meet triangles at these vertices, or at what they are in single precision.
    #[staticmethod]
    fn mesh(
        vertices: PyReadonlyArray2<'_, f64>,
        faces: PyReadonlyArray2<'_, i64>,
        normals: Option<PyReadonlyArray2<'_, f64>>,
        uvs: Option<PyReadonlyArray2<'_, f64>>,
        colors: Option<PyReadonlyArray2<'_, f64>>,
        is_precise: bool,
    ) -> PyResult<Self> {
        check_width("vertices", &vertices, 3)?;
        let places: Vec<DVec3> = rows(&vertices.as_array(), |place: Triple| place.into())?;
        if let Some(vertex) = places.iter().position(|place| !place.is_finite()) {
            return Err(invalid(format!("vertex {vertex} is not finite")));
        }
        let faces = faces.as_array();
        let wrong = faces
            .indexed_iter()
            .find(|(_, vertex)| usize::try_from(**vertex).map_or(true, |v| v >= places.len()));
        if let Some(((face, _), vertex)) = wrong {
            return Err(invalid(format!(
                "face {face} has a vertex that does not exist (found {vertex}; expected 0 to {})",
                places.len().saturating_sub(1)
            )));
        }
        let (mut triangles, mut quads) = (Vec::new(), Vec::new());
        match faces.ncols() {
            3 => triangles = rows(&faces, |face: [i64; 3]| face.map(|vertex| vertex as u32))?,
            4 => quads = rows(&faces, |face: [i64; 4]| face.map(|vertex| vertex as u32))?,
            found => return Err(invalid(format!("faces have {found} corners (expected 3 or 4)"))),
        }
        if is_precise && !quads.is_empty() {
            return Err(invalid("quads are of single precision (expected triangles, or float32 vertices)"));
        }
        if let Some(normals) = &normals {
            check_width("normals", normals, 3)?;
        }
        if let Some(uvs) = &uvs {
            check_width("uvs", uvs, 2)?;
        }
        if let Some(colors) = &colors {
            check_width("colors", colors, 3)?;
            if let Some(((vertex, _), found)) =
                colors.as_array().indexed_iter().find(|(_, x)| !(**x >= 0.0 && x.is_finite()))
            {
                return Err(invalid(format!("colors of vertex {vertex} are no light (found {found})")));
            }
        }
        let is_coloured = colors.is_some();
        let narrow = |numbers: Triple| Vec3::from(numbers.map(|x| x as f32));
        let mut positions = list(places.len())?;
        positions.extend(places.iter().map(|place| place.as_vec3()));
        let mesh = MeshDesc {
            positions,
            precise_positions: is_precise.then_some(places),
            triangles,
            quads,
            normals: normals.map(|normals| rows(&normals.as_array(), narrow)).transpose()?,
            colours: colors
                .map(|colors| rows(&colors.as_array(), |colour: Triple| Rgb::from(colour.map(|x| x as f32))))
                .transpose()?,
            uvs: uvs
                .map(|uvs| rows(&uvs.as_array(), |uv: [f64; 2]| Vec2::from(uv.map(|x| x as f32))))
                .transpose()?,
            ..MeshDesc::default()
        };
        let shape = ShapeBuilder::mesh(mesh);
        if !is_coloured {
            return Ok(shape.into());
        }
        // As a file of coloured vertices has it.
        let reflectance = Arc::new(SpectrumTexture::Vertices);
        Ok(shape.material(MaterialDesc::new(MaterialKind::Diffuse { reflectance })).into())
    }
}

/// A light other than a shape.
#[pyclass(frozen, module = "lumbre._lumbre")]
pub(crate) struct Light(pub(crate) Arc<LightDesc>);

#[pymethods]
impl Light {
    #[staticmethod]
    fn point(position: Triple, intensity: [f32; 3]) -> PyResult<Self> {
        let from = DVec3::from(position);
        if !from.is_finite() {
            return Err(invalid(format!("position is not finite (found {from})")));
        }
        Ok(Self::of(LightDesc::Point { from, intensity: colour("intensity", intensity)? }))
    }

    /// A cone of this half-angle in degrees, whose outer part fades out.
    #[staticmethod]
    fn spot(
        position: Triple,
        target: Triple,
        intensity: [f32; 3],
        angle: f32,
        falloff: f32,
    ) -> PyResult<Self> {
        let (from, target) = (DVec3::from(position), DVec3::from(target));
        let along = (target - from).try_normalize();
        let along = along.ok_or_else(|| invalid(format!("a light at {from} shines at no {target}")))?;
        if !(0.0 < angle && angle <= 90.0 && 0.0 <= falloff && falloff <= angle) {
            return Err(invalid(format!(
                "angle and falloff are out of range (found {angle} and {falloff}; expected degrees to 90, and no more than angle)"
            )));
        }
        let turn = lumbre::math::DQuat::from_rotation_arc(DVec3::Z, along);
        let world_from_light =
            Transform::from_scale_rotation_translation(DVec3::ONE, turn, from).map_err(invalid)?;
        Ok(Self::of(LightDesc::Spot {
            world_from_light,
            intensity: colour("intensity", intensity)?,
            cone_angle: angle,
            cone_delta_angle: falloff,
        }))
    }

    #[staticmethod]
    fn distant(towards: Triple, irradiance: [f32; 3]) -> PyResult<Self> {
        let towards = DVec3::from(towards).try_normalize();
        let towards =
            towards.ok_or_else(|| invalid("towards is no direction (expected a vector of some length)"))?;
        Ok(Self::of(LightDesc::Distant { towards, irradiance: colour("irradiance", irradiance)? }))
    }

    /// A disc at infinity of this diameter in degrees.
    #[staticmethod]
    fn disc(towards: Triple, angle: f64, irradiance: [f32; 3]) -> PyResult<Self> {
        let towards = DVec3::from(towards);
        if !(0.0 < angle && angle <= 180.0) {
            return Err(invalid(format!(
                "angle is out of range (found {angle}; expected degrees, from 0 to 180)"
            )));
        }
        Ok(Self::of(LightDesc::Disc { towards, angle, irradiance: colour("irradiance", irradiance)? }))
    }

    /// The sun at this azimuth and elevation in degrees, as bright as the air of this turbidity leaves it.
    #[staticmethod]
    fn sun(azimuth: f64, elevation: f64, turbidity: f64, angle: f64) -> PyResult<Self> {
        let desc = SkyDesc {
            sun: SunPosition { azimuth, elevation },
            turbidity,
            sun_angle: angle,
            sky_scale: 0.0,
            ..SkyDesc::default()
        };
        let lights = ClearSky::new(desc).map_err(invalid)?.lights(&Transform::IDENTITY);
        let dark = LightDesc::Distant { towards: DVec3::Z, irradiance: Rgb::BLACK };
        Ok(Self::of(lights.into_iter().next().unwrap_or(dark)))
    }

    /// Light from all around: `image` is (h, 2h, 3), by longitude and latitude, with this axis up.
    #[staticmethod]
    fn environment(
        radiance: [f32; 3],
        image: Option<PyReadonlyArray3<'_, f32>>,
        up: Triple,
    ) -> PyResult<Self> {
        let radiance = colour("radiance", radiance)?;
        let up = DVec3::from(up).try_normalize().ok_or_else(|| invalid("up is no direction"))?;
        let turn = lumbre::math::DQuat::from_rotation_arc(DVec3::Z, up);
        let world_from_light =
            Transform::from_scale_rotation_translation(DVec3::ONE, turn, DVec3::ZERO).map_err(invalid)?;
        let Some(image) = image else {
            return Ok(Self::of(LightDesc::Infinite { world_from_light, radiance, image: None }));
        };
        let described = environment(&image)?;
        Ok(Self::of(LightDesc::Infinite { world_from_light, radiance, image: Some(described) }))
    }
}

impl Light {
    fn of(light: LightDesc) -> Self {
        Self(Arc::new(light))
    }
}

/// An environment map, which stands as the model is looked at.
#[pyclass(frozen, module = "lumbre._lumbre")]
pub(crate) struct Environment(pub(crate) EnvironmentDesc);

#[pymethods]
impl Environment {
    /// Of an array, (h, 2h, 3) by longitude and latitude, or square in pbrt's equal-area mapping.
    #[new]
    fn new(image: PyReadonlyArray3<'_, f32>) -> PyResult<Self> {
        environment(&image).map(Self)
    }
}

fn environment(image: &PyReadonlyArray3<'_, f32>) -> PyResult<EnvironmentDesc> {
    let image = image_of("image", image)?;
    let (width, height) = (image.width(), image.height());
    EnvironmentDesc::of_image(Arc::new(image)).ok_or_else(|| {
        invalid(format!(
            "image is no environment map (found {width} by {height} pixels; expected twice as wide as high)"
        ))
    })
}

/// A camera.
#[pyclass(frozen, module = "lumbre._lumbre")]
pub(crate) struct Camera(pub(crate) CameraDesc);

#[pymethods]
impl Camera {
    #[staticmethod]
    fn perspective(eye: Triple, target: Triple, up: Triple, fov: f64, lens_radius: f64) -> PyResult<Self> {
        if !(0.0 < fov && fov < 180.0) {
            return Err(invalid(format!(
                "fov is out of range (found {fov}; expected degrees between 0 and 180)"
            )));
        }
        let camera = CameraDesc::perspective(eye.into(), target.into(), up.into(), fov);
        Ok(Self(camera.map_err(|_| no_view(eye, target, up))?.with_lens(lens_radius)))
    }

    /// A pinhole by the lines of a picture: x0, x1, y0, y1 of its edges at distance 1, and the place of its camera,
    /// whose axes are x to the right, y upwards and z backwards.
    #[staticmethod]
    fn pinhole(window: [f64; 4], pose: [[f64; 4]; 4]) -> PyResult<Self> {
        // Camera space is left-handed: its z goes forwards.
        let world_from_camera =
            transform(pose)? * Transform::scale(DVec3::new(1.0, 1.0, -1.0)).map_err(invalid)?;
        let kind = CameraKind::Perspective { fov: 90.0, lens_radius: 0.0, focal_distance: 1.0 };
        Ok(Self(CameraDesc { screen_window: Some(window), ..CameraDesc::new(kind, world_from_camera) }))
    }

    #[staticmethod]
    fn orthographic(eye: Triple, target: Triple, up: Triple, height: f64) -> PyResult<Self> {
        let camera = CameraDesc::orthographic(eye.into(), target.into(), up.into(), height);
        Ok(Self(camera.map_err(|_| no_view(eye, target, up))?))
    }

    #[staticmethod]
    fn panorama(eye: Triple, target: Triple, up: Triple) -> PyResult<Self> {
        let camera = CameraDesc::panorama(eye.into(), target.into(), up.into());
        Ok(Self(camera.map_err(|_| no_view(eye, target, up))?))
    }

    /// The rays through the centres of the pixels of a picture: origins and directions.
    fn rays<'py>(
        &self,
        py: Python<'py>,
        width: u32,
        height: u32,
    ) -> PyResult<[Bound<'py, PyArray3<f64>>; 2]> {
        let view = CameraView::new(&self.0, width, height);
        let (mut origins, mut directions) = (Vec::new(), Vec::new());
        for y in 0..height {
            for x in 0..width {
                let film = DVec2::new(f64::from(x) + 0.5, f64::from(y) + 0.5);
                let ray = view.ray(film, DVec2::splat(0.5), view.time(0.0), 1.0).ray;
                origins.extend(ray.origin.to_array());
                directions.extend(ray.direction.to_array());
            }
        }
        let array = |numbers| PyArray1::from_vec(py, numbers).reshape([height as usize, width as usize, 3]);
        Ok([array(origins)?, array(directions)?])
    }
}

fn no_view(eye: Triple, target: Triple, up: Triple) -> PyErr {
    let (view, upwards) = (DVec3::from(target) - DVec3::from(eye), DVec3::from(up));
    let is_view = view.is_finite() && upwards.is_finite() && view.length() > 0.0 && upwards.length() > 0.0;
    if is_view && view.normalize().cross(upwards.normalize()).length() < 1e-9 {
        let other = if view.normalize().z.abs() > 0.9 { "(0, 1, 0)" } else { "(0, 0, 1)" };
        return invalid(format!(
            "up is parallel to the view (found up {} and a view along {}; give another, such as up={other})",
            tuple(&up),
            tuple(&view.to_array())
        ));
    }
    let [eye, target, up] = [eye, target, up].map(|place| tuple(&place));
    invalid(format!(
        "a camera at {eye} does not see {target} with {up} upwards (expected two places, and another direction up)"
    ))
}

/// A map of a (4, 4) matrix.
pub(crate) fn transform(matrix: [[f64; 4]; 4]) -> PyResult<Transform> {
    Transform::from_matrix(DMat4::from_cols_array_2d(&matrix).transpose()).map_err(invalid)
}
