//! Moments of the triangles below each node, for winding numbers: see [`winding`](crate::point::winding).

use lumbre_math::{DMat3, DVec3};

/// The far-field moments of the triangles below each node of a tree. Positions are relative to the tree's origin.
#[derive(Clone, Debug)]
pub(crate) struct Moments {
    pub(crate) nodes: Vec<Moment>,
}

/// The moments of triangles with normals n, whose lengths are the triangles' areas, at δ from the center.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Moment {
    pub(crate) center: DVec3,
    /// Largest distance of a corner from the center.
    pub(crate) radius: f64,
    pub(crate) area: f64,
    /// Σ n.
    dipole: DVec3,
    /// Σ δ nᵀ.
    first: DMat3,
    /// Σ n_k δ δᵀ for each k, δ all over the triangle.
    second: [DMat3; 3],
}

fn outer(a: DVec3, b: DVec3) -> DMat3 {
    DMat3::from_cols(b.x * a, b.y * a, b.z * a)
}

impl Moment {
    pub(crate) const NOTHING: Self = Self {
        center: DVec3::ZERO,
        radius: 0.0,
        area: 0.0,
        dipole: DVec3::ZERO,
        first: DMat3::ZERO,
        second: [DMat3::ZERO; 3],
    };

    pub(crate) fn of_triangle([a, b, c]: [DVec3; 3]) -> Self {
        let center = (a + b + c) / 3.0;
        let arms = [a - center, b - center, c - center];
        let dipole = 0.5 * (b - a).cross(c - a);
        let spread = arms.iter().fold(DMat3::ZERO, |sum, &arm| sum + outer(arm, arm)) * (1.0 / 12.0);
        Self {
            center,
            radius: arms.iter().fold(0.0, |most: f64, arm| most.max(arm.length())),
            area: dipole.length(),
            dipole,
            first: DMat3::ZERO,
            second: dipole.to_array().map(|n| spread * n),
        }
    }

    /// The combined moments, about the common center of area.
    pub(crate) fn of_all(parts: &[Self]) -> Self {
        let area: f64 = parts.iter().map(|part| part.area).sum();
        if area <= 0.0 {
            return Self::NOTHING;
        }
        let center = parts.iter().map(|part| part.area * part.center).sum::<DVec3>() / area;
        let mut all = Self { center, area, ..Self::NOTHING };
        for part in parts {
            let shift = part.center - center;
            all.radius = all.radius.max(shift.length() + part.radius);
            all.dipole += part.dipole;
            all.first += part.first + outer(shift, part.dipole);
            for k in 0..3 {
                let arm = part.first.col(k);
                all.second[k] += part.second[k]
                    + outer(shift, arm)
                    + outer(arm, shift)
                    + outer(shift, shift) * part.dipole[k];
            }
        }
        all
    }

    /// Four π times the winding number around a far point: the integral of n·ρ/ρ³ with ρ from the point to the surface,
    /// up to the second order in δ.
    pub(crate) fn around(&self, point: DVec3) -> f64 {
        let r = self.center - point;
        let square = r.length_squared();
        let cube = square * square.sqrt();
        let trace = self.first.x_axis.x + self.first.y_axis.y + self.first.z_axis.z;
        let first = trace - 3.0 * r.dot(self.first * r) / square;
        let [x, y, z] = &self.second;
        let across = DVec3::new(
            x.x_axis.x + y.y_axis.x + z.z_axis.x,
            x.x_axis.y + y.y_axis.y + z.z_axis.y,
            x.x_axis.z + y.y_axis.z + z.z_axis.z,
        );
        let spread = |k: usize| {
            let m = &self.second[k];
            let trace = m.x_axis.x + m.y_axis.y + m.z_axis.z;
            r[k] * (15.0 * r.dot(*m * r) / square - 3.0 * trace)
        };
        let second = 0.5 * (spread(0) + spread(1) + spread(2) - 6.0 * across.dot(r)) / square;
        (self.dipole.dot(r) + first + second) / cube
    }
}

impl Moments {
    /// Bytes of memory.
    pub(crate) fn memory_bytes(&self) -> usize {
        self.nodes.capacity() * size_of::<Moment>()
    }
}
