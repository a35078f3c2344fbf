//! POV-Ray's camera of meshes, whose rays leave the faces of meshes.

use std::sync::Arc;

use lumbre_math::{DVec2, DVec3, Transform, Vec2, Vec3};

/// Up to this many faces are tested one after another.
const LEAF: usize = 8;

/// A triangle that rays of a [`MeshCamera`] leave.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct CameraFace {
    /// Its corners, clockwise as seen from where its ray goes.
    pub corners: [Vec3; 3],
    /// The normals at its corners, of any length.
    pub normals: [Vec3; 3],
    /// The texture coordinates of its corners.
    pub uvs: [Vec2; 3],
}

/// Which ray of which pixel leaves which face. Pixels are numbered row by row from the top left.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum FaceChoice {
    /// Ray i of a pixel: of mesh i, the face with the number of the pixel.
    MeshPerRay,
    /// As if all meshes were one: the rays 0 of all pixels leave the first faces, the rays 1 the next, and so on.
    Joined,
    /// The picture is a row of equally wide parts, one for each mesh: the face with the number of the pixel in its
    /// part, but for its column, which counts from the left of the picture.
    SideBySide,
    /// The first face of the first mesh whose texture coordinates cover the place in the picture, from (0, 0) at the
    /// lower left to (1, 1). The ray leaves the face there.
    ByUv {
        /// Whether rays go along interpolated normals.
        is_smooth: bool,
    },
}

/// A camera whose rays leave the faces of meshes: the middle of a face, unless the choice is by texture coordinates,
/// and straight away from it.
#[derive(Clone, Debug, PartialEq)]
pub struct MeshCamera {
    choice: FaceChoice,
    rays: u32,
    /// The faces of each mesh with its place.
    meshes: Vec<(Arc<[CameraFace]>, Transform)>,
    by_uv: UvTree,
    offset: f64,
    is_reversed: bool,
}

impl MeshCamera {
    /// `rays` is how many leave each pixel, at least 1. Rays start at the distance `offset` in front of their faces,
    /// and go the other way if they are reversed.
    pub fn new(
        choice: FaceChoice,
        rays: u32,
        meshes: Vec<(Arc<[CameraFace]>, Transform)>,
        offset: f64,
        is_reversed: bool,
    ) -> Self {
        let by_uv = match (choice, meshes.first()) {
            (FaceChoice::ByUv { .. }, Some((faces, _))) => UvTree::new(faces),
            _ => UvTree::default(),
        };
        Self { choice, rays: rays.max(1), meshes, by_uv, offset, is_reversed }
    }

    /// How many rays each pixel has.
    pub fn rays(&self) -> u32 {
        self.rays
    }

    /// The origin and the direction, of any length, of the ray at a point of the film, in pixels. `part` from 0 to 1
    /// chooses among the rays of a pixel. `None` where there is no face.
    pub(crate) fn line(&self, film: DVec2, part: f64, [width, height]: [u32; 2]) -> Option<(DVec3, DVec3)> {
        let ray = ((part * f64::from(self.rays)) as usize).min(self.rays as usize - 1);
        let in_picture = |x: f64, size: u32| (0.0 <= x && x < f64::from(size)).then_some(x as usize);
        let column = in_picture(film.x, width)?;
        // POV-Ray 3.7 shows the first row of faces twice, and the last one not at all.
        let row = in_picture(film.y, height)?.saturating_sub(1);
        let wide = width as usize;
        match self.choice {
            FaceChoice::MeshPerRay => self.straight(ray, row * wide + column),
            FaceChoice::Joined => {
                let mut number = (ray * height as usize + row) * wide + column;
                for (mesh, (faces, _)) in self.meshes.iter().enumerate() {
                    if number < faces.len() {
                        return self.straight(mesh, number);
                    }
                    number -= faces.len();
                }
                None
            }
            FaceChoice::SideBySide => {
                let count = self.meshes.len().max(1);
                let mesh = (film.x.floor() + 0.5) * count as f64 / f64::from(width);
                self.straight(mesh as usize, row * (wide / count) + column)
            }
            FaceChoice::ByUv { is_smooth } => {
                // Places in POV-Ray's pictures are half a pixel to the left and above, except at these two edges.
                let x = (film.x - 0.5).min(f64::from(width) - 1.5);
                let y = (film.y - 0.5).max(0.5);
                let uv = DVec2::new(x / f64::from(width), 1.0 - y / f64::from(height));
                let (faces, map) = self.meshes.first()?;
                let (number, weights) = self.by_uv.first(faces, uv)?;
                let face = &faces[number];
                let at = |of: [Vec3; 3]| (0..3).map(|i| weights[i] * of[i].as_dvec3()).sum::<DVec3>();
                let normal = if is_smooth { at(face.normals) } else { face.normal() };
                self.leaving(map, at(face.corners), normal)
            }
        }
    }

