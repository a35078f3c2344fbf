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
    /// The line is parallel to the plane.
    Parallel,
    /// The line is parallel to both planes of a slab, and lies between them or in one of them.
    Between {
        /// The axis of the slab: 0, 1 or 2.
        axis: usize,
    },
    /// The line is parallel to both planes of a slab, and does not lie between them.
    Beside {
        /// The axis of the slab: 0, 1 or 2.
        axis: usize,
    },
    /// `a` is zero: the equation is linear, and one root has gone to infinity.
    AtInfinity,
    /// `a = h = 0` and `c < 0`: the line is inside the surface all the way, and does not cross it.
    InsideThroughout,
    /// `a = h = c = 0`: the line lies in the surface, and crosses it nowhere.
    InSurface,
    /// `a = h = c = 0`: the line lies in the side of a cylinder with caps, and counts as inside.
    InCappedSide,
    /// `a = h = c = 0`: the line is a generator of a cone with caps, and counts as inside from the tip on.
    AlongGenerator,
    /// The line passes the tip of a cone: both roots are one.
    ThroughTip,
    /// The equation is set up elsewhere than at the ray's origin, where fewer of its digits cancel: in the middle of
    /// the roots, or where the line is nearest to the shape.
    SetUpNearby {
        /// The ray parameter there, `t₀`.
        start: f64,
    },
    /// Doubles do not prove how many roots there are, or would not keep their digits: it was computed in twice the
    /// precision.
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
    /// The textbook's equation with its coefficients rounded has another number of roots than the shape has crossings.
    SchoolbookCount {
        /// How many crossings there are, a touch counted twice.
        crossings: usize,
        /// How many roots the textbook's equation has.
        roots: usize,
    },
    /// The line runs along a ruling of a bilinear patch: it is in the patch between the places where it enters and
    /// leaves it.
    AlongRuling,
    /// Every ruling of one family meets the line: it is a ruling of the other family.
    EveryRuling,
    /// A ruling of a bilinear patch is parallel to the line: they meet nowhere.
    ParallelRuling,
    /// The line is parallel to a plane, and lies in it.
    InPlane,
    /// Products rounded to the same number, so that their rounding errors decided about an edge.
    EdgeByRoundingErrors,
    /// An edge function is 0: the line meets that edge, or its continuation.
    OnEdge,
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
    /// The ray misses the box of an operand, or what is known of another makes it needless: the search does not look at
    /// it.
    NotLookedAt {
        /// Its place among the leaves, from 0.
        operand: usize,
    },
}
