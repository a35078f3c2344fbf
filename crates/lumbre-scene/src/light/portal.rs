//! Light from all directions through a rectangle only, such as a window.
//!
//! B. Bitterli, C. Wyman, M. Pharr, "Portal-Masked Environment Map Sampling", Computer Graphics Forum 34 (EGSR), 2015.
//! In their map of directions, the rectangle is a rectangle from every viewpoint, so that a summed-area table can
//! sample the visible part.

use std::f64::consts::{FRAC_PI_2, PI};

use lumbre_math::{DMat3, DVec2, DVec3, Elementary};
use lumbre_shading::{Scatter, Spectrum};

use super::LightSample;
use super::environment::Panorama;
use crate::EnvironmentDesc;

/// Light at infinity, visible only through the front of a rectangle.
#[derive(Clone, Debug)]
pub struct PortalLight {
    // The unit axes of the rectangle: its sides, and the direction to the sky.
    axes: DMat3,
    // Two opposite corners.
    corners: [DVec3; 2],
    width: usize,
    height: usize,
    texels: Vec<Spectrum>,
    // For each texel, the sum of the weights of those below and to the left: `width + 1` in a row.
    sums: Vec<f64>,
    // The mean radiance of the hemisphere in front of the rectangle, times its area.
    mean_by_area: f64,
}

/// Maximum deviation of the sides from a rectangle, relative to their length.
const SLACK: f64 = 1e-3;

/// Why a portal is invalid.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum PortalError {
    /// The corners are not those of a rectangle.
    NoRectangle,
    /// It is black.
    Dark,
}

impl PortalLight {
    /// A sky seen through the rectangle with these corners, in order around it. The cross product of the sides from the
    /// first corner to the fourth and from the first to the second points to the sky.
    pub(crate) fn new(
        world_from_light: lumbre_math::Transform,
        radiance: Spectrum,
        image: Option<EnvironmentDesc>,
        [p0, p1, p2, p3]: [DVec3; 4],
    ) -> Result<Self, PortalError> {
        let (across, up) = (p3 - p0, p1 - p0);
        let sides = across.try_normalize().zip(up.try_normalize());
        let (x, y) = sides.ok_or(PortalError::NoRectangle)?;
        let size = across.length().max(up.length());
        let is_rectangle = x.dot(y).abs() < SLACK && (p0 + across + up - p2).length() < SLACK * size;
        if !is_rectangle {
            return Err(PortalError::NoRectangle);
        }
        let axes = DMat3::from_cols(x, y - x * x.dot(y), x.cross(y).normalize());
        let (width, height, texels) = match image {
            None => (1, 1, vec![radiance]),
            Some(EnvironmentDesc { image, mapping }) => {
                let (width, height) = (image.width() as usize, image.height() as usize);
                let sky =
                    Panorama::new(image, mapping, world_from_light, radiance).ok_or(PortalError::Dark)?;
                let texel = |i: usize| {
                    let at = DVec2::new((i % width) as f64 + 0.5, (i / width) as f64 + 0.5);
                    let local = direction_of(at / DVec2::new(width as f64, height as f64));
                    sky.radiance((axes * local).normalize())
                };
                (width, height, (0..width * height).map(texel).collect())
            }
        };
        let mut sums = vec![0.0; (width + 1) * (height + 1)];
        let (mut weight_of_all, mut whole) = (0.0, 0.0);
        for row in 0..height {
            let mut of_row = 0.0;
            for column in 0..width {
                let at = DVec2::new((column as f64 + 0.5) / width as f64, (row as f64 + 0.5) / height as f64);
                let local = direction_of(at);
                let solid_angle = 1.0 / density_of_map(local);
                let mean = f64::from(texels[row * width + column].average());
                of_row += mean * solid_angle;
                weight_of_all += mean * solid_angle * local.z;
                whole += solid_angle * local.z;
                let below = sums[row * (width + 1) + column + 1];
                sums[(row + 1) * (width + 1) + column + 1] = below + of_row;
            }
        }
        let mean_by_area = weight_of_all / whole * across.length() * up.length();
        if mean_by_area > 0.0 && mean_by_area.is_finite() {
            return Ok(Self { axes, corners: [p0, p2], width, height, texels, sums, mean_by_area });
        }
        Err(PortalError::Dark)
    }

