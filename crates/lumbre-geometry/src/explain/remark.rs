//! What is worth saying of a step.

/// A remark on the numbers of a [`Step`](super::Step).
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Remark {
    /// Something in the ray is not a number, or its direction is zero or infinite: every search misses.
    NoRay,
    /// The line misses what the step is about.
    Misses,
    /// The line touches the surface: both roots are one.
    Touches,
    /// The line is parallel to the plane or planes.
    Parallel,
    /// The line is parallel to a plane in which it lies, or to two planes between which it lies.
    Between,
    /// `a` is zero: the equation is linear, and one root has gone to infinity.
    AtInfinity,
    /// The line is inside from end to end, and crosses nothing.
    InsideThroughout,
    /// The line is along a generator of a cone, and is inside it from the tip on.
    AlongGenerator,
    /// The ray begins so far away that the equation is set up nearer to the shape, where it keeps its digits.
    SetUpNearby {
        /// The ray parameter there, `t₀`.
        start: f64,
    },
    /// Doubles could not decide, or not keep their digits, and it was computed in twice the precision. The numbers told are rounded.
    TwicePrecision,
    /// The textbook's formula loses digits here.
    Cancellation {
        /// How many decimal digits of about 16, between 3.5 and 16.
        digits: f64,
    },
    /// The textbook's discriminant is negative or not a number, by rounding: it misses what the search hits.
    SchoolbookMisses,
    /// The textbook's discriminant is not negative, by rounding: it hits what the search misses.
    SchoolbookHits,
    /// Products rounded to the same number, so that their rounding errors decided about an edge.
    EdgeByRoundingErrors,
    /// This test says otherwise than the search.
    Disagrees,
    /// The triangle has no area, and is never hit.
    Flat,
    /// The line lies in the plane of the patch, or along one of its edges.
    EdgeOn,
    /// The tube is so thin that the quartic has no digits for it: the crossings come from the torus' own equation.
    Thin,
    /// The first crossing was found by a descent along the quartic.
    Descent,
    /// The crossings were found between the roots of the derivative, piece by piece.
    Pieces,
    /// The line begins inside of an operand, at minus infinity.
    StartsInside {
        /// Its place among the leaves, from 0.
        operand: usize,
    },
    /// The ray misses the box of an operand, or what is known of another makes it needless: the search does not look at it.
    NotLookedAt {
        /// Its place among the leaves, from 0.
        operand: usize,
    },
}
