//! Cameras.

use std::collections::HashMap;
use std::rc::Rc;
use std::sync::Arc;

use lumbre_math::{DAffine3, DMat3, DVec2, DVec3, Elementary, Transform, Vec2};
use lumbre_scene::{
    Camera, CameraFace, CameraKind, FaceChoice, MeshCamera, MeshDesc, SphericalMapping, WideProjection,
};

use super::lexer::Kind;
use super::objects::{Form, Object};
use super::value::Value;
use super::{Parser, Result};

/// The radius of the lens of aperture 1: in POV-Ray's pictures, points out of focus blur to discs of this size.
const LENS_RADIUS: f64 = 0.25;

/// A camera as the scene describes it.
#[derive(Clone, Debug)]
pub(super) struct CameraStatement {
    pub kind: Projection,
    pub location: DVec3,
    pub direction: DVec3,
    pub up: DVec3,
    pub right: DVec3,
    pub sky: DVec3,
    pub look_at: Option<DVec3>,
    pub angle: Option<f64>,
    /// The angle upwards of a spherical camera.
    pub height_angle: Option<f64>,
    pub aperture: f64,
    pub focal_point: Option<DVec3>,
    /// Rays through the lens for each pixel.
    pub blur_samples: u32,
    /// Whether the scene gives its frame.
    pub has_frame: bool,
    /// What its rays leave, if it is a `mesh_camera`.
    pub faces: Option<Rc<Faces>>,
}

/// The meshes of a `mesh_camera`.
#[derive(Debug)]
pub(super) struct Faces {
    choice: FaceChoice,
    /// Of each pixel.
    rays: u32,
    meshes: Vec<(Arc<[CameraFace]>, Transform)>,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Projection {
    Perspective,
    Orthographic,
    Fisheye,
    UltraWide,
    Panoramic,
    /// 1 to 4.
    Cylinder(u32),
    Spherical,
}

impl CameraStatement {
    pub(super) const DEFAULT: Self = Self {
        kind: Projection::Perspective,
        location: DVec3::ZERO,
        direction: DVec3::Z,
        up: DVec3::Y,
        right: DVec3::new(1.33, 0.0, 0.0),
        sky: DVec3::Y,
        look_at: None,
        angle: None,
        height_angle: None,
        aperture: 0.0,
        focal_point: None,
        blur_samples: 0,
        has_frame: false,
        faces: None,
    };

    /// Width over height of the picture that it is made for.
    pub(super) fn aspect(&self) -> f64 {
        self.right.length() / self.up.length()
    }

    /// Turns to what it looks at, by the angle that it has.
    fn aim(&mut self) {
        if let Some(angle) = self.angle
            && matches!(self.kind, Projection::Perspective | Projection::Orthographic)
        {
            let slope = (0.5 * angle.to_radians()).tangent();
            let length = 0.5 * self.right.length() / slope;
            self.direction = self.direction.normalize_or(DVec3::Z) * length;
        }
        let mut distance = None;
        if let Some(target) = self.look_at.take() {
            let way = target - self.location;
            if let Some(unit) = way.try_normalize() {
                distance = Some(way.length());
                let is_left = self.up.cross(self.direction).dot(self.right) > 0.0;
                let (right, up, length) = (self.right.length(), self.up.length(), self.direction.length());
                let sideways = self.sky.cross(unit);
                let side = sideways.try_normalize().unwrap_or_else(|| self.right.normalize_or(DVec3::X));
                self.direction = unit * length;
                self.up = unit.cross(side) * up;
                self.right = side * if is_left { right } else { -right };
            }
        }
        if self.kind == Projection::Orthographic
            && let Some(distance) = distance
            && (self.angle.is_some() || !self.has_frame)
        {
            let scale = distance / self.direction.length();
            self.right *= scale;
            self.up *= scale;
        }
    }

    fn move_by(&mut self, map: &Transform) {
        self.location = map.point(self.location);
        self.direction = map.vector(self.direction);
        self.up = map.vector(self.up);
        self.right = map.vector(self.right);
        self.focal_point = self.focal_point.map(|p| map.point(p));
    }

