//! A clear sky and the sun.
//!
//! The sky is that of L. Hosek and A. Wilkie, "An Analytic Model for Full Spectral Sky-Dome Radiance", ACM Transactions
//! on Graphics 31(4) (SIGGRAPH), 2012: a formula whose coefficients depend on the height of the sun, the turbidity of
//! the air and the reflectance of the ground. `hosek-wilkie.bin` holds the authors' coefficients for linear Rec. 709,
//! under the licence in `LICENSE-HOSEK-WILKIE`: single precision, little-endian; for each channel 9 × 6 × 10 × 2
//! numbers of the formula, then 6 × 10 × 2 of the radiance, by coefficient, control point, turbidity and reflectance,
//! the first fastest. The crate `hw-skymodel` has the same coefficients, but its powers are those of the system's
//! library, whose last bits differ by platform; here they are those of [`Elementary`], so that pictures have the same
//! bytes everywhere.
//!
//! Radiance is in units in which a white surface shows 1 where 100,000 lux light it: 1 is a luminance of 31,831 cd/m².

mod sun;

use std::f64::consts::PI;
use std::sync::LazyLock;

use lumbre_image::Rgb;
use lumbre_math::{DVec3, Elementary};

pub use sun::Sunlight;
use sun::{EFFICACY, UNIT};

/// Coefficients of the formula.
const COEFFICIENTS: usize = 9;
/// Control points of the Bézier curves over the height of the sun.
const CONTROLS: usize = 6;
/// Turbidities: 1 to 10.
const TURBIDITIES: usize = 10;
/// Coefficients of a channel, and those of its radiance.
const FORMULA: usize = COEFFICIENTS * CONTROLS * TURBIDITIES * 2;
const RADIANCE: usize = CONTROLS * TURBIDITIES * 2;

static TABLE: LazyLock<Vec<f32>> = LazyLock::new(|| {
    let bytes = include_bytes!("hosek-wilkie.bin").chunks_exact(4);
    bytes.map(|b| f32::from_le_bytes([b[0], b[1], b[2], b[3]])).collect()
});

/// What a clear sky depends on.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SkyConditions {
    /// The height of the sun above the horizon in degrees, from 0 to 90.
    pub elevation: f64,
    /// How hazy the air is, from 1, that of the highest mountains, to 10, haze. A clear day has 2 to 4.
    pub turbidity: f64,
    /// The reflectance of the ground, from 0 to 1: it lights the sky from below.
    pub albedo: f64,
}

impl Default for SkyConditions {
    fn default() -> Self {
        Self { elevation: 45.0, turbidity: 3.0, albedo: 0.3 }
    }
}

/// A clear sky. Its directions have z up.
#[derive(Clone, Debug, PartialEq)]
pub struct Sky {
    channels: [Channel; 3],
    towards_sun: DVec3,
    irradiance: Rgb,
    /// The radiance from below the horizon.
    ground: Rgb,
}

/// The formula of a channel.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Channel {
    coefficients: [f64; COEFFICIENTS],
    radiance: f64,
}

impl Sky {
    /// A sky with the sun at an azimuth, in degrees clockwise from north (y; east is x).
    ///
    /// `None` for conditions out of their ranges.
    pub fn new(conditions: &SkyConditions, azimuth: f64) -> Option<Self> {
        let SkyConditions { elevation, turbidity, albedo } = *conditions;
        let is_known = (0.0..=90.0).contains(&elevation)
            && (1.0..=10.0).contains(&turbidity)
            && (0.0..=1.0).contains(&albedo)
            && azimuth.is_finite();
        is_known.then(|| {
            let mut sky = Self {
                channels: [0, 1, 2].map(|channel| Channel::new(channel, conditions)),
                towards_sun: sun_direction(azimuth, elevation),
                irradiance: Rgb::BLACK,
                ground: Rgb::BLACK,
            };
            sky.irradiance = sky.on_level_ground();
            sky.ground = sky.irradiance * (albedo / PI) as f32;
            sky
        })
    }

    /// The radiance from a unit direction. From below the horizon it is that of level ground of the sky's albedo under
    /// the sky alone.
    pub fn radiance(&self, direction: DVec3) -> Rgb {
        if direction.z < 0.0 {
            return self.ground;
        }
        let cos_sun = direction.dot(self.towards_sun).clamp(-1.0, 1.0);
        self.above(direction.z, cos_sun, cos_sun.arc_cosine())
    }