    /// The part of the map that is visible from a point: its lower and its upper corner, in texels. `None` if the
    /// rectangle is seen from behind or edge-on.
    fn window(&self, from: DVec3) -> Option<[DVec2; 2]> {
        let size = DVec2::new(self.width as f64, self.height as f64);
        let corner = |p: DVec3| Some(map(self.axes.transpose() * (p - from).try_normalize()?)? * size);
        let (a, b) = (corner(self.corners[0])?, corner(self.corners[1])?);
        let (low, high) = (a.min(b), a.max(b));
        low.cmplt(high).all().then_some([low, high])
    }

    fn texel(&self, at: DVec2) -> usize {
        let column = (at.x as usize).min(self.width - 1);
        let row = (at.y as usize).min(self.height - 1);
        row * self.width + column
    }

    /// The position in the map of a unit direction from a point, in texels, if it passes through the rectangle.
    fn place(&self, from: DVec3, direction: DVec3) -> Option<DVec2> {
        let at = map(self.axes.transpose() * direction)? * DVec2::new(self.width as f64, self.height as f64);
        let [low, high] = self.window(from)?;
        (low.cmple(at).all() && at.cmple(high).all()).then_some(at)
    }

    /// The radiance that arrives at a point along a unit direction from infinity.
    pub(super) fn radiance(&self, from: DVec3, direction: DVec3) -> Spectrum {
        self.place(from, direction).map_or(Spectrum::BLACK, |at| self.texels[self.texel(at)])
    }

    /// The sum of the weights from the lower corner of the map to a position, in texels; linear within each.
    fn sum(&self, x: f64, y: f64) -> f64 {
        let (column, row) = ((x as usize).min(self.width - 1), (y as usize).min(self.height - 1));
        let (right, up) = (x - column as f64, y - row as f64);
        let at = row * (self.width + 1) + column;
        let above = at + self.width + 1;
        let below = self.sums[at] + right * (self.sums[at + 1] - self.sums[at]);
        below + up * (self.sums[above] + right * (self.sums[above + 1] - self.sums[above]) - below)
    }

    /// The sum of the weights of a part of the map.
    fn part(&self, [low, high]: [DVec2; 2]) -> f64 {
        let sum = self.sum(high.x, high.y) - self.sum(low.x, high.y) - self.sum(high.x, low.y);
        (sum + self.sum(low.x, low.y)).max(0.0)
    }

    pub(super) fn sample(&self, from: DVec3, u: DVec2) -> Option<LightSample> {
        let [low, high] = self.window(from)?;
        let all = self.part([low, high]);
        let x = bisect(low.x, high.x, u.x * all, |x| self.part([low, DVec2::new(x, high.y)]));
        // A column of texels is uniform along x.
        let column = x.floor().min(self.width as f64 - 1.0);
        let strip = |y: f64| self.part([DVec2::new(column, low.y), DVec2::new(column + 1.0, y)]);
        let y = bisect(low.y, high.y, u.y * strip(high.y), strip);
        let at = DVec2::new(x, y);
        let local = direction_of(at / DVec2::new(self.width as f64, self.height as f64));
        let radiance = self.texels[self.texel(at)];
        let pdf = self.density(at, local, all);
        (pdf > 0.0 && pdf.is_finite() && !radiance.is_black()).then(|| LightSample {
            towards: (self.axes * local).normalize(),
            end: None,
            radiance,
            scatter: Scatter::Density(pdf as f32),
        })
    }

    pub(super) fn pdf(&self, from: DVec3, direction: DVec3) -> f64 {
        let Some((at, window)) = self.place(from, direction).zip(self.window(from)) else { return 0.0 };
        let pdf = self.density(at, self.axes.transpose() * direction, self.part(window));
        if pdf.is_finite() { pdf } else { 0.0 }
    }

