//! Julia fractals: what a scene says of them.

use std::sync::Arc;

use lumbre_math::DVec4;

use super::julia::{Algebra, Julia};
use super::objects::Form;
use super::{Parser, Result};

/// More steps than this tell no more points apart.
const MAX_ITERATIONS: f64 = 200.0;

impl Parser<'_, '_> {
    fn four(&mut self) -> Result<DVec4> {
        let v = self.expression()?.promoted(4);
        let v = DVec4::new(v[0], v[1], v[2], v[3]);
        if v.is_finite() { Ok(v) } else { Err(self.error("a vector that is not finite")) }
    }

    /// A Julia fractal, up to what modifies it.
    pub(super) fn julia_fractal(&mut self) -> Result<Form> {
        let mut julia = Julia {
            parameter: self.four()?,
            algebra: Algebra::Quaternion,
            power: 2,
            iterations: 20,
            precision: 20.0,
            slice: (DVec4::W, 0.0),
        };
        let mut is_known = true;
        while let Some(word) = self.word()? {
            match &*word {
                "quaternion" => julia.algebra = Algebra::Quaternion,
                "hypercomplex" => julia.algebra = Algebra::Hypercomplex,
                "sqr" => julia.power = 2,
                "cube" => julia.power = 3,
                "exp" | "reciprocal" | "sin" | "asin" | "sinh" | "asinh" | "cos" | "acos" | "cosh"
                | "acosh" | "tan" | "atan" | "tanh" | "atanh" | "ln" => {
                    self.warn(&format!("julia_fractal by {word} is not rendered"));
                    is_known = false;
                }
                "pwr" => {
                    self.warn("julia_fractal by pwr is not rendered");
                    is_known = false;
                    self.peeked = None;
                    self.arguments(2)?;
                    continue;
                }
                "max_iteration" => {
                    self.peeked = None;
                    julia.iterations = self.whole(1.0, MAX_ITERATIONS)?;
                    continue;
                }
                "precision" => {
                    self.peeked = None;
                    julia.precision = self.finite()?.clamp(1.0, 1e4);
                    continue;
                }
                "slice" => {
                    self.peeked = None;
                    let normal = self.four()?;
                    self.comma()?;
                    let distance = self.finite()?;
                    if normal.w == 0.0 {
                        return Err(
                            self.error("the slice of a julia_fractal whose normal has no fourth component")
                        );
                    }
                    julia.slice = (normal, distance);
                    continue;
                }
                _ => break,
            }
            self.peeked = None;
        }
        Ok(if is_known { Form::Julia(Arc::new(julia)) } else { Form::Nothing })
    }
}
