//! The rays, made once and shared bit for bit.

use lumbre_geometry::Ray;
use lumbre_kernel::Accel;
use lumbre_math::random::RandomStream;
use lumbre_math::warp64::square_to_cosine_hemisphere;
use lumbre_math::{DVec2, DVec3, Frame};

use crate::scene::Scene;

/// A ray in single precision. Directions are unit but those of shadow rays, which end at `t` = 1 on the lamp.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Ray32 {
    /// Where it starts.
    pub origin: [f32; 3],
    /// Where it goes.
    pub direction: [f32; 3],
    /// How far, in units of the direction. It starts at 0.
    pub t_max: f32,
}

impl Ray32 {
    /// The same ray in double precision.
    pub(crate) fn to_f64(self) -> Ray {
        let wide = |v: [f32; 3]| DVec3::from_array(v.map(f64::from));
        Ray::new(wide(self.origin), wide(self.direction)).with_range(0.0, f64::from(self.t_max))
    }

    /// The same ray as the kernel takes it.
    pub(crate) fn to_ours(self) -> lumbre_kernel::Ray32 {
        lumbre_kernel::Ray32::new(self.origin.into(), self.direction.into()).with_range(0.0, self.t_max)
    }

    fn new(origin: DVec3, direction: DVec3, t_max: f64) -> Self {
        let narrow = |v: DVec3| v.as_vec3().to_array();
        Self { origin: narrow(origin), direction: narrow(direction), t_max: t_max as f32 }
    }
}

/// Where rays come from.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Work {
    /// A pinhole camera, by scanlines.
    Primary,
    /// From where primary rays hit, by the cosine.
    Bounce1,
    /// From where those of the second bounce hit, by the cosine.
    Bounce3,
    /// From where primary rays hit to a lamp.
    Shadow,
    /// From where primary rays hit, by the cosine, a twentieth of the scene far.
    ShortOcclusion,
    /// From anywhere in the scene's box to any direction.
    Random,
}

impl Work {
    /// All of them.
    pub(crate) const ALL: [Self; 6] =
        [Self::Primary, Self::Bounce1, Self::Bounce3, Self::Shadow, Self::ShortOcclusion, Self::Random];

    /// Its name in tables and files.
    pub(crate) fn name(self) -> &'static str {
        match self {
            Self::Primary => "primary",
            Self::Bounce1 => "bounce 1",
            Self::Bounce3 => "bounce 3",
            Self::Shadow => "shadow",
            Self::ShortOcclusion => "short ao",
            Self::Random => "random",
        }
    }
}

/// The size of the picture that primary rays make; both divide by four, for packets are squares of four by four.
#[derive(Clone, Copy, Debug)]
pub(crate) struct PictureSize {
    /// Columns.
    pub width: usize,
    /// Rows.
    pub height: usize,
}

impl PictureSize {
    /// Twice as wide as high, with about `count` pixels.
    pub(crate) fn of_about(count: usize) -> Self {
        let height = ((count as f64 / 2.0).sqrt() / 4.0).round().max(1.0) as usize * 4;
        Self { width: 2 * height, height }
    }

    /// How many pixels.
    pub(crate) fn count(self) -> usize {
        self.width * self.height
    }
}

/// Rays, and another order of them.
pub(crate) struct Rays {
    /// By the scanlines' pixels that they belong to, where they do.
    pub list: Vec<Ray32>,
    /// Their positions in the list, by squares of four by four pixels; where they belong to none, as in the list.
    pub by_squares: Vec<usize>,
}

/// The rays of one kind, about one per pixel. `accel` is asked where rays hit.
pub(crate) fn make(work: Work, scene: &Scene, accel: &Accel, size: PictureSize) -> Rays {
    match work {
        Work::Primary => Rays {
            list: (0..size.count()).map(|pixel| camera_ray(scene, size, pixel, [0.5; 2])).collect(),
            by_squares: by_squares(size),
        },
        Work::Random => {
            let mut random = RandomStream::new(21);
            let bounds = accel.bounds();
            let mut ray = || {
                let mut at = || random.next_f64();
                let from = bounds.min + bounds.size() * DVec3::new(at(), at(), at());
                Ray32::new(from, crate::shaping::direction(&mut random), f64::INFINITY)
            };
            let list: Vec<_> = (0..size.count()).map(|_| ray()).collect();
            Rays { by_squares: (0..list.len()).collect(), list }
        }
        Work::Bounce1 | Work::Bounce3 | Work::Shadow | Work::ShortOcclusion => {
            secondary(work, scene, accel, size)
        }
    }
}

