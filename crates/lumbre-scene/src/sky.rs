//! The sun and a clear sky as lights.

use std::f64::consts::PI;
use std::str::FromStr;
use std::sync::Arc;

use lumbre_image::{Image, Rgb};
use lumbre_math::{DVec2, DVec3, Elementary, Transform, warp64};
use lumbre_shading::sky::{Sky, SkyConditions, Sunlight};

use crate::{EnvironmentDesc, EnvironmentMapping, LightDesc};

/// The height of the map of a sky in pixels; it is twice as wide.
const HEIGHT: u32 = 512;

/// Where the sun stands.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SunPosition {
    /// In degrees clockwise from north, seen from above.
    pub azimuth: f64,
    /// In degrees above the horizon, without refraction.
    pub elevation: f64,
}

impl SunPosition {
    /// The position at a time, in seconds since 1970-01-01T00:00Z, at a place, in degrees to the north and to the east.
    ///
    /// Right to about 0.01° from 1950 to 2050: J. Meeus, "Astronomical Algorithms", 1998, chapters 12, 13 and 25 (low
    /// accuracy).
    pub fn at(time: f64, latitude: f64, longitude: f64) -> Self {
        // Since noon of 2000-01-01.
        let days = time / 86400.0 - 10957.5;
        let century = days / 36525.0;
        let mean_longitude = 280.46646 + century * (36000.76983 + century * 0.0003032);
        let anomaly = (357.52911 + century * (35999.05029 - 0.0001537 * century)).to_radians();
        let center = (1.914602 - century * (0.004817 + 0.000014 * century)) * anomaly.sine()
            + (0.019993 - 0.000101 * century) * (2.0 * anomaly).sine()
            + 0.000289 * (3.0 * anomaly).sine();
        let node = (125.04 - 1934.136 * century).to_radians();
        let apparent = (mean_longitude + center - 0.00569 - 0.00478 * node.sine()).to_radians();
        let tilt = (23.439291 - 0.0130042 * century + 0.00256 * node.cosine()).to_radians();
        let ascension = (tilt.cosine() * apparent.sine()).angle_from(apparent.cosine());
        let declination = (tilt.sine() * apparent.sine()).arc_sine();
        let sidereal = 280.46061837 + 360.98564736629 * days + 0.000387933 * century * century;
        let hour = (sidereal + longitude).to_radians() - ascension;
        let (sin, cos) = latitude.to_radians().sine_cosine();
        let elevation = (sin * declination.sine() + cos * declination.cosine() * hour.cosine()).arc_sine();
        let south = hour.sine().angle_from(hour.cosine() * sin - declination.tangent() * cos);
        Self { azimuth: (south.to_degrees() + 180.0).rem_euclid(360.0), elevation: elevation.to_degrees() }
    }
}

/// Why a text says no position of the sun.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum SunPositionError {
    /// It has not three parts.
    #[error(
        "no time and place (found \"{0}\"; expected a date with a time and its zone, a latitude and a longitude, as 2026-06-21T12:00+02:00,40.4,-3.7)"
    )]
    Parts(String),
    /// The first part is no time.
    #[error("no date with a time and its zone (found \"{0}\"; expected one as 2026-06-21T12:00+02:00)")]
    Time(String),
    /// The second part is no latitude.
    #[error("no latitude (found \"{0}\"; expected degrees to the north from -90 to 90)")]
    Latitude(String),
    /// The third part is no longitude.
    #[error("no longitude (found \"{0}\"; expected degrees to the east from -180 to 180)")]
    Longitude(String),
}

impl FromStr for SunPosition {
    type Err = SunPositionError;

