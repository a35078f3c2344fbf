//! Colour spaces: primaries, white points and the matrices between them.

use glam::{DMat3, DVec3};

use crate::Rgb;

/// The chromaticities of red, green, blue and white (CIE 1931 x and y).
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ColourSpace {
    /// Red.
    pub red: [f64; 2],
    /// Green.
    pub green: [f64; 2],
    /// Blue.
    pub blue: [f64; 2],
    /// The colour of equal parts of the three.
    pub white: [f64; 2],
}

/// CIE standard illuminant D65.
const D65: [f64; 2] = [0.3127, 0.3290];

impl ColourSpace {
    /// ITU-R BT.709 and sRGB: the space of [`Rgb`].
    pub const REC709: Self = Self { red: [0.64, 0.33], green: [0.30, 0.60], blue: [0.15, 0.06], white: D65 };
    /// The primaries of SMPTE RP 431-2 with a D65 white, as displays have it.
    pub const DCI_P3: Self =
        Self { red: [0.680, 0.320], green: [0.265, 0.690], blue: [0.150, 0.060], white: D65 };
    /// ITU-R BT.2020.
    pub const REC2020: Self =
        Self { red: [0.708, 0.292], green: [0.170, 0.797], blue: [0.131, 0.046], white: D65 };
    /// SMPTE ST 2065-1, the ACES interchange space (AP0), whose white is near D60.
    pub const ACES2065_1: Self = Self {
        red: [0.7347, 0.2653],
        green: [0.0, 1.0],
        blue: [0.0001, -0.0770],
        white: [0.321_68, 0.337_67],
    };

    /// The names that [`ColourSpace::from_name`] knows.
    pub const NAMES: [&'static str; 4] = ["srgb", "dci-p3", "rec2020", "aces2065-1"];

    /// The space of a name in a scene file, in any case.
    pub fn from_name(name: &str) -> Option<Self> {
        match name.to_ascii_lowercase().as_str() {
            "srgb" | "rec709" => Some(Self::REC709),
            "dci-p3" => Some(Self::DCI_P3),
            "rec2020" => Some(Self::REC2020),
            "aces2065-1" => Some(Self::ACES2065_1),
            _ => None,
        }
    }

    /// The matrix from linear colours of this space to CIE XYZ, where white has Y = 1.
    ///
    /// `None` when the primaries are collinear or white has no y, as a file may state.
    pub fn to_xyz(&self) -> Option<DMat3> {
        // The columns are the primaries' chromaticities, scaled so that they sum to white.
        let direction = |[x, y]: [f64; 2]| DVec3::new(x, y, 1.0 - x - y);
        let primaries = DMat3::from_cols(direction(self.red), direction(self.green), direction(self.blue));
        let white = direction(self.white) / self.white[1];
        let amounts = invertible(primaries)?.inverse() * white;
        let matrix = primaries * DMat3::from_diagonal(amounts);
        invertible(matrix)
    }

    /// The matrix from linear colours of this space to the same light (the same XYZ) in `other`.
    ///
    /// White stays white only between spaces with the same white point. `None` as for [`ColourSpace::to_xyz`].
    pub fn to(&self, other: &Self) -> Option<DMat3> {
        Some(other.to_xyz()?.inverse() * self.to_xyz()?)
    }

    /// The matrix from linear colours of this space to those of the same appearance in `other`: white becomes
    /// white.
    ///
    /// For reflectances and pictures. By the linear Bradford transform (K. M. Lam, "Metamerism and colour
    /// constancy", PhD thesis, University of Bradford, 1985; matrix as in the ICC specification, annex E).
    /// `None` as for [`ColourSpace::to_xyz`].
    pub fn adapted_to(&self, other: &Self) -> Option<DMat3> {
        let (from, to) = (self.to_xyz()?, other.to_xyz()?);
        if self.white == other.white {
            return Some(to.inverse() * from);
        }
        let cones = DMat3::from_cols(
            DVec3::new(0.8951, -0.7502, 0.0389),
            DVec3::new(0.2664, 1.7135, -0.0685),
            DVec3::new(-0.1614, 0.0367, 1.0296),
        );
        let ratio = (cones * to * DVec3::ONE) / (cones * from * DVec3::ONE);
        invertible(to.inverse() * cones.inverse() * DMat3::from_diagonal(ratio) * cones * from)
    }

    /// The colour of the same appearance on the primaries of [`Rgb`]; unchanged from a space without a matrix.
    pub fn to_rec709(&self, [r, g, b]: [f64; 3]) -> Rgb {
        let matrix = match *self == Self::REC709 {
            true => DMat3::IDENTITY,
            false => self.adapted_to(&Self::REC709).unwrap_or(DMat3::IDENTITY),
        };
        let c = matrix * DVec3::new(r, g, b);
        Rgb::new(c.x as f32, c.y as f32, c.z as f32)
    }
}

fn invertible(matrix: DMat3) -> Option<DMat3> {
    let determinant = matrix.determinant();
    (matrix.is_finite() && determinant.is_finite() && determinant.abs() > 1e-12).then_some(matrix)
}

#[cfg(test)]
mod tests {
    use super::*;

