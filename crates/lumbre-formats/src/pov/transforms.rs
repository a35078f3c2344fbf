//! Transforms: `translate`, `rotate`, `scale`, `matrix`, `transform`.

use std::sync::Arc;

use lumbre_math::{DAffine3, DMat3, DVec3, Elementary, Transform};

use super::value::Value;
use super::{Parser, Result};

/// A vector turned by degrees about x, then y, then z.
pub(super) fn rotated(p: DVec3, degrees: DVec3) -> DVec3 {
    rotation(degrees) * p
}

fn rotation(degrees: DVec3) -> DMat3 {
    let turn = |degrees: f64| degrees.to_radians().sine_cosine();
    let ((sx, cx), (sy, cy), (sz, cz)) = (turn(degrees.x), turn(degrees.y), turn(degrees.z));
    let x = DMat3::from_cols(DVec3::X, DVec3::new(0.0, cx, sx), DVec3::new(0.0, -sx, cx));
    let y = DMat3::from_cols(DVec3::new(cy, 0.0, -sy), DVec3::Y, DVec3::new(sy, 0.0, cy));
    let z = DMat3::from_cols(DVec3::new(cz, sz, 0.0), DVec3::new(-sz, cz, 0.0), DVec3::Z);
    z * y * x
}

impl Parser<'_, '_> {
    /// A transform, if a word of one comes next.
    pub(super) fn transform(&mut self) -> Result<Option<Arc<Transform>>> {
        let Some(word) = self.word()? else { return Ok(None) };
        let map = match &*word {
            "translate" => {
                self.peeked = None;
                let offset = self.vector()?;
                Transform::translate(offset)
            }
            "rotate" => {
                self.peeked = None;
                let degrees = self.vector()?;
                self.affine(DAffine3::from_mat3(rotation(degrees)))?
            }
            "scale" => {
                self.peeked = None;
                let mut factors = self.vector()?;
                for i in 0..3 {
                    if factors[i] == 0.0 {
                        self.warn("a scale of 0 counts as 1");
                        factors[i] = 1.0;
                    }
                }
                self.affine(DAffine3::from_scale(factors))?
            }
            "matrix" => {
                self.peeked = None;
                self.matrix()?
            }
            "transform" => {
                self.peeked = None;
                self.transform_block()?
            }
            _ => return Ok(None),
        };
        Ok(Some(Arc::new(map)))
    }

    fn affine(&self, map: DAffine3) -> Result<Transform> {
        Transform::from_affine(map).map_err(|_| self.error("a transform that flattens space"))
    }

    fn matrix(&mut self) -> Result<Transform> {
        self.expect(b'<')?;
        let mut m = [0.0; 12];
        for x in &mut m {
            *x = self.finite()?;
            self.comma()?;
        }
        self.expect(b'>')?;
        let row = |i: usize| DVec3::new(m[3 * i], m[3 * i + 1], m[3 * i + 2]);
        // Rows of theirs are columns of ours.
        self.affine(DAffine3 { matrix3: DMat3::from_cols(row(0), row(1), row(2)), translation: row(3) })
    }

    /// Transforms in braces, or the name of one.
    fn transform_block(&mut self) -> Result<Transform> {
        if !self.is_mark(b'{')? {
            return self.named_transform();
        }
        self.expect(b'{')?;
        let mut all = Transform::IDENTITY;
        let mut is_inverse = false;
        while !self.take(b'}')? {
            if self.take_word("inverse")? {
                is_inverse = true;
            } else if let Some(map) = self.transform()? {
                all = *map * all;
            } else {
                all = self.named_transform()? * all;
            }
        }
        Ok(if is_inverse { all.inverse() } else { all })
    }

    fn named_transform(&mut self) -> Result<Transform> {
        let Some(word) = self.word()? else { return Err(self.unexpected("a transform")) };
        let Some(cell) = self.lookup(&word).cloned() else { return Err(self.undeclared(&word)) };
        self.peeked = None;
        let value = cell.borrow().clone();
        match self.indexed(value)? {
            Value::Transform(map) => Ok(*map),
            other => Err(self.error(format!("a transform is needed, not {}", other.name()))),
        }
    }
}
