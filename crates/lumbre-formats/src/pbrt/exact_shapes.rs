//! The exact shapes, from their parameters.

use lumbre_geometry::{
    Aabb, Capsule, Cone, Cuboid, Cylinder, Disk, Hyperboloid, Paraboloid, Plane, Quadric, Shape, ShapeError,
    Sphere, Torus, Triangle,
};
use lumbre_math::DVec3;

use super::params::{Params, Type};
use super::source::Result;

/// A shape, or what is wrong with its parameters together.
type Made<S> = std::result::Result<S, ShapeError>;

/// The exact shape of this name; `None` for other names.
pub(super) fn exact_shape(ty: &str, params: &Params) -> Result<Option<Made<Shape>>> {
    Ok(Some(match ty {
        "sphere" => sphere(params)?.map(Shape::from),
        "plane" => plane(params)?.map(Shape::from),
        "disk" => disk(params)?.map(Shape::from),
        "triangle" => triangle(params)?.map(Shape::from),
        "box" => cuboid(params)?.map(Shape::from),
        "cylinder" => cylinder(params)?.map(Shape::from),
        "capsule" => capsule(params)?.map(Shape::from),
        "cone" => cone(params)?.map(Shape::from),
        "torus" => torus(params)?.map(Shape::from),
        "paraboloid" => paraboloid(params)?.map(Shape::from),
        "hyperboloid" => hyperboloid(params)?.map(Shape::from),
        "quadric" => quadric(params)?.map(Shape::from),
        _ => return Ok(None),
    }))
}

fn sphere(params: &Params) -> Result<Made<Sphere>> {
    let radius = params.float("radius", 1.0)?;
    let sphere = Sphere::new(params.triple("center", Type::Point3, DVec3::ZERO)?, radius);
    let zmin = params.float_or_infinite("zmin", -radius)?;
    let zmax = params.float_or_infinite("zmax", radius)?;
    let phimax = params.float("phimax", 360.0)?;
    let is_whole = zmin <= -radius && radius <= zmax && phimax == 360.0;
    let part = |s: Sphere| if is_whole { Ok(s) } else { s.partial(zmin, zmax, phimax) };
    Ok(sphere.and_then(part))
}

fn plane(params: &Params) -> Result<Made<Plane>> {
    let normal = params.triple("normal", Type::Normal, DVec3::Z)?;
    Ok(Plane::new(params.triple("point", Type::Point3, DVec3::ZERO)?, normal))
}

fn disk(params: &Params) -> Result<Made<Disk>> {
    let normal = params.triple("normal", Type::Normal, DVec3::Z)?;
    let height = params.float("height", 0.0)?;
    let up = if height == 0.0 { DVec3::ZERO } else { height * normal.normalize_or_zero() };
    let center = params.triple("center", Type::Point3, DVec3::ZERO)? + up;
    let (radius, inner) = (params.float("radius", 1.0)?, params.float("innerradius", 0.0)?);
    let disk = Disk::new(center, normal, radius, inner);
    let phimax = params.float("phimax", 360.0)?;
    Ok(disk.and_then(|d| d.partial(phimax)))
}

fn triangle(params: &Params) -> Result<Made<Triangle>> {
    let corner = |name| -> Result<DVec3> {
        let given = params.triple_opt(name, Type::Point3)?;
        given.ok_or_else(|| params.spot.error(format!("a triangle has no \"point3 {name}\"")))
    };
    Ok(Triangle::new(corner("p0")?, corner("p1")?, corner("p2")?))
}

fn cuboid(params: &Params) -> Result<Made<Cuboid>> {
    Ok(Cuboid::new(
        params.triple("p0", Type::Point3, DVec3::NEG_ONE)?,
        params.triple("p1", Type::Point3, DVec3::ONE)?,
    ))
}

