//! The sentences of explanations in English.

use lumbre::geometry::{Fate, Remark, Topic};

use super::numbers::exact;
use super::texts::{OperandName, Texts};

pub(super) static ENGLISH: Texts = Texts {
    code: "en",
    language: "English",
    topic,
    remark,
    fate_of,
    kind_of,
    kind_of_light: kind_of,
    parameter: |_| "",
    symbol,
    camera: "The camera",
    kind: "kind",
    name: "name",
    size: "size of the picture",
    eye: "where it stands",
    right: "to the right of the picture",
    up: "upwards",
    forward: "into the picture",
    look_at: "look-at matrix, from the world to the camera",
    projection: "projection matrix, from camera space with depths from {0} to {1} (rays need neither end)",
    perspective: "perspective, {0}° along the shorter side",
    lens: "with a lens of radius {0} in focus at {1}",
    orthographic: "orthographic",
    spherical: "spherical, all directions at once",
    realistic: "a real lens of focal length {0} mm, {1} mm before the film, whose diagonal is {2} mm",
    of_meshes: "the faces of meshes, which rays leave",
    pixel: "pixel",
    film_point: "point of the film, in pixels from the upper left corner",
    screen_point: "point of the screen (at a distance of 1 for a perspective)",
    lens_point: "point of the lens, as two numbers in [0, 1)",
    direction_in_camera: "direction in camera space",
    direction_turned: "turned into the world, by the inverse of the look-at matrix",
    origin: "the ray's origin",
    direction: "the ray's direction",
    range: "range of t",
    time: "time",
    ray_is: "The ray is the points O + t·D with t in this range.",
    given_ray: "The ray",
    surfaces: "What the ray meets",
    nothing_met: "Nothing: the ray leaves the scene.",
    more_hits: "There are more: only {0} crossings are listed.",
    shape: "shape {0}, {1}",
    material: "material",
    no_material: "none",
    instance: "instance",
    triangle: "triangle of the mesh",
    transform: "Into the object's space",
    chain: "The maps from the object to the world, the outermost first; M is their product.",
    decomposes: "M = T·Rz·Ry·Rx·S, with:",
    scale: "scale S along x, y, z",
    rotations: "rotations about x, y, z in degrees",
    translation: "translation T",
    sheared: "M shears: it is no scale, rotations and a translation.",
    as_point: "the origin as a point, w = 1",
    as_direction: "the direction as a direction, w = 0",
    t_is_kept: "D′ is not made a unit vector, so t means the same point in both spaces. By unit directions it would be |D′| times as large.",
    equation: "The crossings",
    curve: "A segment of a curve, a cubic by its control points. Half of its width is how near the ray has to pass; where it passes nearest, the \
            segment is crossed at the depth of its axis.",
    curve_segment: "segment of the curves",
    curve_width: "width there",
    curve_axis: "axis where the ray passes nearest",
    curve_distance: "distance of the ray from the axis",
    custom: "Geometry of a program's own: how it finds its crossings is not known here.",
    hit: "The crossing at t = {0}",
    t_of_search: "as computed",
    is_seen: "This is the one that is seen.",
    point: "the point, on the surface",
    reprojected: "P is put back onto the surface; O + t·D is {0} away from it by rounding.",
    normal_in_object: "outward normal in the object's space",
    by_inverse_transpose: "by the inverse transpose",
    normal: "outward unit normal",
    front: "N·D < 0: the ray meets the outside; the normal that faces it is N.",
    back: "N·D > 0: the ray meets the inside; the normal that faces it is −N.",
    grazing: "N·D = 0: the ray touches the surface.",
    part: "part",
    multiplicity: "multiplicity",
    fate: "whether it counts",
    fates: "Which crossings count",
    operand_origin: "the ray's origin in the operand's own space",
    operand_direction: "the ray's direction there",
    operand: "Operand {0}, {1}",
    not_looked_at: "The ray misses its box: the search does not look at it.",
    light: "The light",
    start: "The beginning",
    left: "The ray leaves the scene",
    throughput: "what the path carries",
    radiance: "light added here, before β and w",
    mis_weight: "MIS weight",
    added: "what is added",
    survives: "By chance the path goes on, with a probability of {0}, and carries the inverse of it more.",
    does_not_survive: "By chance the path ends here; it would have gone on with a probability of {0}.",
    medium: "A medium",
    medium_scattered: "The path scatters there.",
    medium_passed: "The path comes through.",
    distance: "distance",
    blocked: "share of the light on the ground that something blocks",
    occluded: "Something is in the way of it.",
    open: "Nothing is in the way of it.",
    sum: "All light of this path",
    source: "from",
    no_light: "No light was found.",
    radiance_of_sample: "radiance of this sample, as the render adds it to the pixel",
    vertex: "Vertex {0} of the path: {1}",
    shading_normal: "shading normal",
    texture: "(by a texture)",
    mirror: "Mirror direction",
    facing: "the normal that faces the ray",
    reflected: "the mirrored direction",
    index_here: "index of refraction on this side",
    index_beyond: "index of refraction beyond",
    cos_incident: "cosine of the angle of incidence",
    cos_squared: "square of the cosine of the angle of refraction",
    refracted: "the refracted direction",
    total_reflection: "κ < 0: all is reflected, nothing is refracted.",
    each_light: "Each light, from here",
    each_light_is: "Each light is tested at its centre; the path below samples random points.",
    light_number: "light",
    towards_light: "towards it",
    arriving: "radiance that arrives",
    pdf: "density by solid angle",
    visible: "seen",
    contribution: "what is scattered of it",
    yes: "yes",
    no: "no",
    more_lights: "There are {0} lights; only the first are listed.",
    sampled_light: "A light is sampled",
    scattered: "f·|cos θ| towards it",
    no_shadow_ray: "Nothing would be scattered of it: no ray looks whether it is seen.",
    bsdf_pdf: "BSDF density",
    shadow_origin: "the shadow ray's origin, moved off the surface by its error",
    shadow_direction: "the shadow ray's direction",
    visibility: "what comes through",
    blocked_by: "In its way: {0}, at t = {1}.",
    goes_on: "The path goes on",
    transmitted: "It is transmitted.",
    is_reflected: "It is reflected.",
    only_direction: "This is the only direction of its kind (a mirror, or glass): it has no density.",
    bsdf_weight: "f·|cos θ| over the density",
    throughput_after: "what the path carries then",
    from_surface: "light of the surface",
    from_infinity: "light from infinity",
    from_medium: "light of the medium",
    from_sampled: "a light that was sampled",
    from_direct: "all lights that shine on it",
    from_caustics: "photons near the point",
    photons: "Photons near the point, the brightest first: light that came over mirrors or through glass",
    photon_from: "where it came from",
    photon_irradiance: "Eₚ (irradiance, facing it)",
    photon_scattered: "f·Eₚ·wₚ (scattered to the viewer)",
    more_photons: "{0} more bring {1} together.",
    end_depth: "The path has as many bounces as it may have.",
    end_nothing: "Nothing scatters here.",
    end_absorbed: "All is absorbed.",
    end_roulette: "It ends by chance.",
    end_medium: "It ends in the medium.",
    schoolbook: "by the textbook",
    title: "How Lumbre computes it",
    sketch: "Filled points are hits, hollow ones crossings of the line that are none. Where the ray is dotted at its beginning, its origin is farther away than drawn.",
    world_space: "In the world",
    object_space: "In the shape's own space",
    plot: "Along the ray",
    plot_of_intervals: "The intervals of t along the ray",
    slider: "t along the ray",
    step_by_step: "Step by step",
    previous: "Previous",
    next: "Next",
    show_all: "Show all",
    step_of: "Step {0} of {1}: {2}",
    is_missed: "The ray misses it.",
    lies_in_it: "The ray lies in its surface, as at t = {0}, and does not cross it.",
    meets_it: "The ray meets it, as at t = {0}, and does not cross it.",
    runs_inside: "The ray runs inside of it, and does not cross it.",
    passes: "It passes it at a distance of {0}, nearest at t = {1}.",
    passes_in_object: "In the object's own space it passes it at a distance of {0}, nearest at t = {1}.",
    missed: "Shapes that the ray does not cross:",
    missed_nearest: "The shapes that it passes nearest, and why it does not cross them:",
    no_such_shape: "--shape {0}: no shape has this number, kind or material (expected a number, or one of {1})",
    no_such_key: "--only {0}: no section has this key (expected some of {1})",
    no_sections: "There is no such section for this ray.",
    outside_picture: "--pixel {0}: outside of the picture (expected less than {1}; --size gives another)",
    in_file: "The face in its file",
    baked: "M takes these corners to those of the equation.",
    mirrored: "M mirrors: the corners go round the other way.",
    split: "The face is flat, and is tested as two triangles.",
    no_wavelengths: "warning: its picture carries wavelengths; what is explained is a path of red, green and blue",
    no_turntable: "--turntable makes many pictures (expected no --turntable)",
    nothing_asked: "nothing is asked for (expected --pixel X,Y, from 0,0 in the upper left corner, or --ray OX,OY,OZ,DX,DY,DZ)",
    frame_of_same_hand: "Camera space has x along e₁, y along e₂ and z along e₃. Here e₁×e₂ points along e₃: it has the same hand as the scene's axes.",
    frame_of_other_hand: "Camera space has x along e₁, y along e₂ and z along e₃. Here e₁×e₂ points against e₃: camera space is left-handed, the scene right-handed.",
    projected: "Back to the picture: the look-at matrix and then the projection matrix take a point of the ray to its pixel.",
    in_focus: "where the ray is in focus; without a lens, at a distance of 1",
    point_of_ray: "a point of the ray",
    by_look_at: "in camera space, by the look-at matrix",
    by_projection: "by the projection matrix, with w",
    by_division: "divided by w: in the cube [-1, 1]³, y upwards",
    back_on_film: "point of the film, in pixels from the upper left corner, y downwards",
    north_pole: "At a pole, 90° about y, x and z turn about the same axis: only x − z is determined, and z is set to 0.",
    south_pole: "At a pole, −90° about y, x and z turn about the same axis: only x + z is determined, and z is set to 0.",
    barycentrics: "b₁, b₂ (barycentric coordinates)",
    shown_feature: "What is shown",
    openness: "How open it is here",
    normal_as_colour: "the shading normal as a colour, (n + 1)/2",
    depth_along_axis: "the depth along the camera's axis",
    reflectance: "the reflectance",
    uv_as_colour: "u and v as red and green",
    is_open: "1 where nothing near is in that direction, else 0",
    tree: "The tree of rays: below each vertex stand those that its mirrored and refracted rays meet.",
    going_on: "probability of going on",
    after_roulette: "what the path carries, having gone on",
    radiance_along_ray: "radiance along the ray",
    radiance_before_film: "radiance of this sample",
    exposure: "exposure of the film: shutter time times ISO / 100",
    exposed: "exposed",
    max_component: "largest component that the film takes",
    held: "scaled down to that, with the same hue",
    sensor: "times the matrix of the sensor",
    filter_weight: "weight of the pixel's filter there",
    weighted: "φ times the radiance, added to the pixel's sum (φ is added to its sum of weights; the pixel is the first sum over the second)",
    cos_refracted: "cosine of the angle of refraction",
    perpendicular: "amplitude, polarised across the plane of incidence",
    parallel: "amplitude, polarised in that plane",
    fresnel: "the Fresnel reflectance: the share that is reflected",
    intensity: "intensity of the light towards here, over the probability of choosing it",
    cos_light: "|cos θ|, by the shading normal",
    bsdf_alone: "the BSDF",
    phase: "phase function towards it",
    phase_weight: "phase function over the density",
    is_scattered: "The medium scatters it.",
    eta_entered: "index of the side that it enters over that of the side it leaves",
    sample: "sample",
    weight: "weight in the pixel",
};