    /// The ray from the middle of a face.
    fn straight(&self, mesh: usize, number: usize) -> Option<(DVec3, DVec3)> {
        let (faces, map) = self.meshes.get(mesh)?;
        let face = faces.get(number)?;
        let middle = face.corners.iter().map(|corner| corner.as_dvec3()).sum::<DVec3>() / 3.0;
        self.leaving(map, middle, face.normal())
    }

    fn leaving(&self, map: &Transform, from: DVec3, normal: DVec3) -> Option<(DVec3, DVec3)> {
        let normal = map.normal(normal).try_normalize()?;
        let origin = map.point(from) + self.offset * normal;
        Some((origin, if self.is_reversed { -normal } else { normal }))
    }
}

impl CameraFace {
    /// The direction that its ray goes, of any length.
    fn normal(&self) -> DVec3 {
        let [a, b, c] = self.corners.map(|corner| corner.as_dvec3());
        (c - a).cross(b - a)
    }

    /// The weights of its corners at texture coordinates that it covers.
    fn covering(&self, uv: DVec2) -> Option<[f64; 3]> {
        let [a, b, c] = self.uvs.map(|uv| uv.as_dvec2());
        let (u, v, w) = (b - a, c - a, uv - a);
        let area = u.perp_dot(v);
        let (second, third) = (w.perp_dot(v) / area, u.perp_dot(w) / area);
        let first = 1.0 - second - third;
        // What lies on the line between two faces belongs to both.
        const EDGE: f64 = -1e-9;
        (first >= EDGE && second >= EDGE && third >= EDGE).then_some([first, second, third])
    }
}

/// Boxes around ever fewer faces, by texture coordinates.
#[derive(Clone, Debug, Default, PartialEq)]
struct UvTree {
    nodes: Vec<UvNode>,
    order: Vec<u32>,
}

#[derive(Clone, Copy, Debug, PartialEq)]
struct UvNode {
    low: DVec2,
    high: DVec2,
    /// Which of the faces are in it.
    first: usize,
    count: usize,
    /// The second of its children, the first follows it; 0 for a leaf.
    second: usize,
}

impl UvTree {
    fn new(faces: &[CameraFace]) -> Self {
        let mut tree = Self { nodes: Vec::new(), order: (0..faces.len() as u32).collect() };
        // What is still to be split, with the parent whose second child it is.
        let mut open = vec![(0, faces.len(), None::<usize>)];
        while let Some((first, count, parent)) = open.pop() {
            let index = tree.nodes.len();
            if let Some(parent) = parent {
                tree.nodes[parent].second = index;
            }
            let some = &mut tree.order[first..first + count];
            let uvs = || some.iter().flat_map(|face| faces[*face as usize].uvs).map(|uv| uv.as_dvec2());
            let low = uvs().fold(DVec2::splat(f64::INFINITY), DVec2::min);
            let high = uvs().fold(DVec2::splat(f64::NEG_INFINITY), DVec2::max);
            tree.nodes.push(UvNode { low, high, first, count, second: 0 });
            if count <= LEAF {
                continue;
            }
            let axis = usize::from(high.y - low.y > high.x - low.x);
            let middle = |face: &u32| faces[*face as usize].uvs.iter().map(|uv| uv[axis]).sum::<f32>();
            let half = count / 2;
            some.select_nth_unstable_by(half, |a, b| middle(a).total_cmp(&middle(b)));
            open.push((first + half, count - half, Some(index)));
            open.push((first, half, None));
        }
        tree
    }