    /// The position at a time and a place, `TIME,LATITUDE,LONGITUDE`: see [`time_of`] and [`SunPosition::at`].
    fn from_str(text: &str) -> Result<Self, SunPositionError> {
        let parts: Vec<&str> = text.split(',').map(str::trim).collect();
        let [time, latitude, longitude] = parts[..] else {
            return Err(SunPositionError::Parts(text.to_owned()));
        };
        let degrees = |text: &str, most: f64| text.parse().ok().filter(|x: &f64| x.abs() <= most);
        Ok(Self::at(
            time_of(time).ok_or_else(|| SunPositionError::Time(time.to_owned()))?,
            degrees(latitude, 90.0).ok_or_else(|| SunPositionError::Latitude(latitude.to_owned()))?,
            degrees(longitude, 180.0).ok_or_else(|| SunPositionError::Longitude(longitude.to_owned()))?,
        ))
    }
}

/// The seconds since 1970-01-01T00:00Z of a date and a time with its zone, such as `2026-06-21T12:00+02:00` or
/// `2026-06-21T10:00:00Z`; `None` for what is none.
pub fn time_of(text: &str) -> Option<f64> {
    let (date, rest) = text.split_once(['T', 't', ' '])?;
    let zone_at = rest.find(['Z', 'z', '+', '-'])?;
    let (clock, zone) = rest.split_at(zone_at);
    let [year, month, day] = parts(date, '-', [4, 2, 2])?;
    let is_leap = year % 4 == 0 && (year % 100 != 0 || year % 400 == 0);
    let last = match month {
        2 => 28 + i64::from(is_leap),
        4 | 6 | 9 | 11 => 30,
        _ => 31,
    };
    let is_date = year > 0 && (1..=12).contains(&month) && (1..=last).contains(&day);
    let [hour, minute, second] =
        if clock.len() > 5 { parts(clock, ':', [2; 3])? } else { with_zero(parts(clock, ':', [2; 2])?) };
    let is_clock = hour < 24 && minute < 60 && second < 60;
    let offset = match zone.split_at(1) {
        ("Z" | "z", "") => 0,
        (sign, offset) => {
            let [hours, minutes] = parts(offset, ':', [2; 2])?;
            if !(hours <= 14 && minutes < 60) {
                return None;
            }
            let minutes = 60 * hours + minutes;
            if sign == "-" { -minutes } else { minutes }
        }
    };
    // Days by H. Hinnant, "chrono-Compatible Low-Level Date Algorithms", 2013: years begin in March.
    let year = if month <= 2 { year - 1 } else { year };
    let day_of_year = (153 * ((month + 9) % 12) + 2) / 5 + day - 1;
    let days = 365 * year + year / 4 - year / 100 + year / 400 + day_of_year - 719_468;
    let seconds = 86_400 * days + 3600 * hour + 60 * (minute - offset) + second;
    (is_date && is_clock).then_some(seconds as f64)
}

fn with_zero([a, b]: [i64; 2]) -> [i64; 3] {
    [a, b, 0]
}

/// Numbers of these lengths between separators.
fn parts<const N: usize>(text: &str, separator: char, lengths: [usize; N]) -> Option<[i64; N]> {
    let mut numbers = [0; N];
    let mut all = text.split(separator);
    for (number, length) in numbers.iter_mut().zip(lengths) {
        let part = all.next()?;
        let is_number = part.len() == length && part.bytes().all(|b| b.is_ascii_digit());
        *number = part.parse().ok().filter(|_| is_number)?;
    }
    all.next().is_none().then_some(numbers)
}

/// The sun and a clear sky. Light is in units in which a white surface shows 1 where 100,000 lux light it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SkyDesc {
    /// Where the sun stands.
    pub sun: SunPosition,
    /// How hazy the air is, from 1 to 10: see [`SkyConditions::turbidity`].
    pub turbidity: f64,
    /// The reflectance of the ground, which is what is seen below the horizon.
    pub albedo: f64,
    /// A factor on the light of the sun; with 0 there is no sun.
    pub sun_scale: f32,
    /// A factor on the light of the sky; with 0 there is no sky.
    pub sky_scale: f32,
    /// The diameter of the sun in degrees. Its light is the same for any.
    pub sun_angle: f64,
}