    /// The irradiance of the sky, without the sun, on level ground.
    pub fn irradiance(&self) -> Rgb {
        self.irradiance
    }

    /// The irradiance on level ground: a sum over the sky.
    fn on_level_ground(&self) -> Rgb {
        const RINGS: u32 = 64;
        const STEPS: u32 = 128;
        let mut sum = [0.0; 3];
        for ring in 0..RINGS {
            // Rings of equal projected area.
            let z = (1.0 - (f64::from(ring) + 0.5) / f64::from(RINGS)).sqrt();
            let across = (1.0 - z * z).sqrt();
            for step in 0..STEPS {
                let turn = lumbre_math::direction_at(2.0 * PI * (f64::from(step) + 0.5) / f64::from(STEPS));
                let direction = DVec3::new(across * turn.x, across * turn.y, z);
                let seen = self.radiance(direction).to_array();
                (0..3).for_each(|c| sum[c] += f64::from(seen[c]));
            }
        }
        Rgb::from(sum.map(|c| (c * PI / f64::from(RINGS * STEPS)) as f32))
    }

    /// The unit vector towards the sun.
    pub fn towards_sun(&self) -> DVec3 {
        self.towards_sun
    }

    /// The radiance at this cosine of the angle to the zenith, and this angle to the sun with its cosine.
    fn above(&self, cos_zenith: f64, cos_sun: f64, from_sun: f64) -> Rgb {
        let channels = self.channels.map(|channel| channel.at(cos_zenith, cos_sun, from_sun));
        Rgb::from(channels.map(|c| (c.max(0.0) * (EFFICACY / UNIT)) as f32))
    }
}

/// The unit vector towards an azimuth in degrees clockwise from north (y; east is x), and an elevation in degrees above
/// the horizon (z is up).
pub fn sun_direction(azimuth: f64, elevation: f64) -> DVec3 {
    let ((east, north), (up, level)) =
        (azimuth.to_radians().sine_cosine(), elevation.to_radians().sine_cosine());
    DVec3::new(east * level, north * level, up)
}

impl Channel {
    fn new(channel: usize, conditions: &SkyConditions) -> Self {
        let table = &TABLE[channel * (FORMULA + RADIANCE)..][..FORMULA + RADIANCE];
        let (formula, radiance) = table.split_at(FORMULA);
        let height = (conditions.elevation / 90.0).cube_root();
        let mut coefficients = [0.0; COEFFICIENTS];
        for (k, coefficient) in coefficients.iter_mut().enumerate() {
            *coefficient = interpolated(formula, COEFFICIENTS, k, conditions, height);
        }
        Self { coefficients, radiance: interpolated(radiance, 1, 0, conditions, height) }
    }

    /// The formula of the model: its equation 8, with the term of the zenith that the authors added.
    fn at(&self, cos_zenith: f64, cos_sun: f64, from_sun: f64) -> f64 {
        let [a, b, c, d, e, f, g, h, i] = self.coefficients;
        let squared = cos_sun * cos_sun;
        let aureole = (1.0 + i * i - 2.0 * i * cos_sun).max(0.0);
        let gradation = 1.0 + a * (b / (cos_zenith + 0.01)).exponential();
        let indicatrix = c
            + d * (e * from_sun).exponential()
            + f * squared
            + g * (1.0 + squared) / (aureole * aureole.sqrt())
            + h * cos_zenith.max(0.0).sqrt();
        self.radiance * gradation * indicatrix
    }
}

/// A coefficient from a table: linear in turbidity and reflectance, a Bézier curve over the cube root of the height of
/// the sun.
fn interpolated(table: &[f32], stride: usize, at: usize, conditions: &SkyConditions, height: f64) -> f64 {
    let low = (conditions.turbidity as usize).clamp(1, TURBIDITIES);
    let high = (low + 1).min(TURBIDITIES);
    let share = conditions.turbidity - low as f64;
    let mut sum = 0.0;
    for (albedo, of_albedo) in [(0, 1.0 - conditions.albedo), (1, conditions.albedo)] {
        for (turbidity, of_turbidity) in [(low, 1.0 - share), (high, share)] {
            let first = (albedo * TURBIDITIES + turbidity - 1) * CONTROLS * stride + at;
            let controls: [f64; CONTROLS] = std::array::from_fn(|k| f64::from(table[first + k * stride]));
            sum += of_albedo * of_turbidity * bezier(controls, height);
        }
    }
    sum
}