fn topic(topic: Topic) -> &'static str {
    match topic {
        Topic::Parameters => "The shape",
        Topic::ScaledRay => "The direction, scaled",
        Topic::SetUp => "Where the equation is set up",
        Topic::Quadratic => "The equation a·s² + 2·h·s + c = 0",
        Topic::Discriminant => "The discriminant (a quarter of the textbook's)",
        Topic::Roots => "The roots",
        Topic::Nappe => "Which nappe of the cone",
        Topic::Tip => "The plane through the tip",
        Topic::FirstCut => "The plane through the first end",
        Topic::SecondCut => "The plane through the second end",
        Topic::FirstBall => "The ball about the first end",
        Topic::SecondBall => "The ball about the second end",
        Topic::Plane => "The plane",
        Topic::Slabs => "The slabs, axis by axis",
        Topic::Span => "The interval within the solid",
        Topic::TorusFrame => "The line in the torus' own frame",
        Topic::TorusBounds => "Where the line is near the torus",
        Topic::Quartic => "The quartic",
        Topic::QuarticExtrema => "Where the quartic turns",
        Topic::QuarticRoots => "The roots of the quartic",
        Topic::TextbookQuartic => {
            "For comparison: the textbook's quartic c₄·t⁴ + c₃·t³ + c₂·t² + c₁·t + c₀ = 0"
        }
        Topic::Shear => "The shear that puts the ray on an axis",
        Topic::EdgeFunctions => "The edge functions (watertight)",
        Topic::MollerTrumbore => "For comparison: Möller and Trumbore",
        Topic::PlaneAndSides => "For comparison: the plane and the sides of the edges",
        Topic::Winding => "How the outline winds about the ray",
        Topic::Rulings => "The rulings that meet the ray",
        Topic::Intervals => "The intervals on the line",
        Topic::Surface => "The surface at the nearest crossing",
    }
}