    /// Whether it has a lens, in which points out of focus blur.
    pub(super) fn has_lens(&self) -> bool {
        self.aperture > 0.0 && self.focal_point.is_some()
    }

    /// Samples of each pixel that it asks for, if its rays are not all alike.
    pub(super) fn samples(&self) -> Option<u32> {
        match &self.faces {
            Some(faces) => Some(faces.rays).filter(|rays| *rays > 1),
            None => Some(self.blur_samples).filter(|_| self.has_lens()),
        }
    }

    /// The camera of the scene; `None` if its axes lie in a plane.
    pub(super) fn camera(&self) -> Option<Camera> {
        if let Some(Faces { choice, rays, meshes }) = self.faces.as_deref() {
            let is_reversed = self.direction.z < 0.0;
            let camera = MeshCamera::new(*choice, *rays, meshes.clone(), self.location.z, is_reversed);
            return Some(Camera::new(CameraKind::Mesh(Arc::new(camera)), Transform::IDENTITY));
        }
        let (right, up, direction) = (self.right, self.up, self.direction);
        let lengths = DVec3::new(right.length(), up.length(), direction.length());
        let is_square = right.dot(up).abs() < 1e-9 * lengths.x * lengths.y
            && right.dot(direction).abs() < 1e-9 * lengths.x * lengths.z
            && up.dot(direction).abs() < 1e-9 * lengths.y * lengths.z;
        // Unit axes where they can be, so that a lens is round; else those of the scene, askew.
        let (axes, half) = if is_square {
            let scale = if self.kind == Projection::Orthographic { 1.0 } else { lengths.z };
            (
                DMat3::from_cols(right / lengths.x, up / lengths.y, direction / lengths.z),
                lengths * (0.5 / scale),
            )
        } else {
            (DMat3::from_cols(right, up, direction), DVec3::splat(0.5))
        };
        let map = Transform::from_affine(DAffine3 { matrix3: axes, translation: self.location }).ok()?;
        let focal_distance = self.focal_point.map_or(1.0, |p| map.inverse_point(p).z);
        let lens_radius =
            if self.has_lens() && focal_distance > 0.0 { LENS_RADIUS * self.aperture } else { 0.0 };
        if let Some(wide) = self.wide(lengths) {
            let mapping = SphericalMapping::Wide(wide);
            return Some(Camera::new(CameraKind::Spherical { mapping }, map));
        }
        let kind = match self.kind {
            Projection::Perspective => CameraKind::Perspective { fov: 90.0, lens_radius, focal_distance },
            _ => CameraKind::Orthographic { lens_radius, focal_distance },
        };
        let mut camera = Camera::new(kind, map);
        camera.screen_window = Some([-half.x, half.x, -half.y, half.y]);
        Some(camera)
    }