    /// The density of a direction per unit solid angle, if the weights of the window add up to `all`.
    fn density(&self, at: DVec2, local: DVec3, all: f64) -> f64 {
        let texel = self.texel(at);
        let (column, row) = ((texel % self.width) as f64, (texel / self.width) as f64);
        let weight = self.part([DVec2::new(column, row), DVec2::new(column + 1.0, row + 1.0)]);
        weight / all * (self.width * self.height) as f64 * density_of_map(local)
    }

    /// The irradiance at a point of a surface with the unit `normal`, by a sum over the window.
    pub(super) fn irradiance(&self, at: DVec3, normal: DVec3) -> Spectrum {
        const STEPS: u32 = 64;
        let Some([low, high]) = self.window(at) else { return Spectrum::BLACK };
        let size = DVec2::new(self.width as f64, self.height as f64);
        let cell = ((high - low) / size).element_product() / f64::from(STEPS * STEPS);
        let mut sum = Spectrum::BLACK;
        for i in 0..STEPS * STEPS {
            let step = DVec2::new(f64::from(i % STEPS) + 0.5, f64::from(i / STEPS) + 0.5) / f64::from(STEPS);
            let place = low + step * (high - low);
            let local = direction_of(place / size);
            let cosine = (self.axes * local).dot(normal);
            if cosine > 0.0 {
                sum += self.texels[self.texel(place)] * (cosine * cell / density_of_map(local)) as f32;
            }
        }
        sum
    }

    /// An estimate of the power through it.
    pub(super) fn power(&self) -> f64 {
        PI * self.mean_by_area
    }
}

/// The unit direction, relative to the axes of the portal, of a point of the unit square.
fn direction_of(uv: DVec2) -> DVec3 {
    let tangent = |u: f64| (PI * u - FRAC_PI_2).tangent();
    DVec3::new(tangent(uv.x), tangent(uv.y), 1.0).normalize()
}

/// The point of the unit square of a direction relative to the axes of the portal; `None` if it points away from the
/// sky.
fn map(local: DVec3) -> Option<DVec2> {
    let along = |x: f64| (x.angle_from(local.z) + FRAC_PI_2) / PI;
    (local.z > 0.0).then(|| DVec2::new(along(local.x), along(local.y)))
}

/// The ratio of area in the square to solid angle.
fn density_of_map(local: DVec3) -> f64 {
    local.z / (PI * PI * (1.0 - local.x * local.x) * (1.0 - local.y * local.y))
}