    const ALL: [ColourSpace; 4] =
        [ColourSpace::REC709, ColourSpace::DCI_P3, ColourSpace::REC2020, ColourSpace::ACES2065_1];

    fn close(a: DVec3, b: DVec3, tolerance: f64) -> bool {
        (a - b).abs().max_element() < tolerance
    }

    #[test]
    fn matrices_agree_with_the_published_ones() {
        // Rows to XYZ: BT.709 from IEC 61966-2-1 (four digits), ACES from ST 2065-1 (nine digits).
        let srgb = ColourSpace::REC709.to_xyz().unwrap().transpose();
        assert!(close(srgb.x_axis, DVec3::new(0.4124, 0.3576, 0.1805), 1e-4));
        assert!(close(srgb.y_axis, DVec3::new(0.2126, 0.7152, 0.0722), 1e-4));
        assert!(close(srgb.z_axis, DVec3::new(0.0193, 0.1192, 0.9505), 1e-4));
        let aces = ColourSpace::ACES2065_1.to_xyz().unwrap().transpose();
        assert!(close(aces.x_axis, DVec3::new(0.952_552_395_9, 0.0, 0.000_093_678_6), 1e-8));
        assert!(close(aces.y_axis, DVec3::new(0.343_966_449_8, 0.728_166_096_6, -0.072_132_546_4), 1e-8));
        assert!(close(aces.z_axis, DVec3::new(0.0, 0.0, 1.008_825_184_4), 1e-8));
        // BT.2087: BT.709 to BT.2020, four digits.
        let wide = ColourSpace::REC709.to(&ColourSpace::REC2020).unwrap().transpose();
        assert!(close(wide.x_axis, DVec3::new(0.6274, 0.3293, 0.0433), 1e-4));
    }

    #[test]
    fn luminance_is_the_middle_row() {
        let y = ColourSpace::REC709.to_xyz().unwrap().transpose().y_axis;
        let basis = [Rgb::new(1.0, 0.0, 0.0), Rgb::new(0.0, 1.0, 0.0), Rgb::new(0.0, 0.0, 1.0)];
        for (c, expected) in basis.into_iter().zip(y.to_array()) {
            assert!((f64::from(c.luminance()) - expected).abs() < 1e-6);
        }
    }

    #[test]
    fn every_way_comes_back_and_adaptation_keeps_white() {
        for from in ALL {
            for to in ALL {
                let there = from.to(&to).unwrap() * DVec3::new(0.2, 0.5, 0.9);
                assert!(close(to.to(&from).unwrap() * there, DVec3::new(0.2, 0.5, 0.9), 1e-12));
                assert!(close(from.adapted_to(&to).unwrap() * DVec3::ONE, DVec3::ONE, 1e-12));
            }
        }
        let same_light = ColourSpace::ACES2065_1.to(&ColourSpace::REC709).unwrap() * DVec3::ONE;
        assert!(same_light.z < 0.96, "the white of ACES is warmer than D65: {same_light}");
    }

    #[test]
    fn spaces_have_names_and_nonsense_has_no_matrix() {
        for (name, space) in ColourSpace::NAMES.into_iter().zip(ALL) {
            assert_eq!(ColourSpace::from_name(&name.to_uppercase()), Some(space));
        }
        assert_eq!(ColourSpace::from_name("cmyk"), None);
        let flat = ColourSpace { green: [0.64, 0.33], ..ColourSpace::REC709 };
        let dark = ColourSpace { white: [0.3, 0.0], ..ColourSpace::REC709 };
        let nan = ColourSpace { red: [f64::NAN, 0.3], ..ColourSpace::REC709 };
        assert!([flat, dark, nan].iter().all(|s| s.to_xyz().is_none()));
        assert_eq!(nan.to_rec709([0.25, 0.5, 2.0]), Rgb::new(0.25, 0.5, 2.0));
    }
}