    /// The wide projection of the camera, if it has one; by the lengths of its axes.
    fn wide(&self, lengths: DVec3) -> Option<WideProjection> {
        let angle = self.angle.unwrap_or(90.0);
        Some(match self.kind {
            Projection::Perspective | Projection::Orthographic => return None,
            Projection::Fisheye => WideProjection::Fisheye {
                angle: self.angle.unwrap_or(180.0),
                size: DVec2::new(lengths.x, lengths.y),
            },
            Projection::UltraWide => {
                WideProjection::UltraWide { angles: DVec2::new(angle, angle * lengths.y / lengths.x) }
            }
            Projection::Panoramic => WideProjection::Panoramic { axes: lengths },
            Projection::Cylinder(kind) if kind % 2 == 1 => {
                WideProjection::UprightCylinder { angle, height: lengths.y, moves: kind == 3 }
            }
            Projection::Cylinder(kind) => {
                WideProjection::LyingCylinder { angle, width: lengths.x, moves: kind == 4 }
            }
            Projection::Spherical => {
                let across = self.angle.unwrap_or(360.0);
                let upwards = self.height_angle.unwrap_or(0.5 * across);
                WideProjection::Sphere { angles: DVec2::new(across, upwards) }
            }
        })
    }
}

impl Parser<'_, '_> {
    /// A camera in braces, from one without them.
    pub(super) fn camera_block(&mut self, mut camera: CameraStatement) -> Result<CameraStatement> {
        let outer = self.declaring.take();
        self.expect(b'{')?;
        let mut moves = Vec::new();
        // Before version 3.5 what comes later changes what has been aimed.
        let in_order = self.settings.version < 3.5;
        while !self.take(b'}')? {
            if self.take(b',')? {
                continue;
            }
            let is_transform = matches!(
                self.word()?.as_deref(),
                Some("translate" | "rotate" | "scale" | "matrix" | "transform")
            );
            if is_transform && let Some(map) = self.transform()? {
                self.budget.bytes(size_of_val(&map) as u64, "transforms of a camera")?;
                moves.push(map);
                continue;
            }
            let Some(word) = self.word()? else { return Err(self.unexpected("what a camera has")) };
            self.peeked = None;
            match &*word {
                "perspective" => camera.kind = Projection::Perspective,
                "orthographic" => camera.kind = Projection::Orthographic,
                "fisheye" => camera.kind = Projection::Fisheye,
                "ultra_wide_angle" => camera.kind = Projection::UltraWide,
                "panoramic" => camera.kind = Projection::Panoramic,
                "spherical" => camera.kind = Projection::Spherical,
                "omnimax" => self.warn("the camera omnimax is rendered in perspective"),
                "cylinder" => camera.kind = Projection::Cylinder(self.whole(1.0, 4.0)?),
                "mesh_camera" => camera.faces = Some(Rc::new(self.faces()?)),
                "user_defined" => {
                    self.warn("the camera user_defined is rendered in perspective");
                    self.expect(b'{')?;
                    self.skip_to(b'}')?;
                }
                "location" => camera.location = self.vector()?,
                "direction" => camera.direction = self.vector()?,
                "up" => {
                    camera.up = self.vector()?;
                    camera.has_frame = true;
                }
                "right" => {
                    camera.right = self.vector()?;
                    camera.has_frame = true;
                }
                "sky" => camera.sky = self.vector()?,
                "look_at" => {
                    camera.look_at = Some(self.vector()?);
                    if in_order {
                        camera.aim();
                    }
                }
                "angle" => {
                    camera.angle = Some(self.finite()?);
                    if self.take(b',')? || matches!(self.peek()?, Some(Kind::Number(_))) {
                        camera.height_angle = Some(self.finite()?);
                    }
                    if in_order {
                        camera.aim();
                    }
                }
                "aperture" => camera.aperture = self.finite()?,
                "focal_point" => camera.focal_point = Some(self.vector()?),
                "blur_samples" => {
                    // The first of two is the smaller number, with which POV-Ray starts.
                    let mut samples = self.finite()?;
                    if self.take(b',')? {
                        samples = samples.max(self.finite()?);
                    }
                    camera.blur_samples = samples.clamp(0.0, 65_536.0) as u32;
                }
                "confidence" | "variance" => {
                    self.float()?;
                }
                "normal" => {
                    self.warn("the normal of a camera is not rendered");
                    self.expect(b'{')?;
                    self.skip_to(b'}')?;
                }
                _ => match self.known(&word)? {
                    Some(Value::Camera(known)) => {
                        camera = (*known).clone();
                        moves.clear();
                    }
                    Some(other) => {
                        return Err(self.error(format!("a camera is needed, not {}", other.name())));
                    }
                    None if super::words::is_reserved(&word) => {
                        return Err(self.error(format!("{word} has no meaning for a camera")));
                    }
                    None => return Err(self.undeclared(&word)),
                },
            }
        }
        // Wherever they stand, transforms move what has been aimed.
        if !in_order {
            camera.aim();
        }
        if camera.kind == Projection::Perspective {
            camera.angle = None;
        }
        for map in moves {
            camera.move_by(&map);
        }
        self.declaring = outer;
        Ok(camera)
    }