fn remark(remark: &Remark, name: &OperandName<'_>) -> String {
    let text = match remark {
        Remark::NoRay => {
            "Something in the ray is not a number, or its direction is zero or infinite: it meets nothing."
        }
        Remark::Misses => "The line misses it.",
        Remark::Touches => "The line touches it: both roots are one.",
        Remark::Parallel => "The line is parallel to it.",
        Remark::Between { axis } => {
            return format!(
                "The line is parallel to both planes of {}, and lies between them or in one of them.",
                AXES[*axis]
            );
        }
        Remark::Beside { axis } => {
            return format!(
                "The line is parallel to both planes of {}, and does not lie between them.",
                AXES[*axis]
            );
        }
        Remark::AtInfinity => "a = 0: the equation is linear, and one root has gone to infinity.",
        Remark::InsideThroughout => {
            "a = h = 0 and c < 0: the line is inside of it all the way, and does not cross it."
        }
        Remark::InSurface => "a = h = c = 0: the line lies in the surface, and crosses it nowhere.",
        Remark::InCappedSide => "a = h = c = 0: the line lies in the side, and counts as inside.",
        Remark::AlongGenerator => {
            "a = h = c = 0: the line is a generator of the cone, and counts as inside from the tip on."
        }
        Remark::ThroughTip => "The line passes the tip: both roots are one.",
        Remark::AlongRuling => {
            "The line runs along this ruling: it is on the patch from where it enters to where it leaves."
        }
        Remark::EveryRuling => {
            "a = h = c = 0: every ruling of this family meets the line, which is one of the other family."
        }
        Remark::ParallelRuling => "A ruling is parallel to the ray: they meet nowhere.",
        Remark::SchoolbookCount { crossings, roots } => {
            return format!(
                "The rounded coefficients have another number of roots, {roots}, than there are crossings: {crossings}."
            );
        }
        Remark::SetUpNearby { start } => {
            return format!(
                "The equation is set up at t₀ = {}, where fewer of its digits cancel than at the ray's origin.",
                exact(*start)
            );
        }
        Remark::TwicePrecision => {
            "Doubles do not prove how many roots there are, or would lose digits: it is computed in twice the precision."
        }
        Remark::Cancellation { digits } => {
            return format!("The textbook's formula loses {digits:.0} of about 16 digits here.");
        }
        Remark::SchoolbookMisses => {
            "By rounding, the textbook's discriminant is negative: it would miss what is hit."
        }
        Remark::SchoolbookHits => {
            "By rounding, the textbook's discriminant is not negative: it would hit what is missed."
        }
        Remark::InPlane => "The line lies in the plane, and crosses it nowhere.",
        Remark::OnEdge => "An edge function is 0: the line meets that edge, or its continuation.",
        Remark::EdgeByRoundingErrors => {
            "Two products rounded to the same number: their rounding errors decide about an edge."
        }
        Remark::Disagrees => "This test says otherwise than the search.",
        Remark::Flat => "The triangle has no area, and is never hit.",
        Remark::EdgeOn => "The line lies in the plane of the patch, or along one of its edges.",
        Remark::Thin => {
            "The tube is so thin that the quartic has no digits for it: the crossings come from the torus' own equation."
        }
        Remark::Descent => "The first crossing is found by descent along the quartic.",
        Remark::Pieces => "The crossings are found piece by piece, between the extrema of the quartic.",
        Remark::StartsInside { operand } => {
            return format!("The line begins inside operand {operand} ({}).", name(*operand));
        }
        Remark::NotLookedAt { operand } => {
            return format!(
                "The search does not look at operand {operand} ({}): the line misses its box, or it could change nothing.",
                name(*operand)
            );
        }
    };
    text.to_owned()
}

