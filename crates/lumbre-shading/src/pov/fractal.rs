//! The Mandelbrot set and Julia sets as patterns.

use lumbre_math::{DVec2, DVec3};

/// How often z ← zⁿ + c, or a formula of magnetism, stays small, in the plane of x and y.
#[derive(Clone, Debug, PartialEq)]
pub struct Fractal {
    /// A formula of magnetism in place of zⁿ + c.
    pub magnet: Option<Magnet>,
    /// c of a Julia set; `None` for the Mandelbrot set, where c is the point.
    pub julia: Option<DVec2>,
    /// n.
    pub exponent: u32,
    /// The most steps.
    pub iterations: u32,
    /// Kind and factor outside the set.
    pub exterior: (u32, f64),
    /// Kind and factor inside the set.
    pub interior: (u32, f64),
}

/// The renormalization of two models of magnetism (Peitgen and Richter, "The Beauty of Fractals", 1986).
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Magnet {
    /// z ← ((z² + c − 1) / (2z + c − 2))².
    First,
    /// z ← ((z³ + 3(c − 1)z + (c − 1)(c − 2)) / (3z² + 3(c − 2)z + (c − 1)(c − 2) + 1))².
    Second,
}

fn times(a: DVec2, b: DVec2) -> DVec2 {
    DVec2::new(a.x * b.x - a.y * b.y, a.x * b.y + a.y * b.x)
}

impl Magnet {
    fn next(self, z: DVec2, c: DVec2) -> DVec2 {
        let real = |x: f64| DVec2::new(x, 0.0);
        let (above, below) = match self {
            Self::First => (times(z, z) + c - real(1.0), 2.0 * z + c - real(2.0)),
            Self::Second => {
                let (one, two) = (c - real(1.0), c - real(2.0));
                let rest = times(one, two);
                let square = times(z, z);
                (
                    times(square, z) + 3.0 * times(one, z) + rest,
                    3.0 * square + 3.0 * times(two, z) + rest + real(1.0),
                )
            }
        };
        let quotient = times(above, DVec2::new(below.x, -below.y)) / below.length_squared();
        times(quotient, quotient)
    }
}

impl Fractal {
    /// The value at a point of the formulas of magnetism.
    fn magnetic(&self, magnet: Magnet, p: DVec2) -> f64 {
        let (mut z, c) = match self.julia {
            Some(c) => (p, c),
            None => (DVec2::ZERO, p),
        };
        let mut least = z.length_squared();
        for i in 0..self.iterations {
            z = magnet.next(z, c);
            let size = z.length_squared();
            least = least.min(size);
            // Far away, or at the fixed point 1.
            let is_far = size > 10_000.0 || size.is_nan();
            if is_far || (z - DVec2::X).length_squared() < 1e-4 {
                return outside(self.exterior, i, self.iterations, z);
            }
        }
        self.inside(z, least)
    }

    /// The value at a point.
    pub fn value(&self, p: DVec3) -> f64 {
        let start = p.truncate();
        if let Some(magnet) = self.magnet {
            return self.magnetic(magnet, start);
        }
        let c = self.julia.unwrap_or(start);
        let mut z = start;
        let mut least = z.length_squared();
        for i in 0..self.iterations {
            let mut power = z;
            for _ in 1..self.exponent {
                power = times(power, z);
            }
            z = power + c;
            let size = z.length_squared();
            least = least.min(size);
            if size > 4.0 {
                return outside(self.exterior, i, self.iterations, z);
            }
        }
        self.inside(z, least)
    }

    fn inside(&self, z: DVec2, least: f64) -> f64 {
        let (kind, factor) = self.interior;
        match kind {
            0 => factor,
            1 => least.sqrt() * factor,
            2 => z.x * factor,
            3 => z.y * factor,
            4 => z.x * z.x * factor,
            5 => z.y * z.y * factor,
            // As POV-Ray has it: the factor is on one square alone.
            _ => z.x * z.x + z.y * z.y * factor,
        }
    }
}

fn outside((kind, factor): (u32, f64), iteration: u32, iterations: u32, z: DVec2) -> f64 {
    let count = f64::from(iteration);
    match kind {
        0 => factor,
        1 => count / f64::from(iterations),
        2 => z.x * factor,
        3 => z.y * factor,
        4 => z.x * z.x * factor,
        5 => z.y * z.y * factor,
        6 => z.length() * factor,
        _ => {
            let factor = if factor == 0.0 { 1.0 } else { factor };
            let period = if kind == 8 { factor + 1.0 } else { factor };
            (count % period) / factor
        }
    }
}
