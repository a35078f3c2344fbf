//! The kinds of steps.

/// What a [`Step`](super::Step) computes.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Topic {
    /// The numbers that the shape is made of, as the search uses them: the normals of planes and disks and all
    /// coefficients of a quadric times a power of two, which changes no digit. A quadric is `p·⟨Q₁·p, Q₂·p, Q₃·p⟩ +
    /// 2·(G·p) + j = 0`.
    Parameters,
    /// A ray whose direction is so long or so short that its square is no number: `D` with about unit length, which all
    /// steps after it use. `D` is the given direction over `λ`, and the given ray's `t` are those of the steps over
    /// `λ`. The candidates are of the given ray.
    ScaledRay,
    /// Where the equation along the line is set up: `W`, the ray's origin as seen from the shape; or, at `t₀` along the
    /// ray, `W₀`.
    SetUp,
    /// The equation `a·s² + 2·h·s + c = 0` of the surface along the line, where `s = t`, or `t − t₀`; with the bounds
    /// `ε₂`, `ε₁` and `ε₀` of the errors of `a`, `h` and `c`, in units of the unit roundoff 2⁻⁵³, where the search
    /// computes them. The textbook's is `a₀·t² + b·t + c₀ = 0`, from the ray's origin; where they are the same numbers,
    /// `a₀` is called `a` and `c₀` `c`.
    Quadratic,
    /// The quarter `Δ` of the discriminant, whose sign says how many roots there are; with the bound `ε` of its error,
    /// where the search asks whether doubles decide the sign.
    Discriminant,
    /// The roots of the equation, and the crossings `t₁ ≤ t₂` of the whole line. Of a bilinear patch, the places `u`
    /// and `v` of each crossing with the patch too: with the ruling's ends as seen along the ray, `x₄`, `y₄` and `x₅`,
    /// `y₅` (or `x₇`, `y₇` and `x₈`, `y₈`), the place `v′` on it that is nearest to the ray; from there, a step of
    /// Newton's method with the derivative `g` along u and the area `A` of both derivatives.
    Roots,
    /// A cone's radius `ρ`, with a sign, in the middle of both roots, which says which of them are on the nappe of the
    /// body. (Along the line, the radius grows by `g` for each unit of `t`.)
    Nappe,
    /// Where the line passes the plane through a cone's pointed end, which divides the two nappes.
    Tip,
    /// Where the line passes the plane through the first end, perpendicular to the axis.
    FirstCut,
    /// Where the line passes the plane through the second end, perpendicular to the axis.
    SecondCut,
    /// The ball about a capsule's first end; its equation follows.
    FirstBall,
    /// The ball about a capsule's second end; its equation follows.
    SecondBall,
    /// Where the line crosses a plane.
    Plane,
    /// Where the line passes the planes of a box, axis by axis: those of the lower and higher coordinate.
    Slabs,
    /// The interval of the line within a convex solid: from the last of what it enters to the first of what it leaves.
    /// Of a capsule, the interval that covers those of its parts: `I₀` within the cylinder between both planes, `I₁`
    /// and `I₂` within the balls.
    Span,
    /// The line in a torus' own frame, from the point that is nearest to the centre: `p + s·U`, with a unit `U`. `g` is
    /// the length of the direction, and `s₀` what rounding leaves between `t₀` and that point. `z₀` and `z₁` are the
    /// components of `p` and `U` along the axis.
    TorusFrame,
    /// The part of the line, from `s = σ₁` to `σ₂`, that is within the flat cylinder about a torus.
    TorusBounds,
    /// The equation of a torus along the line, a quartic without a cubic term: `s²·s² + a₂·s² + a₁·s + a₀ = 0`. The
    /// textbook's is `c₄·t²·t² + c₃·t²·t + c₂·t² + c₁·t + c₀ = 0`, from the ray's origin.
    Quartic,
    /// The roots `s` of the quartic's derivative, between which it rises or falls throughout, and its values `y` there.
    QuarticExtrema,
    /// The roots of the quartic, and the crossings that they are.
    QuarticRoots,
    /// The textbook's quartic in doubles, `c₄·t²·t² + c₃·t²·t + c₂·t² + c₁·t + c₀ = 0`, and its real roots `τ`, each
    /// without a further rounding error to speak of: what the rounded coefficients leave of the crossings.
    TextbookQuartic,
    /// The shear that makes the ray the third axis: `i₁`, `i₂`, `i₃` are the coordinate axes, the one that the
    /// direction is longest along last. Each corner gets the place `x`, `y` as seen along the ray, and `z` along the
    /// third axis.
    Shear,
    /// On which side of each edge the ray passes: twice the areas of the triangles between the ray and the edges, with
    /// signs.
    EdgeFunctions,
    /// The same triangle by the test of Möller and Trumbore, for comparison; the search does not use it.
    MollerTrumbore,
    /// The same triangle by its plane and the sides of its edges, for comparison; the search does not use it.
    PlaneAndSides,
    /// How often a bilinear patch's outline winds about the ray, from the side of each edge that it passes on (1 where
    /// the edge function is positive, and −1 where it is negative).
    Winding,
    /// The rulings of a bilinear patch, or of the surface that continues it, that meet the ray's line: the roots `w₁ ≤
    /// w₂` of `a·u² + 2·h·u + c = 0`.
    Rulings,
    /// The intervals of the line within each operand of a CSG tree (`I₁` the first leaf's) and within the result, `I`.
    Intervals,
    /// The surface at the nearest hit: the point `P`, the normal `N` and the parameters `u` and `v`.
    Surface,
}