fn cylinder(params: &Params) -> Result<Made<Cylinder>> {
    let radius = params.float("radius", 1.0)?;
    let caps = params.boolean("caps", false)?;
    let cylinder = match ends(params)? {
        Some((p0, p1)) => Cylinder::new(p0, p1, radius, caps),
        None => {
            let zmin = params.float_or_infinite("zmin", -1.0)?;
            let zmax = params.float_or_infinite("zmax", 1.0)?;
            Cylinder::along_z(radius, zmin, zmax, caps)
        }
    };
    let phimax = params.float("phimax", 360.0)?;
    Ok(cylinder.and_then(|c| c.partial(phimax)))
}

fn capsule(params: &Params) -> Result<Made<Capsule>> {
    let (p0, p1) =
        (params.triple("p0", Type::Point3, DVec3::ZERO)?, params.triple("p1", Type::Point3, DVec3::Z)?);
    Ok(Capsule::new(p0, p1, params.float("radius", 0.5)?))
}

fn cone(params: &Params) -> Result<Made<Cone>> {
    let caps = params.boolean("caps", false)?;
    let cone = if params.has("apex") || params.has("axis") || params.has("angle") {
        let Some(angle) = params.float_opt("angle")? else {
            return Err(params.spot.error("a cone with an apex or an axis has no \"float angle\""));
        };
        let axis = params.triple("axis", Type::Vector3, DVec3::Z)?;
        let height = params.float_or_infinite("height", f64::INFINITY)?;
        Cone::nappe(params.triple("apex", Type::Point3, DVec3::ZERO)?, axis, angle, height, caps)
    } else {
        let (radius, top) = (params.float("radius", 1.0)?, params.float("topradius", 0.0)?);
        let (p0, p1) = match ends(params)? {
            Some(ends) => ends,
            None => (DVec3::ZERO, DVec3::new(0.0, 0.0, params.float("height", 1.0)?)),
        };
        Cone::new(p0, p1, radius, top, caps)
    };
    let phimax = params.float("phimax", 360.0)?;
    Ok(cone.and_then(|c| c.partial(phimax)))
}

fn torus(params: &Params) -> Result<Made<Torus>> {
    let axis = params.triple("axis", Type::Vector3, DVec3::Z)?;
    let (major, minor) = (params.float("majorradius", 1.0)?, params.float("minorradius", 0.25)?);
    Ok(Torus::new(params.triple("center", Type::Point3, DVec3::ZERO)?, axis, major, minor))
}

fn paraboloid(params: &Params) -> Result<Made<Paraboloid>> {
    let radius = params.float("radius", 1.0)?;
    let (zmin, zmax) = (params.float("zmin", 0.0)?, params.float("zmax", 1.0)?);
    Ok(Paraboloid::new(radius, zmin, zmax, params.float("phimax", 360.0)?))
}

fn hyperboloid(params: &Params) -> Result<Made<Hyperboloid>> {
    let (p1, p2) =
        (params.triple("p1", Type::Point3, DVec3::ZERO)?, params.triple("p2", Type::Point3, DVec3::ONE)?);
    Ok(Hyperboloid::new(p1, p2, params.float("phimax", 360.0)?))
}

fn quadric(params: &Params) -> Result<Made<Quadric>> {
    let Some(param) = params.typed("coefficients", &[Type::Float])? else {
        return Err(params.spot.error("a quadric has no \"float coefficients\""));
    };
    let clip = ends(params)?.map(|(p0, p1)| Aabb::around([p0, p1]));
    Ok(Quadric::new(param.exactly::<10>()?, clip))
}

/// The two corners or ends, both or none.
fn ends(params: &Params) -> Result<Option<(DVec3, DVec3)>> {
    let p0 = params.triple_opt("p0", Type::Point3)?;
    let p1 = params.triple_opt("p1", Type::Point3)?;
    match (p0, p1) {
        (Some(p0), Some(p1)) => Ok(Some((p0, p1))),
        (None, None) => Ok(None),
        (Some(_), None) => Err(params.spot_of("p0").error("p0 without p1")),
        (None, Some(_)) => Err(params.spot_of("p1").error("p1 without p0")),
    }
}