    /// The meshes of a `mesh_camera`.
    fn faces(&mut self) -> Result<Faces> {
        self.expect(b'{')?;
        let rays = self.whole(1.0, 65_536.0)?;
        self.comma()?;
        let distribution = self.finite()?;
        if ![0.0, 1.0, 2.0, 3.0].contains(&distribution) {
            return Err(self.error("the distribution of a mesh_camera is 0, 1, 2 or 3"));
        }
        self.comma()?;
        let mut is_smooth = false;
        let mut meshes = Vec::new();
        // A mesh that is there many times has its faces once.
        let mut known: HashMap<usize, (Arc<MeshDesc>, Arc<[CameraFace]>)> = HashMap::new();
        while !self.take(b'}')? {
            if self.take(b',')? {
                continue;
            }
            if self.take_word("smooth")? {
                is_smooth = true;
            } else if matches!(self.word()?.as_deref(), Some("mesh" | "mesh2")) {
                let Some(object) = self.object()? else { return Err(self.unexpected("a mesh")) };
                let mut found = Vec::new();
                meshes_of(&object, &Transform::IDENTITY, &mut found);
                for (mesh, map) in found {
                    let key = Arc::as_ptr(&mesh) as usize;
                    let faces = match known.get(&key) {
                        Some((_, faces)) => Arc::clone(faces),
                        None => {
                            let count = mesh.triangles.len() as u64;
                            self.budget.bytes(count * size_of::<CameraFace>() as u64, "faces of a camera")?;
                            let faces = camera_faces(&mesh);
                            known.insert(key, (mesh, Arc::clone(&faces)));
                            faces
                        }
                    };
                    let size = size_of::<(Arc<[CameraFace]>, Transform)>();
                    self.budget.bytes(size as u64, "meshes of a camera")?;
                    meshes.push((faces, map));
                }
            } else if self.float()? > 0.0 {
                self.warn("the greatest distance of a mesh_camera has no effect");
            }
        }
        if meshes.is_empty() {
            return Err(self.error("a mesh_camera without meshes"));
        }
        let choice = match distribution as u32 {
            0 => FaceChoice::MeshPerRay,
            1 => FaceChoice::Joined,
            2 => FaceChoice::SideBySide,
            _ => FaceChoice::ByUv { is_smooth },
        };
        // The others have but one.
        let rays = if distribution < 2.0 { rays } else { 1 };
        Ok(Faces { choice, rays, meshes })
    }
}

/// The meshes that an object consists of, with their places.
fn meshes_of(object: &Object, parent: &Transform, found: &mut Vec<(Arc<MeshDesc>, Transform)>) {
    let map = *parent * object.transform;
    match &object.form {
        Form::Mesh(mesh, _) => found.push((Arc::clone(mesh), map)),
        Form::Group(_, parts) => parts.iter().for_each(|part| meshes_of(part, &map, found)),
        _ => {}
    }
}

/// A camera for values.
pub(super) fn shared(camera: CameraStatement) -> Value {
    Value::Camera(Rc::new(camera))
}

/// The faces of a mesh for cameras: corners in the order in which the scene writes them.
fn camera_faces(mesh: &MeshDesc) -> Arc<[CameraFace]> {
    let face = |triangle: &[u32; 3]| {
        let mut order = *triangle;
        order.sort_unstable();
        let corners = order.map(|i| mesh.positions[i as usize]);
        let [a, b, c] = corners;
        let flat = (c - a).cross(b - a);
        let normals = mesh.normals.as_ref();
        let uvs = mesh.uvs.as_ref();
        CameraFace {
            corners,
            normals: order.map(|i| normals.map_or(flat, |normals| normals[i as usize])),
            uvs: order.map(|i| uvs.map_or(Vec2::ZERO, |uvs| uvs[i as usize])),
        }
    };
    mesh.triangles.iter().map(face).collect()
}