/// Where an ascending function has a value, between two positions.
fn bisect(low: f64, high: f64, value: f64, function: impl Fn(f64) -> f64) -> f64 {
    let (mut a, mut b) = (low, high);
    for _ in 0..48 {
        let middle = 0.5 * (a + b);
        if function(middle) < value { a = middle } else { b = middle }
    }
    0.5 * (a + b)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::EnvironmentMapping;
    use lumbre_image::Image;
    use lumbre_math::Transform;
    use lumbre_math::random::RandomStream;

    const CORNERS: [DVec3; 4] = [
        DVec3::new(0.5, -1.0, 2.0),
        DVec3::new(0.5, 1.0, 2.0),
        DVec3::new(-0.5, 1.0, 2.0),
        DVec3::new(-0.5, -1.0, 2.0),
    ];

    /// A sky of stripes, through a window at z = 2 to what is below.
    fn light() -> PortalLight {
        let stripes = (0..32).map(|i| Spectrum::new(1.0 + (i % 8) as f32, 2.0, (i / 8) as f32));
        let image = Image::from_pixels(8, 4, stripes.collect()).unwrap().into();
        let image = Some(EnvironmentDesc { image, mapping: EnvironmentMapping::LatitudeLongitude });
        PortalLight::new(Transform::IDENTITY, Spectrum::splat(0.5), image, CORNERS).unwrap()
    }

    #[test]
    fn samples_have_their_density_and_go_through_the_rectangle() {
        let (light, mut random) = (light(), RandomStream::new(5));
        for from in [DVec3::new(0.1, 0.3, 5.0), DVec3::new(3.0, -2.0, 2.5), DVec3::new(0.0, 0.0, 2.3)] {
            let mut total = 0.0;
            let count = 4000;
            for _ in 0..count {
                let u = DVec2::new(random.next_f64(), random.next_f64());
                let sample = light.sample(from, u).unwrap();
                let Scatter::Density(pdf) = sample.scatter else { panic!() };
                let expected = light.pdf(from, sample.towards);
                assert!((f64::from(pdf) / expected - 1.0).abs() < 1e-4, "{from} {u}: {pdf} {expected}");
                assert_eq!(light.radiance(from, sample.towards), sample.radiance);
                let met = from + sample.towards * ((2.0 - from.z) / sample.towards.z);
                assert!(met.x.abs() < 0.5 + 1e-6 && met.y.abs() < 1.0 + 1e-6, "{from} {u}: {met}");
                total += 1.0 / f64::from(pdf);
            }
            // The mean of 1 / pdf is the solid angle of the rectangle.
            let solid_angle = solid_angle(from);
            let found = total / f64::from(count);
            assert!((found / solid_angle - 1.0).abs() < 0.1, "{from}: {found} {solid_angle}");
        }
        assert!(light.sample(DVec3::new(0.0, 0.0, 1.0), DVec2::splat(0.5)).is_none());
        assert!(light.radiance(DVec3::new(0.0, 0.0, 1.0), -DVec3::Z).is_black());
        assert!(light.radiance(DVec3::new(0.0, 0.0, 5.0), -DVec3::X).is_black());
    }

    fn solid_angle(from: DVec3) -> f64 {
        let steps = 400;
        let mut sum = 0.0;
        for i in 0..steps * steps {
            let (x, y) = (f64::from(i % steps) + 0.5, f64::from(i / steps) + 0.5);
            let to = DVec3::new(x / f64::from(steps) - 0.5, 2.0 * y / f64::from(steps) - 1.0, 2.0) - from;
            sum += 2.0 * to.z.abs() / to.length().powi(3) / f64::from(steps * steps);
        }
        sum
    }

    #[test]
    fn light_of_one_colour_has_the_irradiance_of_the_rectangle() {
        let light = PortalLight::new(Transform::IDENTITY, Spectrum::splat(1.5), None, CORNERS).unwrap();
        let mut random = RandomStream::new(6);
        let (at, normal) = (DVec3::new(0.2, -0.4, 3.0), DVec3::new(0.6, 0.0, -0.8));
        let (mut sampled, count) = (0.0, 20_000);
        for _ in 0..count {
            let sample = light.sample(at, DVec2::new(random.next_f64(), random.next_f64())).unwrap();
            let Scatter::Density(pdf) = sample.scatter else { panic!() };
            sampled +=
                f64::from(sample.radiance.g / pdf) * sample.towards.dot(normal).max(0.0) / f64::from(count);
        }
        // Lambert's formula: the sum over the edges of their angle, by how much their planes face the normal.
        let corners = CORNERS.map(|corner| (corner - at).normalize());
        let edge = |i: usize| {
            let (a, b) = (corners[i], corners[(i + 1) % 4]);
            a.dot(b).acos() * a.cross(b).normalize().dot(normal)
        };
        let exact = 1.5 * (0.5 * (0..4).map(edge).sum::<f64>()).abs();
        assert!((sampled / exact - 1.0).abs() < 0.01, "{sampled} {exact}");
        let sum = f64::from(light.irradiance(at, normal).g);
        assert!((sum / exact - 1.0).abs() < 1e-3, "{sum} {exact}");
    }

    #[test]
    fn what_is_no_rectangle_or_dark_is_refused() {
        let new = |radiance: f32, corners| {
            PortalLight::new(Transform::IDENTITY, Spectrum::splat(radiance), None, corners).err()
        };
        assert_eq!(new(1.0, CORNERS), None);
        assert_eq!(new(0.0, CORNERS), Some(PortalError::Dark));
        let [a, b, c, d] = CORNERS;
        for corners in
            [[a, a, c, d], [a, b, c, d + 0.1 * DVec3::Y], [a, b, c + 0.1 * DVec3::Z, d], [a, c, b, d]]
        {
            assert_eq!(new(1.0, corners), Some(PortalError::NoRectangle), "{corners:?}");
        }
    }
}
