//! Bicubic patches as meshes.

use std::sync::Arc;

use lumbre_math::{DVec2, DVec3, Vec2, Vec3};
use lumbre_scene::MeshDesc;

use super::objects::Form;
use super::{Parser, Result};

/// A patch is divided at most so often in each direction.
const MAX_STEPS: f64 = 7.0;

impl Parser<'_, '_> {
    /// A Bézier patch, divided as often as it says, with its own normals; up to what modifies it.
    pub(super) fn bicubic_patch(&mut self) -> Result<Form> {
        let (mut u_steps, mut v_steps) = (0, 0);
        // Around the patch: u first grows with v at 0.
        let mut corners = [DVec2::ZERO, DVec2::X, DVec2::ONE, DVec2::Y];
        loop {
            if self.take_word("type")? || self.take_word("flatness")? || self.take_word("accuracy")? {
                self.float()?;
            } else if self.take_word("u_steps")? {
                u_steps = self.whole(0.0, MAX_STEPS)?;
            } else if self.take_word("v_steps")? {
                v_steps = self.whole(0.0, MAX_STEPS)?;
            } else if self.take_word("uv_vectors")? {
                for corner in &mut corners {
                    *corner = self.vector()?.truncate();
                    self.comma()?;
                }
            } else if !self.take(b',')? {
                break;
            }
        }
        let mut points = [DVec3::ZERO; 16];
        for point in &mut points {
            self.comma()?;
            *point = self.vector()?;
        }
        let (across, up) = (1_u32 << u_steps, 1_u32 << v_steps);
        self.budget.elements(u64::from(2 * across * up), "triangles of a patch")?;
        let mut mesh = MeshDesc::default();
        let (mut normals, mut uvs) = (Vec::new(), Vec::new());
        for j in 0..=up {
            for i in 0..=across {
                let (u, v) = (f64::from(i) / f64::from(across), f64::from(j) / f64::from(up));
                let (p, n) = place(&points, u, v);
                let single = |p: DVec3| Vec3::new(p.x as f32, p.y as f32, p.z as f32);
                mesh.positions.push(single(p));
                normals.push(single(n));
                let [a, b, c, d] = corners;
                let uv = (a * (1.0 - u) + b * u) * (1.0 - v) + (d * (1.0 - u) + c * u) * v;
                uvs.push(Vec2::new(uv.x as f32, uv.y as f32));
            }
        }
        for j in 0..up {
            for i in 0..across {
                let a = j * (across + 1) + i;
                let [b, c, d] = [a + 1, a + across + 1, a + across + 2];
                mesh.triangles.extend([[a, d, b], [a, c, d]]);
            }
        }
        (mesh.normals, mesh.uvs) = (Some(normals), Some(uvs));
        Ok(Form::Mesh(Arc::new(mesh), None))
    }
}

/// A point of a Bézier patch of four rows of four, with its normal.
fn place(points: &[DVec3; 16], u: f64, v: f64) -> (DVec3, DVec3) {
    let weights = |t: f64| {
        let s = 1.0 - t;
        [s * s * s, 3.0 * s * s * t, 3.0 * s * t * t, t * t * t]
    };
    let slopes = |t: f64| {
        let s = 1.0 - t;
        [-3.0 * s * s, 3.0 * s * s - 6.0 * s * t, 6.0 * s * t - 3.0 * t * t, 3.0 * t * t]
    };
    let sum = |a: [f64; 4], b: [f64; 4]| {
        let mut sum = DVec3::ZERO;
        for (j, b) in b.into_iter().enumerate() {
            for (i, a) in a.into_iter().enumerate() {
                sum += points[4 * j + i] * (a * b);
            }
        }
        sum
    };
    let (du, dv) = (sum(slopes(u), weights(v)), sum(weights(u), slopes(v)));
    (sum(weights(u), weights(v)), dv.cross(du).normalize_or(DVec3::Y))
}