/// From the hits of one camera ray a pixel. Pixels that see nothing are made up for by more rays through the others, in
/// the order of the pixels, at most sixteen times over; where few come so far, by more rays from the same places: a few
/// hundred that are asked again and again are foreseen by the processor, branch by branch.
fn secondary(work: Work, scene: &Scene, accel: &Accel, size: PictureSize) -> Rays {
    const TURNS: u64 = 16;
    let count = size.count();
    let random_of = |turn: u64, number: usize| {
        RandomStream::new(lumbre_math::random::hash_words(&[turn, number as u64, work as u64]))
    };
    let mut list = Vec::with_capacity(count);
    // Of each, where it starts, the turn, and the place of its pixel by squares.
    let (mut starts, mut places) = (Vec::with_capacity(count), Vec::with_capacity(count));
    let mut place_of = vec![0; count];
    for (place, pixel) in by_squares(size).into_iter().enumerate() {
        place_of[pixel] = place;
    }
    let pixels =
        (0..TURNS).flat_map(|turn| place_of.iter().enumerate().map(move |(pixel, &at)| (turn, pixel, at)));
    for (turn, pixel, place) in pixels {
        let random = &mut random_of(turn, pixel);
        let jitter = [random.next_f64(), random.next_f64()];
        let first = camera_ray(scene, size, pixel, jitter);
        if let Some(start) = start_of(work, accel, first, random) {
            list.push(ray_from(work, scene, accel, start, random));
            starts.push(start);
            places.push((turn, place));
        }
        if list.len() == count {
            break;
        }
    }
    let found = list.len();
    if found > 0 {
        for number in found..count {
            let (turn, at) = ((number / found) as u64 + TURNS, number % found);
            list.push(ray_from(work, scene, accel, starts[at], &mut random_of(turn, at)));
            places.push((turn, places[at].1));
        }
    }
    let mut by_squares: Vec<_> = (0..list.len()).collect();
    by_squares.sort_by_key(|&i| places[i]);
    Rays { list, by_squares }
}

/// A place on a surface, moved off it, and the normal there.
type Start = (DVec3, DVec3);

/// Where the ray of a camera ray starts, if that comes so far.
fn start_of(work: Work, accel: &Accel, first: Ray32, random: &mut RandomStream) -> Option<Start> {
    let mut start = leave(accel, first)?;
    if work == Work::Bounce3 {
        for _ in 0..2 {
            start = leave(accel, Ray32::new(start.0, cosine(start.1, random), f64::INFINITY))?;
        }
    }
    Some(start)
}

/// A ray that starts there.
fn ray_from(work: Work, scene: &Scene, accel: &Accel, start: Start, random: &mut RandomStream) -> Ray32 {
    match work {
        Work::Shadow => {
            let (middle, side) = scene.lamp;
            let at = DVec3::new(random.next_f64() - 0.5, 0.0, random.next_f64() - 0.5);
            Ray32::new(start.0, middle + side * at - start.0, 1.0)
        }
        Work::ShortOcclusion => Ray32::new(start.0, cosine(start.1, random), 0.05 * extent_of(accel)),
        Work::Bounce1 | Work::Bounce3 | Work::Primary | Work::Random => {
            Ray32::new(start.0, cosine(start.1, random), f64::INFINITY)
        }
    }
}

/// A direction around a normal, by the cosine.
fn cosine(normal: DVec3, random: &mut RandomStream) -> DVec3 {
    let u = DVec2::new(random.next_f64(), random.next_f64());
    Frame::from_z(normal).to_world(square_to_cosine_hemisphere(u))
}