impl Default for SkyDesc {
    fn default() -> Self {
        let SkyConditions { elevation, turbidity, albedo } = SkyConditions::default();
        Self {
            sun: SunPosition { azimuth: 180.0, elevation },
            turbidity,
            albedo,
            sun_scale: 1.0,
            sky_scale: 1.0,
            sun_angle: Sunlight::ANGLE,
        }
    }
}

/// What a [`SkyDesc`] cannot be made of.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
pub enum SkyError {
    /// There is no model of the night.
    #[error(
        "the sun is below the horizon, and the night has no model (found an elevation of {0:.1} degrees; expected 0 to 90)"
    )]
    Elevation(f64),
    /// Air that is clearer or hazier than any that was modelled.
    #[error("the turbidity is out of range (found {0}; expected 1, clear, to 10, hazy)")]
    Turbidity(f64),
    /// Ground that reflects more than all light, or less than none.
    #[error("the albedo of the ground is out of range (found {0}; expected 0 to 1)")]
    Albedo(f64),
}

/// A [`SkyDesc`] that has a model.
#[derive(Clone, Debug, PartialEq)]
pub struct ClearSky {
    desc: SkyDesc,
    sky: Sky,
}

impl ClearSky {
    /// The memory that the map of a sky takes.
    pub const MAP_BYTES: usize = 2 * (HEIGHT * HEIGHT) as usize * size_of::<Rgb>();

    /// The sky of a description.
    ///
    /// # Errors
    /// [`SkyError`].
    pub fn new(desc: SkyDesc) -> Result<Self, SkyError> {
        let SkyDesc { sun: SunPosition { azimuth, elevation }, turbidity, albedo, .. } = desc;
        if !(0.0..=90.0).contains(&elevation) {
            return Err(SkyError::Elevation(elevation));
        }
        if !(1.0..=10.0).contains(&turbidity) {
            return Err(SkyError::Turbidity(turbidity));
        }
        let sky = Sky::new(&SkyConditions { elevation, turbidity, albedo }, azimuth);
        Ok(Self { desc, sky: sky.ok_or(SkyError::Albedo(albedo))? })
    }

    /// What it was made of.
    pub fn desc(&self) -> &SkyDesc {
        &self.desc
    }

    /// The radiance of the sky without the sun, from a unit direction.
    pub fn radiance(&self, direction: DVec3) -> Rgb {
        self.sky.radiance(direction) * self.desc.sky_scale
    }

    /// The light of the sun; `None` if there is none.
    fn sunlight(&self) -> Option<Sunlight> {
        let SkyDesc { sun, turbidity, sun_scale, .. } = self.desc;
        let mut sunlight = Sunlight::new(sun.elevation, turbidity).filter(|_| sun_scale > 0.0)?;
        sunlight.irradiance *= sun_scale;
        Some(sunlight)
    }

    /// The sun, if the air lets its light through, and what is around. The sky's space has x east, y north and z up.
    pub fn lights(&self, world_from_sky: &Transform) -> Vec<LightDesc> {
        let mut lights = Vec::new();
        if let Some(Sunlight { irradiance, spectrum }) = self.sunlight() {
            let towards = world_from_sky.vector(self.sky.towards_sun()).normalize_or_zero();
            let disc = LightDesc::Disc { towards, angle: self.desc.sun_angle, irradiance };
            lights.push(LightDesc::Spectral { light: Box::new(disc), spectrum });
        }
        if self.desc.sky_scale > 0.0 {
            lights.push(LightDesc::Infinite {
                world_from_light: *world_from_sky,
                radiance: Rgb::WHITE,
                image: Some(EnvironmentDesc {
                    image: Arc::new(self.map()),
                    mapping: EnvironmentMapping::LatitudeLongitude,
                }),
            });
        }
        lights
    }

