//! What a search computes for a ray, as data: the steps with their formulas and numbers, and what became of each
//! crossing.

mod axial;
mod capsule;
mod csg;
mod cuboid;
mod fate;
mod notes;
mod patch;
mod planar;
mod quadratic;
mod remark;
mod second_degree;
mod sphere;
mod topic;
mod torus;
mod triangle;

use std::borrow::Cow;

use lumbre_math::{DVec3, Transform};

use crate::Root;

pub use fate::Fate;
pub(crate) use notes::Notes;
pub use remark::Remark;
pub use topic::Topic;

/// How a shape's crossings with a ray are found, in the order in which it is computed.
///
/// All numbers are those of the search itself. Formulas are plain text in Unicode (`h = D·w`, `Δ = h² − a·c`), whose
/// symbols are those of the quantities before, and of the ray: `O` its origin, `D` its direction. Where a symbol is
/// used for more than one quantity, it is that of the last one before.
#[derive(Clone, Debug, PartialEq)]
pub struct Explanation {
    /// What is computed.
    pub steps: Vec<Step>,
    /// The operands of a CSG tree, in the order of its leaves; empty for every other shape.
    pub operands: Vec<Operand>,
    /// Every crossing of the ray's line that the steps come upon, in ascending order, taken or not.
    pub candidates: Vec<Candidate>,
}

/// An operand of a CSG tree.
#[derive(Clone, Debug, PartialEq)]
pub struct Operand {
    /// The shape's name in the scene language; "solid" for one that is not one of Lumbre's shapes.
    pub name: &'static str,
    /// From the operand's own space to that of the tree.
    pub world_from_object: Transform,
    /// How its crossings with the whole line are found, in its own space; `None` for a solid that is not one of
    /// Lumbre's shapes, and for an operand whose box the ray misses, which the search does not look at.
    pub explanation: Option<Explanation>,
}

/// One thing that is computed.
#[derive(Clone, Debug, PartialEq)]
pub struct Step {
    /// What it is.
    pub topic: Topic,
    /// Its numbers.
    pub quantities: Vec<Quantity>,
    /// What is worth saying of them.
    pub remarks: Vec<Remark>,
}

/// A number, with its name and where it comes from.
#[derive(Clone, Debug, PartialEq)]
pub struct Quantity {
    /// Its name in formulas, as `t₁`.
    pub symbol: Cow<'static, str>,
    /// The formula in earlier symbols; empty for what is given, or chosen.
    ///
    /// It consists of symbols (a Latin or Greek letter, or the word `det`, then primes `′` and subscripts), numerals,
    /// the operators `·` (of numbers, or the dot product), `×` (the cross product), `+`, `−`, `/`, the squares `²`, `√(
    /// )`, `min( )` and `max( )` with commas, lengths and absolute values `| |`, parentheses, and `⟨ , , ⟩`, the vector
    /// of three components.
    pub formula: Cow<'static, str>,
    /// What the search computed.
    pub value: Value,
    /// The textbook's formula and what it gives, where that is another formula. It may begin with a name of its own, as
    /// in `b = 2·(w·D)`, which later formulas of the textbook use.
    pub schoolbook: Option<(Cow<'static, str>, Value)>,
}

/// What a quantity is.
#[derive(Clone, Debug, PartialEq)]
pub enum Value {
    /// A number.
    Number(f64),
    /// A point or a direction.
    Vector(DVec3),
    /// Several numbers.
    Numbers(Vec<f64>),
    /// Intervals of `t`, in ascending order; the ends may be infinite.
    Intervals(Vec<[f64; 2]>),
}

/// A crossing of the ray's line, and what became of it.
#[derive(Clone, Debug, PartialEq)]
pub struct Candidate {
    /// The ray parameter.
    pub t: f64,
    /// The part of the shape, as in [`Root::part`].
    pub part: u32,
    /// Whether it is a hit, or why it is none.
    pub fate: Fate,
    /// The root that the search returns, for a hit.
    pub root: Option<Root>,
}