fn extent_of(accel: &Accel) -> f64 {
    accel.bounds().size().max_element()
}

/// Where a ray hits, moved off the surface, and the normal on the side that it came from. The move is a
/// hundred-thousandth of the scene: far more than single precision rounds off, so that no program finds the surface
/// that a ray starts on.
fn leave(accel: &Accel, ray: Ray32) -> Option<Start> {
    let ray = ray.to_f64();
    let hit = accel.closest(&ray)?;
    let surface = accel.surface(&ray, &hit);
    let normal = if surface.normal.dot(ray.direction) < 0.0 { surface.normal } else { -surface.normal };
    Some((surface.point + 1e-5 * extent_of(accel) * normal, normal))
}

fn camera_ray(scene: &Scene, size: PictureSize, pixel: usize, jitter: [f64; 2]) -> Ray32 {
    let camera = &scene.camera;
    let forward = (camera.target - camera.eye).normalize();
    let right = forward.cross(DVec3::Y).normalize();
    let up = right.cross(forward);
    let half = (camera.field_of_view / 2.0).to_radians().tan();
    let (column, row) = ((pixel % size.width) as f64, (pixel / size.width) as f64);
    let (width, height) = (size.width as f64, size.height as f64);
    let x = ((column + jitter[0]) / width * 2.0 - 1.0) * half * width / height;
    let y = (1.0 - (row + jitter[1]) / height * 2.0) * half;
    Ray32::new(camera.eye, (forward + x * right + y * up).normalize(), f64::INFINITY)
}

/// For packets of sixteen: the scanlines' pixels in the order of squares of four by four.
fn by_squares(size: PictureSize) -> Vec<usize> {
    let squares = (0..size.height / 4).flat_map(|y| (0..size.width / 4).map(move |x| (x, y)));
    squares.flat_map(|(x, y)| (0..16).map(move |i| (4 * y + i / 4) * size.width + 4 * x + i % 4)).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn squares_hold_every_pixel_once_and_neighbours_together() {
        let size = PictureSize { width: 8, height: 12 };
        let order = by_squares(size);
        assert_eq!(order[16..24], [4, 5, 6, 7, 12, 13, 14, 15]);
        let mut sorted = order.clone();
        sorted.sort_unstable();
        assert_eq!(sorted, (0..size.count()).collect::<Vec<_>>());
    }

    #[test]
    fn there_are_as_many_rays_as_pixels_however_few_come_so_far() {
        let recipe = crate::worlds::RECIPES.iter().find(|recipe| recipe.name == "scan-1k").expect("a recipe");
        let scene = recipe.make();
        let accel = crate::ours::build(&scene, lumbre_kernel::Preset::Balanced).expect("a tree");
        let size = PictureSize::of_about(2000);
        for work in Work::ALL {
            let rays = make(work, &scene, &accel, size);
            assert_eq!(rays.list.len(), size.count(), "{work:?}");
            let mut order = rays.by_squares;
            order.sort_unstable();
            assert_eq!(order, (0..size.count()).collect::<Vec<_>>(), "{work:?}");
            let key = |ray: &Ray32| [ray.origin, ray.direction].map(|v| v.map(f32::to_bits));
            let mut keys: Vec<_> = rays.list.iter().map(key).collect();
            keys.sort_unstable();
            keys.dedup();
            assert_eq!(keys.len(), size.count(), "{work:?}: some rays are the same");
            if work == Work::Bounce3 {
                // Hardly one of two thousand bounces off a scan twice.
                let mut starts: Vec<_> = keys.iter().map(|key| key[0]).collect();
                starts.dedup();
                assert!((1..size.count() / 4).contains(&starts.len()), "{}", starts.len());
            }
        }
    }

    #[test]
    fn a_picture_has_about_the_pixels_that_are_asked_for() {
        let size = PictureSize::of_about(130_000);
        assert_eq!((size.width % 4, size.height % 4, size.width), (0, 0, 2 * size.height));
        assert!((120_000..140_000).contains(&size.count()), "{}", size.count());
    }
}