    /// The least number of the faces that cover a place, with the weights of its corners there.
    fn first(&self, faces: &[CameraFace], uv: DVec2) -> Option<(usize, [f64; 3])> {
        let mut best: Option<(usize, [f64; 3])> = None;
        let mut open = vec![0];
        while let Some(index) = open.pop() {
            let Some(node) = self.nodes.get(index) else { break };
            let margin = DVec2::splat(1e-6);
            if uv.cmplt(node.low - margin).any() || uv.cmpgt(node.high + margin).any() {
                continue;
            }
            if node.second != 0 {
                open.extend([node.second, index + 1]);
                continue;
            }
            for &face in &self.order[node.first..node.first + node.count] {
                let face = face as usize;
                if best.is_none_or(|(number, _)| face < number)
                    && let Some(weights) = faces[face].covering(uv)
                {
                    best = Some((face, weights));
                }
            }
        }
        best
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn face(corners: [[f32; 3]; 3]) -> CameraFace {
        CameraFace { corners: corners.map(Vec3::from_array), normals: [Vec3::Z; 3], uvs: [Vec2::ZERO; 3] }
    }

    /// Triangles of this x, which look towards -z.
    fn row(places: &[f32]) -> (Arc<[CameraFace]>, Transform) {
        let at = |&x: &f32| face([[x, 0.0, 0.0], [x + 1.0, 0.0, 0.0], [x, 1.0, 0.0]]);
        (places.iter().map(at).collect(), Transform::IDENTITY)
    }

    /// The x where the rays of a picture meet the plane z = -3 or z = 3, and which of them; `None` without a ray.
    fn seen(camera: &MeshCamera, size: [u32; 2], part: f64) -> Vec<Option<(f64, bool)>> {
        let pixels = (0..size[1]).flat_map(|y| (0..size[0]).map(move |x| DVec2::new(x.into(), y.into())));
        let lines = pixels.map(|pixel| camera.line(pixel + DVec2::splat(0.5), part, size));
        let hit = |(origin, direction): (DVec3, DVec3)| {
            let is_back = direction.z > 0.0;
            let t = (if is_back { 3.0 } else { -3.0 } - origin.z) / direction.z;
            ((1e3 * (origin.x + t * direction.x)).round() / 1e3, is_back)
        };
        lines.map(|line| line.map(hit)).collect()
    }

    fn fronts(places: &[f64]) -> Vec<Option<(f64, bool)>> {
        places.iter().map(|&x| Some((x, false))).collect()
    }

    // All places are those of POV-Ray 3.7 for the same meshes.

    #[test]
    fn a_ray_leaves_a_face_by_the_order_of_its_corners() {
        let slanted = face([[0.0, 0.0, 0.0], [1.0, 0.0, -1.0], [0.0, 1.0, 0.0]]);
        let [a, b, c] = slanted.corners;
        let faces: Arc<[CameraFace]> = [slanted, CameraFace { corners: [a, c, b], ..slanted }].into();
        let camera = |is_reversed, map: Transform| {
            let meshes = vec![(Arc::clone(&faces), map)];
            MeshCamera::new(FaceChoice::MeshPerRay, 1, meshes, -0.5, is_reversed)
        };
        let (front, back) = (Some((-2.333, false)), Some((3.667, true)));
        assert_eq!(seen(&camera(false, Transform::IDENTITY), [2, 1], 0.5), [front, back]);
        assert_eq!(seen(&camera(true, Transform::IDENTITY), [2, 1], 0.5), [back, front]);
        let mirror = Transform::scale(DVec3::new(-1.0, 1.0, 1.0)).unwrap();
        assert_eq!(seen(&camera(false, mirror), [1, 1], 0.5), fronts(&[2.333]));
        let wide = Transform::scale(DVec3::new(2.0, 1.0, 1.0)).unwrap();
        assert_eq!(seen(&camera(false, wide), [1, 1], 0.5), fronts(&[-0.667]));
        // It starts half a unit behind the face, whichever way it goes.
        for is_reversed in [false, true] {
            let (origin, _) =
                camera(is_reversed, Transform::IDENTITY).line(DVec2::splat(0.5), 0.5, [1, 1]).unwrap();
            let normal = DVec3::new(-1.0, 0.0, -1.0).normalize();
            let expected = DVec3::new(1.0, 1.0, -1.0) / 3.0 - 0.5 * normal;
            assert!(origin.distance(expected) < 1e-6, "{origin}");
        }
    }

    #[test]
    fn pixels_are_numbered_through_meshes_or_beside_each_other() {
        let meshes = || vec![row(&[-8.0, -6.0, -4.0]), row(&[0.0, 2.0, 4.0, 6.0, 8.0])];
        let camera = |choice, rays| MeshCamera::new(choice, rays, meshes(), 0.0, false);
        let per_ray = camera(FaceChoice::MeshPerRay, 2);
        let mut first = fronts(&[-7.667, -5.667, -3.667]);
        first.push(None);
        assert_eq!(seen(&per_ray, [4, 1], 0.25), first);
        assert_eq!(seen(&per_ray, [4, 1], 0.75), fronts(&[0.333, 2.333, 4.333, 6.333]));
        let joined = camera(FaceChoice::Joined, 2);
        assert_eq!(seen(&joined, [4, 1], 0.25), fronts(&[-7.667, -5.667, -3.667, 0.333]));
        assert_eq!(seen(&joined, [4, 1], 0.75), fronts(&[2.333, 4.333, 6.333, 8.333]));
        let beside = camera(FaceChoice::SideBySide, 1);
        assert_eq!(seen(&beside, [4, 1], 0.5), fronts(&[-7.667, -5.667, 4.333, 6.333]));
        assert_eq!(seen(&beside, [5, 1], 0.5), fronts(&[-7.667, -5.667, 4.333, 6.333, 8.333]));
        // The first row is there twice.
        let tall = MeshCamera::new(FaceChoice::MeshPerRay, 1, vec![row(&[0.0, 2.0, 4.0, 6.0])], 0.0, false);
        assert_eq!(seen(&tall, [1, 4], 0.5), fronts(&[0.333, 0.333, 2.333, 4.333]));
    }

    #[test]
    fn texture_coordinates_say_where_on_which_face_a_ray_starts() {
        let big = CameraFace {
            corners: [Vec3::ZERO, Vec3::new(8.0, 0.0, 0.0), Vec3::new(0.0, 8.0, 0.0)],
            normals: [Vec3::NEG_Z, Vec3::new(0.5, 0.0, -1.0).normalize(), Vec3::NEG_Z],
            uvs: [Vec2::ZERO, Vec2::X, Vec2::Y],
        };
        let camera = |is_smooth| {
            let meshes = vec![([big].into(), Transform::IDENTITY)];
            MeshCamera::new(FaceChoice::ByUv { is_smooth }, 1, meshes, 0.0, false)
        };
        let at = |places: [Option<f64>; 4]| places.map(|x| x.map(|x| (x, false)));
        let rows = |a: [f64; 4]| {
            [
                at([Some(a[0]), None, None, None]),
                at([Some(a[0]), Some(a[1]), None, None]),
                at([Some(a[0]), Some(a[1]), Some(a[2]), None]),
                at([Some(a[0]), Some(a[1]), Some(a[2]), Some(a[3])]),
            ]
            .concat()
        };
        assert_eq!(seen(&camera(false), [4, 4], 0.5), rows([0.0, 2.0, 4.0, 5.0]));
        let smooth = seen(&camera(true), [4, 4], 0.5);
        let expected = rows([0.0, 2.345, 4.708, 5.898]);
        for (found, expected) in smooth.iter().zip(&expected) {
            let near = match (found, expected) {
                (Some(found), Some(expected)) => {
                    (found.0 - expected.0).abs() < 0.002 && found.1 == expected.1
                }
                (found, expected) => found == expected,
            };
            assert!(near, "{smooth:?}");
        }
    }

    #[test]
    fn the_tree_finds_the_first_of_all_faces_that_cover_a_place() {
        let uv = |i: u32, k: u32| ((i * k) % 97) as f32 / 96.0;
        let faces: Vec<CameraFace> = (0..200)
            .map(|i| {
                let corner = Vec2::new(uv(i, 31), uv(i, 57));
                let uvs = [corner, corner + Vec2::new(0.2, uv(i, 7) * 0.1), corner + Vec2::new(0.0, 0.25)];
                CameraFace { uvs, ..face([[0.0; 3]; 3]) }
            })
            .collect();
        let tree = UvTree::new(&faces);
        let mut covered = 0;
        for i in 0..300 {
            let place = DVec2::new(uv(i, 13).into(), uv(i, 29).into());
            let expected = faces.iter().position(|face| face.covering(place).is_some());
            assert_eq!(tree.first(&faces, place).map(|(number, _)| number), expected, "{place}");
            covered += u32::from(expected.is_some());
        }
        assert!(covered > 100, "{covered}");
    }
}