/// A Bézier curve of degree 5, by de Casteljau's algorithm.
fn bezier(mut points: [f64; CONTROLS], t: f64) -> f64 {
    for last in (1..CONTROLS).rev() {
        for i in 0..last {
            points[i] += t * (points[i + 1] - points[i]);
        }
    }
    points[0]
}

#[cfg(test)]
mod tests {
    use super::*;

    fn sky(elevation: f64, turbidity: f64, albedo: f64) -> Sky {
        Sky::new(&SkyConditions { elevation, turbidity, albedo }, 0.0).unwrap()
    }

    #[test]
    fn the_sky_is_that_of_another_implementation() {
        // Three directions by the angles to the zenith and to the sun, in W/(m² sr), of the crate hw-skymodel 0.1.1.
        const ANGLES: [[f64; 2]; 2] = [[1.2, 0.4], [0.5, 1.0]];
        let known = [
            (45.0, 3.0, 0.3, [[1.616265e1, 2.1282694e1, 2.8269737e1], [2.5308867e0, 4.676074e0, 9.568813e0]]),
            (
                10.0,
                3.0,
                0.5,
                [[1.1793083e1, 1.2523435e1, 1.1832376e1], [1.5006886e0, 2.6662676e0, 4.2318835e0]],
            ),
            (
                60.0,
                2.5,
                0.0,
                [[1.1516824e1, 1.6246937e1, 2.4371616e1], [1.8615526e0, 3.6191356e0, 8.130702e0]],
            ),
            (5.0, 6.3, 0.2, [[1.768473e1, 1.2904021e1, 7.205961e0], [1.675332e0, 2.196812e0, 2.6956193e0]]),
            (90.0, 10.0, 1.0, [[7.66455e1, 9.795597e1, 7.721931e1], [1.0344605e1, 1.2348448e1, 1.7573835e1]]),
            (
                0.0,
                1.0,
                0.0,
                [[2.6838686e0, 2.462007e0, 1.668705e0], [6.679175e-1, 7.3069054e-1, 6.9226986e-1]],
            ),
        ];
        for (elevation, turbidity, albedo, radiance) in known {
            let sky = sky(elevation, turbidity, albedo);
            for ([zenith, from_sun], expected) in ANGLES.into_iter().zip(radiance) {
                let found = sky.above(zenith.cosine(), from_sun.cosine(), from_sun).to_array();
                for c in 0..3 {
                    let found = f64::from(found[c]) * UNIT / EFFICACY;
                    assert!((found / expected[c] - 1.0).abs() < 1e-4, "{elevation} {zenith}: {found}");
                }
            }
        }
    }

    #[test]
    fn a_clear_sky_lights_the_ground_as_skies_do() {
        // In lux: a sum over the sky of the other implementation.
        let lux = f64::from(sky(45.0, 3.0, 0.3).irradiance().luminance()) * UNIT;
        assert!((lux / 17_790.0 - 1.0).abs() < 0.01, "{lux}");
        let sky = sky(45.0, 3.0, 0.3);
        let below = sky.radiance(DVec3::new(0.6, 0.0, -0.8));
        assert_eq!(below, sky.irradiance() * (0.3 / PI) as f32);
    }

    #[test]
    fn at_one_height_the_sky_is_brightest_at_the_sun() {
        let conditions = SkyConditions::default();
        let sky = Sky::new(&conditions, 120.0).unwrap();
        let at =
            |azimuth: f64| f64::from(sky.radiance(sun_direction(azimuth, conditions.elevation)).luminance());
        let brightest = at(120.0);
        for away in 1..360 {
            assert!(at(120.0 + f64::from(away)) < brightest, "{away}");
        }
        // East is x, and north y.
        assert!(sky.towards_sun().x > 0.0 && sky.towards_sun().y < 0.0);
    }

    #[test]
    fn conditions_out_of_their_ranges_are_refused() {
        let base = SkyConditions::default();
        for wrong in [
            SkyConditions { elevation: -0.1, ..base },
            SkyConditions { elevation: 90.1, ..base },
            SkyConditions { turbidity: 0.9, ..base },
            SkyConditions { turbidity: f64::NAN, ..base },
            SkyConditions { albedo: 1.1, ..base },
        ] {
            assert!(Sky::new(&wrong, 0.0).is_none(), "{wrong:?}");
        }
        assert!(Sky::new(&base, f64::INFINITY).is_none());
    }
}
