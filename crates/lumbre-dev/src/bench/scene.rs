//! What is traced: meshes in single precision, spheres, exact shapes and placed meshes, the same for every program.

use std::sync::Arc;

use lumbre_geometry::{CurveBasis, CurveKind, Curves, PlacedShape, Strand};
use lumbre_kernel::{SphereCloud, TriangleMesh};
use lumbre_math::{DAffine3, DMat3, DVec3, Transform};

/// A scene as plain data. Every program makes its own tree of it.
pub(crate) struct Scene {
    /// What the table calls it.
    pub name: String,
    /// Meshes that stand in the world as they are. Their origins are zero.
    pub meshes: Vec<Arc<TriangleMesh>>,
    /// Centre and radius of spheres. Their origin is zero.
    pub spheres: Arc<SphereCloud>,
    /// Flat cubic curves of one segment each, as Embree takes them; empty for most scenes.
    pub curves: Arc<Hair>,
    /// Exact shapes of every kind.
    pub shapes: Arc<Vec<PlacedShape>>,
    /// Meshes that stand in the world only where `placements` say. Their origins are zero.
    pub placed_meshes: Vec<Arc<TriangleMesh>>,
    /// Copies of `placed_meshes`.
    pub placements: Vec<Placement>,
    /// Where primary rays come from.
    pub camera: Camera,
    /// The middle of a square lamp that faces down, and its side.
    pub lamp: (DVec3, f64),
}

/// A copy of a mesh.
#[derive(Clone, Copy)]
pub(crate) struct Placement {
    /// Position in [`Scene::placed_meshes`].
    pub mesh: usize,
    /// Where it stands: three columns and the translation, in single precision because that is what all can take.
    pub world_from_object: [[f32; 3]; 4],
}

impl Placement {
    /// The map in double precision, the same numbers.
    ///
    /// # Panics
    /// When it is not invertible; the scenes of this crate make no such placement.
    pub(crate) fn transform(&self) -> Transform {
        let [x, y, z, offset] = self.world_from_object.map(|column| DVec3::from_array(column.map(f64::from)));
        let affine = DAffine3 { matrix3: DMat3::from_cols(x, y, z), translation: offset };
        Transform::from_affine(affine).expect("placements are invertible")
    }
}

/// A pinhole camera with y up.
#[derive(Clone, Copy)]
pub(crate) struct Camera {
    /// Where it stands.
    pub eye: DVec3,
    /// What is in the middle of its picture.
    pub target: DVec3,
    /// The vertical angle of its picture, in degrees.
    pub field_of_view: f64,
}

/// Cubic Bézier curves, which face the ray.
#[derive(Debug, Default)]
pub(crate) struct Hair {
    /// Four control points of each, with their radii.
    pub points: Vec<[[f32; 4]; 4]>,
}

impl Hair {
    /// The curves as Lumbre has them.
    pub(crate) fn curves(&self) -> Curves {
        let mut curves = Curves::new(CurveKind::Flat);
        for points in &self.points {
            let place = points.map(|[x, y, z, _]| DVec3::new(x.into(), y.into(), z.into()));
            let widths = [points[0], points[3]].map(|[.., radius]| 2.0 * f64::from(radius));
            let strand = Strand::new(CurveBasis::Bezier, 3, &place, widths).expect("four points");
            curves.push(&strand).expect("points near one another");
        }
        curves
    }
}

impl Scene {
    /// A scene without anything in it.
    pub(crate) fn empty(name: impl Into<String>, camera: Camera, lamp: (DVec3, f64)) -> Self {
        Self {
            name: name.into(),
            meshes: Vec::new(),
            spheres: Arc::default(),
            curves: Arc::default(),
            shapes: Arc::default(),
            placed_meshes: Vec::new(),
            placements: Vec::new(),
            camera,
            lamp,
        }
    }

    /// A mesh alone, seen from outside, lit from above.
    pub(crate) fn of_mesh(name: impl Into<String>, mesh: TriangleMesh) -> Self {
        let (low, high) = mesh_bounds(&mesh);
        let (center, size) = (0.5 * (low + high), (high - low).max_element());
        let camera =
            Camera { eye: center + size * DVec3::new(0.7, 0.55, 1.1), target: center, field_of_view: 45.0 };
        let lamp = (center + size * DVec3::new(0.4, 1.6, 0.5), 0.3 * size);
        Self { meshes: vec![Arc::new(mesh)], ..Self::empty(name, camera, lamp) }
    }

    /// How many spheres there are.
    pub(crate) fn sphere_count(&self) -> usize {
        self.spheres.spheres.len()
    }

    /// How many primitives a tree is built of: each mesh counts once, each placement as one.
    pub(crate) fn primitive_count(&self) -> usize {
        let triangles = |meshes: &[Arc<TriangleMesh>]| meshes.iter().map(|m| m.indices.len()).sum::<usize>();
        triangles(&self.meshes)
            + triangles(&self.placed_meshes)
            + self.placements.len()
            + self.sphere_count()
            + self.curves.points.len()
            + self.shapes.len()
    }

    /// What it consists of, in words.
    pub(crate) fn contents(&self) -> String {
        let triangles: usize = self.meshes.iter().map(|mesh| mesh.indices.len()).sum();
        let placed: usize = self.placed_meshes.iter().map(|mesh| mesh.indices.len()).sum();
        let parts = [
            (triangles, "triangles"),
            (self.sphere_count(), "spheres"),
            (self.curves.points.len(), "curves"),
            (self.shapes.len(), "exact shapes"),
            (self.placements.len(), "instances"),
            (placed, "triangles in what is placed"),
        ];
        let words: Vec<_> =
            parts.iter().filter(|part| part.0 > 0).map(|(count, word)| format!("{count} {word}")).collect();
        words.join(", ")
    }

    /// Whether it consists of triangles alone.
    pub(crate) fn is_triangles_only(&self) -> bool {
        self.spheres.spheres.is_empty() && self.has_neither()
    }

    /// Whether it has no shapes, curves and instances.
    fn has_neither(&self) -> bool {
        self.shapes.is_empty() && self.curves.points.is_empty() && self.placements.is_empty()
    }

    /// Whether it consists of spheres alone.
    pub(crate) fn is_spheres_only(&self) -> bool {
        self.meshes.is_empty() && self.has_neither()
    }
}

/// The corners of the smallest box around a mesh.
pub(crate) fn mesh_bounds(mesh: &TriangleMesh) -> (DVec3, DVec3) {
    mesh.positions
        .iter()
        .map(|p| p.as_dvec3())
        .fold((DVec3::INFINITY, DVec3::NEG_INFINITY), |(low, high), p| (low.min(p), high.max(p)))
}