const AXES: [&str; 3] = ["x", "y", "z"];

fn fate_of(fate: &Fate, name: &OperandName<'_>) -> String {
    let text = match *fate {
        Fate::Hit => "a hit",
        Fate::Behind => "behind the ray's origin",
        Fate::BeforeRange { t_min } => return format!("before the range, which begins at {}", exact(t_min)),
        Fate::BeyondRange { t_max } => return format!("beyond the range, which ends at {}", exact(t_max)),
        Fate::OtherNappe { radius } => return format!("on the other nappe (radius {})", exact(radius)),
        Fate::OutsideHeights { z, min, max } => {
            return format!("at height {}, outside of {} to {}", exact(z), exact(min), exact(max));
        }
        Fate::OutsideSegment { v } => {
            return format!("beyond the ends of the segment (at {} of it)", exact(v));
        }
        Fate::OutsideSweep { phi, max } => {
            return format!(
                "at an azimuth of {}°, beyond {}°",
                exact(phi.to_degrees()),
                exact(max.to_degrees())
            );
        }
        Fate::OutsideRim { distance, radius } => {
            return format!("{} from the centre, beyond the rim at {}", exact(distance), exact(radius));
        }
        Fate::InsideHole { distance, radius } => {
            return format!("{} from the centre, in the hole of radius {}", exact(distance), exact(radius));
        }
        Fate::OutsideEdges { weights: [a, b, c] } => {
            return format!("outside the edges (weights {}, {}, {})", exact(a), exact(b), exact(c));
        }
        Fate::OutsidePatch { u, v } => {
            return format!("outside the patch (u = {}, v = {})", exact(u), exact(v));
        }
        Fate::OutsideSlab { axis, enter, leave } if enter.is_infinite() && enter == leave => {
            return format!("outside the slab of {}, which the line never enters", AXES[axis]);
        }
        Fate::OutsideSlab { axis, enter, leave } => {
            return format!(
                "outside the slab of {}, which is from t = {} to {}",
                AXES[axis],
                exact(enter),
                exact(leave)
            );
        }
        Fate::OutsideBox { axis, value, min, max } => {
            return format!(
                "{} = {}, outside the clipping box ({} to {})",
                AXES[axis],
                exact(value),
                exact(min),
                exact(max)
            );
        }
        Fate::InsideSolid => "within the solid, on a surface that continues one of its parts",
        Fate::Shared { part } => return format!("at the seam of two parts; it counts for part {part}"),
        Fate::Flat => "the triangle has no area",
        Fate::Touch => "the line only touches the operand",
        Fate::InsideOperand { operand } => {
            return format!("inside operand {operand} ({}): nothing begins or ends there", name(operand));
        }
        Fate::OutsideOperand { operand } => {
            return format!("outside operand {operand} ({}): nothing begins or ends there", name(operand));
        }
        Fate::Coincides { operand } => {
            return format!("on the surface of operand {operand} ({}) as well", name(operand));
        }
        Fate::NoChange { inside: true } => "inside the result on both sides",
        Fate::NoChange { inside: false } => "outside the result on both sides",
        Fate::NotReturned => "not returned by the search",
    };
    text.to_owned()
}

