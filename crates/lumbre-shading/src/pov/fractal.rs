//! The Mandelbrot set and Julia sets as patterns.

use lumbre_math::{DVec2, DVec3};

/// How often z ← zⁿ + c stays small, in the plane of x and y.
#[derive(Clone, Debug, PartialEq)]
pub struct Fractal {
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

impl Fractal {
    /// The value at a point.
    pub fn value(&self, p: DVec3) -> f64 {
        let start = p.truncate();
        let c = self.julia.unwrap_or(start);
        let mut z = start;
        let mut least = z.length_squared();
        for i in 0..self.iterations {
            let mut power = z;
            for _ in 1..self.exponent {
                power = DVec2::new(power.x * z.x - power.y * z.y, power.x * z.y + power.y * z.x);
            }
            z = power + c;
            let size = z.length_squared();
            least = least.min(size);
            if size > 4.0 {
                return outside(self.exterior, i, self.iterations, z);
            }
        }
        let (kind, factor) = self.interior;
        match kind {
            0 => factor,
            1 => least.sqrt() * factor,
            2 => z.x * factor,
            3 => z.y * factor,
            4 => z.x * z.x * factor,
            5 => z.y * z.y * factor,
            _ => z.length() * factor,
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
            (count % factor) / factor
        }
    }
}