    /// The sky without its sun by longitude and latitude, with x in the centre. What is below the horizon is as bright
    /// as level ground under both.
    pub fn map(&self) -> Image {
        let of_sun =
            self.sunlight().map_or(Rgb::BLACK, |sun| sun.irradiance * self.sky.towards_sun().z as f32);
        let on_ground = self.sky.irradiance() * self.desc.sky_scale + of_sun;
        let ground = on_ground * (self.desc.albedo / PI) as f32;
        let (width, height) = (2 * HEIGHT, HEIGHT);
        let size = DVec2::new(width.into(), height.into());
        let mut image = Image::filled(width, height, ground);
        for (i, pixel) in image.pixels_mut().iter_mut().enumerate() {
            let (x, y) = (i % width as usize, i / width as usize);
            let uv = DVec2::new(x as f64 + 0.5, y as f64 + 0.5) / size;
            let direction = warp64::latlong_to_sphere(uv + DVec2::new(0.5, 0.0));
            if direction.z > 0.0 {
                *pixel = self.radiance(direction);
            }
        }
        image
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Light;

    fn at(time: &str, latitude: f64, longitude: f64) -> SunPosition {
        SunPosition::at(time_of(time).unwrap(), latitude, longitude)
    }

    #[test]
    fn the_sun_of_known_times_stands_where_it_does() {
        // J. Meeus, example 25.a: right ascension 198.378°, declination -7.785° on 1992-10-13, 0 h TD, which is 59 s
        // later in UT. At the pole the elevation is the declination.
        let pole = at("1992-10-12T23:59:01Z", 90.0, 0.0);
        assert!((pole.elevation + 7.785).abs() < 0.002, "{pole:?}");
        // Equinoxes and solstices of 2026: the sun passes the equator, or is highest above it.
        assert!(at("2026-03-20T14:46Z", 90.0, 0.0).elevation.abs() < 0.01);
        assert!((at("2026-06-21T08:24Z", 90.0, 0.0).elevation - 23.436).abs() < 0.01);
        assert!((at("2026-12-21T20:50Z", -90.0, 0.0).elevation - 23.436).abs() < 0.01);
        // At the equinox, the noon of the equator is overhead; the equation of time is -7.4 minutes.
        let noon = at("2026-03-20T12:07:24Z", 0.0, 0.0);
        assert!(noon.elevation > 89.8, "{noon:?}");
        // The sun of a northern noon is in the south, that of a southern noon in the north.
        let madrid = at("2026-03-20T12:22+00:00", 40.4, -3.7);
        assert!((madrid.azimuth - 180.0).abs() < 0.5 && (madrid.elevation - 49.6).abs() < 0.1, "{madrid:?}");
        let sydney = at("2026-06-21T11:57+10:00", -33.87, 151.2);
        assert!((sydney.azimuth - 360.0).abs() < 1.0 || sydney.azimuth < 1.0, "{sydney:?}");
        assert!((sydney.elevation - (90.0 - 33.87 - 23.436)).abs() < 0.05, "{sydney:?}");
        // In the morning it is in the east.
        assert!(at("2026-06-21T08:00+02:00", 48.9, 2.4).azimuth < 90.0);
    }

    #[test]
    fn times_with_their_zone_are_read() {
        assert_eq!(time_of("1970-01-01T00:00Z"), Some(0.0));
        assert_eq!(time_of("2000-02-29T12:00:30+02:00"), Some(951_818_430.0));
        assert_eq!(time_of("2026-11-30T23:30-01:30"), Some(1_796_086_800.0));
        assert_eq!(time_of("1969-12-31 23:59:59z"), Some(-1.0));
        for wrong in [
            "",
            "2026-06-21",
            "2026-06-21T12:00",
            "2026-6-21T12:00Z",
            "2026-13-01T00:00Z",
            "2025-02-29T00:00Z",
            "2026-06-21T24:00Z",
            "2026-06-21T12:60Z",
            "2026-06-21T12:00+2",
            "2026-06-21T12:00+15:00",
            "2026-06-21T12Z",
            "2026-06-21T12:00:00.5Z",
            "+026-06-21T12:00Z",
            "2026-06-21T12:00ZZ",
            "T+",
            "2026-06-21T\u{fc}2:00Z",
        ] {
            assert_eq!(time_of(wrong), None, "{wrong}");
        }
    }

    #[test]
    fn a_text_of_a_time_and_a_place_is_a_position() {
        let text = "2026-03-20T12:22+00:00, 40.4, -3.7";
        assert_eq!(text.parse(), Ok(at("2026-03-20T12:22Z", 40.4, -3.7)));
        let wrong = |text: &str| text.parse::<SunPosition>().unwrap_err().to_string();
        assert!(wrong("2026-03-20T12:22Z").contains("expected a date with a time and its zone, a latitude"));
        assert!(wrong("noon,1,2").contains("found \"noon\""));
        assert!(wrong("2026-03-20T12:22Z,91,2").contains("-90 to 90"));
        assert!(wrong("2026-03-20T12:22Z,1,NaN").contains("-180 to 180"));
    }

    #[test]
    fn the_lights_are_a_sun_and_what_is_around() {
        let desc = SkyDesc { sun: SunPosition { azimuth: 90.0, elevation: 30.0 }, ..SkyDesc::default() };
        let lights = ClearSky::new(desc).unwrap().lights(&Transform::IDENTITY);
        let [LightDesc::Spectral { light, .. }, LightDesc::Infinite { image: Some(map), .. }] = &lights[..]
        else {
            panic!()
        };
        let LightDesc::Disc { towards, angle, irradiance } = **light else { panic!() };
        assert!(towards.distance(DVec3::new(0.75_f64.sqrt(), 0.0, 0.5)) < 1e-12 && angle == 0.533);
        // The sun gives more than the sky, and is redder.
        let scene =
            crate::Scene::build(crate::SceneDesc { lights: lights.clone(), ..Default::default() }).unwrap();
        let [_, Light::Environment(sky)] = scene.lights() else { panic!() };
        let of_sky = sky.irradiance(DVec3::Z);
        assert!(irradiance.luminance() * 0.5 > of_sky.luminance());
        assert!(irradiance.b / irradiance.r < of_sky.b / of_sky.r);
        // The map has the irradiance of the sky, and the ground below.
        let exact = Sky::new(&SkyConditions { elevation: 30.0, ..SkyConditions::default() }, 90.0).unwrap();
        for c in 0..3 {
            let (found, expected) = (of_sky.to_array()[c], exact.irradiance().to_array()[c]);
            assert!((found / expected - 1.0).abs() < 3e-3, "{found} {expected}");
        }
        let ground = (exact.irradiance() + irradiance * 0.5) * (0.3 / std::f32::consts::PI);
        let below = map.image.pixel(10, 400);
        assert!((below.g / ground.g - 1.0).abs() < 1e-5, "{below:?} {ground:?}");
        // Where the sun is, the sky is brightest.
        let seen = |towards: DVec3| sky.radiance(towards.normalize()).luminance();
        assert!(seen(towards) > 3.0 * seen(DVec3::new(-0.5, 0.0, 0.5)));
    }

    #[test]
    fn a_factor_of_0_leaves_a_light_out() {
        let count = |sun_scale, sky_scale| {
            let desc = SkyDesc { sun_scale, sky_scale, ..SkyDesc::default() };
            ClearSky::new(desc).unwrap().lights(&Transform::IDENTITY).len()
        };
        assert_eq!([count(1.0, 1.0), count(0.0, 1.0), count(1.0, 0.0), count(0.0, 0.0)], [2, 1, 1, 0]);
    }

    #[test]
    fn nights_and_air_without_a_model_are_refused() {
        let base = SkyDesc::default();
        let error = |desc| ClearSky::new(desc).unwrap_err();
        let night = SunPosition { azimuth: 0.0, elevation: -3.25 };
        assert_eq!(error(SkyDesc { sun: night, ..base }), SkyError::Elevation(-3.25));
        assert_eq!(error(SkyDesc { turbidity: 0.5, ..base }), SkyError::Turbidity(0.5));
        assert_eq!(error(SkyDesc { albedo: 2.0, ..base }), SkyError::Albedo(2.0));
    }
}