fn kind_of(kind: &'static str) -> &'static str {
    kind
}

fn symbol(topic: Topic, symbol: &str, kind: &str) -> &'static str {
    match (topic, symbol, kind) {
        (Topic::Parameters, "P₀", "plane") => "a point of it",
        (Topic::Parameters, "P₀", "box") => "the corner with the lower coordinates",
        (Topic::Parameters, "P₁", "box") => "the corner with the higher coordinates",
        (Topic::Parameters, "P₀" | "P₁" | "P₂", "triangle") => "corner",
        (Topic::Parameters, "P₀₀" | "P₁₀" | "P₀₁" | "P₁₁", _) => "corner at this u and v",
        (Topic::Parameters, "P₁", "hyperboloid") => "first end of the segment that sweeps it",
        (Topic::Parameters, "P₂", "hyperboloid") => "its second end",
        (Topic::Parameters, "P₁", _) => "first end of the axis",
        (Topic::Parameters, "P₂", _) => "second end of the axis",
        (Topic::Parameters, "n", _) => "normal",
        (Topic::Parameters, "r₀", _) => "radius of the hole",
        (Topic::Parameters, "H", "paraboloid") => "height at which it has that radius",
        (Topic::Parameters, "Z", _) => "direction of its axis",
        (Topic::Parameters, "Q₁" | "Q₂" | "Q₃", _) => {
            "row of the symmetric matrix of its squares and products"
        }
        (Topic::Parameters, "G", _) => "half of its coefficients of x, y and z",
        (Topic::Parameters, "j", _) => "its constant",
        (Topic::Parameters | Topic::FirstBall | Topic::SecondBall, "C", _) => "centre",
        (Topic::Parameters, "r", "torus") => "radius of the tube",
        (Topic::Parameters | Topic::FirstBall | Topic::SecondBall, "r", _) => "radius",
        (Topic::Parameters, "R", _) => "radius of the circle in the middle of the tube",
        (Topic::Parameters, "r₁", _) => "radius at the first end",
        (Topic::Parameters, "r₂", _) => "radius at the second end",
        (Topic::Parameters, "k", _) => "what the radius grows by along the axis",
        (Topic::Parameters, "V", _) => "unit axis",
        (Topic::ScaledRay, "λ", _) => "factor of the direction",
        (Topic::ScaledRay, "D", _) => {
            "the direction over λ, which the steps below use; their t are λ times as large"
        }
        (Topic::SetUp | Topic::TorusFrame, "W", _) => "the ray's origin as seen from the shape",
        (Topic::SetUp, "t₀", _) => "where the equation is set up",
        (Topic::SetUp, "W₀", _) => "the place there",
        (Topic::Quadratic, "U", _) => "axis from end to end, with a length near 1",
        (Topic::Quadratic, "K", _) => "what the radius grows by along U, times its length",
        (Topic::Quadratic, "ρ₀", _) => "radius where W begins, times U·U",
        (Topic::Quadratic, "ε₂", _) => "bound on the error of a, in units of 2⁻⁵³",
        (Topic::Quadratic, "ε₁", _) => "the same for h",
        (Topic::Quadratic, "ε₀", _) => "the same for c",
        (Topic::Discriminant, "l", _) => "from the centre to the nearest point of the line",
        (Topic::Discriminant, "ε", _) => "bound on the error of Δ",
        (Topic::Nappe, "g", _) => "what the radius grows by along the ray",
        (Topic::Nappe, "ρ", _) => "radius in the middle of the roots; negative on the other nappe",
        (Topic::TorusFrame, "g", _) => "length of the direction",
        (Topic::TorusFrame, "t₀", _) => "where the line is nearest to the centre",
        (Topic::TorusFrame, "s₀", _) => "what rounding leaves between there and p",
        (Topic::TorusFrame, "p", _) => "the point there, along the axes of the torus",
        (Topic::TorusFrame, "U", _) => "unit direction along the same axes",
        (Topic::TorusBounds, "σ₁", _) => "the part of the line from there …",
        (Topic::TorusBounds, "σ₂", _) => "… to there, in lengths from p",
        (Topic::QuarticExtrema, "s", _) => "where the derivative is 0, in lengths from p",
        (Topic::QuarticExtrema, "y", _) => "the value of the quartic at each of them",
        (Topic::QuarticRoots, "s₁" | "s₂" | "s₃" | "s₄", _) => "root, in lengths from p",
        (Topic::TextbookQuartic, "τ", _) => "its real roots",
        (Topic::Shear, "i₁" | "i₂", _) => "coordinate axis",
        (Topic::Shear, "i₃", _) => "coordinate axis, the one that the direction is longest along",
        (Topic::Winding, "σ", _) => "sign of each",
        (Topic::Winding, "n", _) => "how often the outline winds about the ray",
        (Topic::Rulings, "w₁" | "w₂", _) => "u of a ruling that meets the ray",
        (Topic::Roots, "x₄" | "y₄" | "x₇" | "y₇", "bilinear") => {
            "where this ruling starts, as seen along the ray"
        }
        (Topic::Roots, "x₅" | "y₅" | "x₈" | "y₈", "bilinear") => "where it ends",
        (Topic::Roots, "v′₁" | "v′₂", "bilinear") => "v of its point nearest to the ray",
        (Topic::Roots, "x₆" | "y₆" | "x₉" | "y₉", "bilinear") => "how far that point is off the ray",
        (Topic::Roots, "g₁" | "g₂" | "g₃" | "g₄", "bilinear") => "derivative along u",
        (Topic::Roots, "A₁" | "A₂", "bilinear") => "area of the derivatives along u and along v",
        (Topic::Roots, "u₁" | "u₂" | "v₁" | "v₂", "bilinear") => {
            "place on the patch, after a step of Newton's method"
        }
        (Topic::Roots, "t₁" | "t₂", "bilinear") => "t there",
        (Topic::Span, "I₀", "capsule") => "within the side, between both planes",
        (Topic::Span, "I₁", "capsule") => "within the ball about the first end",
        (Topic::Span, "I₂", "capsule") => "within the ball about the second end",
        (Topic::Span, "t₁", "capsule") => "where the line enters: the first of all ends",
        (Topic::Span, "t₂", "capsule") => "where it leaves: the last of all ends",
        (Topic::Intervals, "I", _) => "within the result",
        (Topic::Intervals, _, _) => "within the operand of this number",
        (Topic::Surface, "P", _) => "the point",
        (Topic::Surface, "N", _) => "outward unit normal",
        (Topic::Surface, "u" | "v", _) => "surface parameter",
        _ => "",
    }
}
