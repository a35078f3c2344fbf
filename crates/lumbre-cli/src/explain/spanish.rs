//! The sentences of explanations in Spanish.

use lumbre::geometry::{Fate, Remark, Topic};

use super::numbers::exact;
use super::texts::{OperandName, Texts};

pub(super) static SPANISH: Texts = Texts {
    code: "es",
    language: "Español",
    topic,
    remark,
    fate_of,
    kind_of,
    kind_of_light,
    parameter,
    symbol,
    camera: "La cámara",
    kind: "tipo",
    name: "nombre",
    size: "tamaño de la imagen",
    eye: "posición",
    right: "hacia la derecha de la imagen",
    up: "hacia arriba",
    forward: "hacia dentro de la imagen",
    look_at: "matriz look-at, del mundo a la cámara",
    projection: "matriz de proyección, desde el espacio de la cámara con profundidades de {0} a {1} (los rayos no necesitan ninguno de los dos límites)",
    perspective: "perspectiva, {0}° en el lado más corto",
    lens: "con una lente de radio {0} enfocada a {1}",
    orthographic: "ortográfica",
    spherical: "esférica, todas las direcciones a la vez",
    realistic: "un objetivo real de distancia focal {0} mm, a {1} mm de la película, cuya diagonal mide {2} mm",
    of_meshes: "las caras de mallas, de las que salen los rayos",
    pixel: "píxel",
    film_point: "punto de la película, en píxeles desde la esquina superior izquierda",
    screen_point: "punto de la pantalla (a distancia 1 en una perspectiva)",
    lens_point: "punto de la lente, como dos números en [0, 1)",
    direction_in_camera: "dirección en el espacio de la cámara",
    direction_turned: "girada al mundo, por la inversa de la matriz look-at",
    origin: "origen del rayo",
    direction: "dirección del rayo",
    range: "rango de t",
    time: "tiempo",
    ray_is: "El rayo son los puntos O + t·D con t en este rango.",
    given_ray: "El rayo",
    surfaces: "Lo que encuentra el rayo",
    nothing_met: "Nada: el rayo sale de la escena.",
    more_hits: "Hay más: se muestran {0} intersecciones.",
    shape: "forma {0}, {1}",
    material: "material",
    no_material: "ninguno",
    instance: "instancia",
    triangle: "triángulo de la malla",
    transform: "Al espacio del objeto",
    chain: "Las transformaciones del objeto al mundo, la más externa primero; M es su producto.",
    decomposes: "M = T·Rz·Ry·Rx·S, con:",
    scale: "escala S en x, y, z",
    rotations: "rotaciones alrededor de x, y, z en grados",
    translation: "traslación T",
    sheared: "M contiene un cizallamiento: no es una escala con rotaciones y una traslación.",
    as_point: "el origen como punto, w = 1",
    as_direction: "la dirección como dirección, w = 0",
    t_is_kept: "D′ no se normaliza, así que t designa el mismo punto en ambos espacios. Con direcciones unitarias sería |D′| veces mayor.",
    equation: "Las intersecciones",
    curve: "Un segmento de una curva, una cúbica dada por sus puntos de control. El rayo lo corta si pasa a menos de la mitad de su anchura; \
            donde pasa más cerca, lo corta a la profundidad de su eje.",
    curve_segment: "segmento de las curvas",
    curve_width: "anchura en ese lugar",
    curve_axis: "eje donde el rayo pasa más cerca",
    curve_distance: "distancia del rayo al eje",
    custom: "Geometría propia de un programa: aquí no se sabe cómo halla sus intersecciones.",
    hit: "La intersección en t = {0}",
    t_of_search: "tal como se calcula",
    is_seen: "Es la que se ve.",
    point: "el punto, sobre la superficie",
    reprojected: "P se devuelve a la superficie; O + t·D dista {0} de ella por el redondeo.",
    normal_in_object: "normal exterior en el espacio del objeto",
    by_inverse_transpose: "por la traspuesta de la inversa",
    normal: "normal exterior unitaria",
    front: "N·D < 0: el rayo encuentra la cara externa; la normal orientada hacia el rayo es N.",
    back: "N·D > 0: el rayo encuentra la cara interna; la normal orientada hacia el rayo es −N.",
    grazing: "N·D = 0: el rayo es tangente a la superficie.",
    part: "parte",
    multiplicity: "multiplicidad",
    fate: "si cuenta",
    fates: "Qué intersecciones cuentan",
    operand_origin: "origen del rayo en el espacio del operando",
    operand_direction: "dirección del rayo allí",
    operand: "Operando {0}, {1}",
    not_looked_at: "El rayo no corta su caja: la búsqueda no lo examina.",
    light: "La luz",
    start: "El comienzo",
    left: "El rayo sale de la escena",
    throughput: "lo que transporta el camino",
    radiance: "luz que se suma aquí, antes de β y w",
    mis_weight: "peso MIS",
    added: "lo que se suma",
    survives: "Por azar el camino sigue, con probabilidad {0}, y transporta más en la proporción inversa.",
    does_not_survive: "Por azar el camino termina aquí; habría seguido con probabilidad {0}.",
    medium: "Un medio",
    medium_scattered: "El camino se dispersa allí.",
    medium_passed: "El camino lo atraviesa.",
    distance: "distancia",
    blocked: "parte de la luz sobre el suelo que algo bloquea",
    occluded: "Algo se interpone.",
    open: "Nada se interpone.",
    sum: "Toda la luz de este camino",
    source: "de",
    no_light: "No se halló luz.",
    radiance_of_sample: "radiancia de esta muestra, tal como se suma al píxel",
    vertex: "Vértice {0} del camino: {1}",
    shading_normal: "normal de sombreado",
    texture: "(por una textura)",
    mirror: "Dirección de espejo",
    facing: "la normal orientada hacia el rayo",
    reflected: "la dirección reflejada",
    index_here: "índice de refracción de este lado",
    index_beyond: "índice de refracción del otro lado",
    cos_incident: "coseno del ángulo de incidencia",
    cos_squared: "cuadrado del coseno del ángulo de refracción",
    refracted: "la dirección refractada",
    total_reflection: "κ < 0: todo se refleja, nada se refracta.",
    each_light: "Cada luz, desde aquí",
    each_light_is: "Cada luz se examina en su centro; el camino de abajo muestrea puntos al azar.",
    light_number: "luz",
    towards_light: "hacia ella",
    arriving: "radiancia que llega",
    pdf: "densidad por ángulo sólido",
    visible: "se ve",
    contribution: "la luz dispersada por la superficie",
    yes: "sí",
    no: "no",
    more_lights: "Hay {0} luces; se muestran las primeras.",
    sampled_light: "Se muestrea una luz",
    scattered: "f·|cos θ| hacia ella",
    no_shadow_ray: "La superficie no dispersaría nada de ella: ningún rayo comprueba si se ve.",
    bsdf_pdf: "densidad de la BSDF",
    shadow_origin: "origen del rayo de sombra, separado de la superficie por su error",
    shadow_direction: "dirección del rayo de sombra",
    visibility: "fracción que llega",
    blocked_by: "Se interpone: {0}, en t = {1}.",
    goes_on: "El camino sigue",
    transmitted: "Se transmite.",
    is_reflected: "Se refleja.",
    only_direction: "Es la única dirección de su clase (un espejo, o vidrio): no tiene densidad.",
    bsdf_weight: "f·|cos θ| entre la densidad",
    throughput_after: "lo que transporta el camino después",
    from_surface: "luz de la superficie",
    from_infinity: "luz del infinito",
    from_medium: "luz del medio",
    from_sampled: "una luz muestreada",
    from_direct: "todas las luces que la iluminan",
    from_caustics: "fotones cercanos al punto",
    photons: "Fotones cercanos al punto, primero los más brillantes: luz que llegó por espejos o a través de vidrio",
    photon_from: "de dónde viene",
    photon_irradiance: "Eₚ (irradiancia, de frente)",
    photon_scattered: "f·Eₚ·wₚ (dispersado hacia el observador)",
    more_photons: "{0} más aportan en total {1}.",
    end_depth: "El camino tiene tantos rebotes como puede tener.",
    end_nothing: "Aquí nada dispersa la luz.",
    end_absorbed: "Todo se absorbe.",
    end_roulette: "Termina por azar.",
    end_medium: "Termina en el medio.",
    schoolbook: "según el libro de texto",
    title: "Cómo lo calcula Lumbre",
    sketch: "Los puntos llenos son intersecciones válidas; los huecos, intersecciones de la recta que no lo son. Donde el rayo empieza punteado, su origen está más lejos de lo que se dibuja.",
    world_space: "En el mundo",
    object_space: "En el espacio propio de la forma",
    plot: "A lo largo del rayo",
    plot_of_intervals: "Los intervalos de t a lo largo del rayo",
    slider: "t a lo largo del rayo",
    step_by_step: "Paso a paso",
    previous: "Anterior",
    next: "Siguiente",
    show_all: "Mostrar todo",
    step_of: "Paso {0} de {1}: {2}",
    is_missed: "El rayo no la corta.",
    lies_in_it: "El rayo está en su superficie, como en t = {0}, y no la corta.",
    meets_it: "El rayo la toca, como en t = {0}, y no la corta.",
    runs_inside: "El rayo va por dentro de ella y no la corta.",
    passes: "Pasa a una distancia de {0}; el punto más cercano está en t = {1}.",
    passes_in_object: "En el espacio del objeto pasa a una distancia de {0}; el punto más cercano está en t = {1}.",
    missed: "Formas que el rayo no corta:",
    missed_nearest: "Las formas por las que pasa más cerca, y por qué no las corta:",
    no_such_shape: "--shape {0}: ninguna forma tiene este número, tipo o material (se esperaba un número, o uno de {1})",
    no_such_key: "--only {0}: ninguna sección tiene esta clave (se esperaba alguna de {1})",
    no_sections: "Este rayo no tiene ninguna sección así.",
    outside_picture: "--pixel {0}: fuera de la imagen (se esperaba menos de {1}; --size da otro tamaño)",
    in_file: "La cara en su archivo",
    baked: "M lleva estos vértices a los de la ecuación.",
    mirrored: "M refleja: los vértices giran en el otro sentido.",
    split: "La cara es plana, y se examina como dos triángulos.",
    no_wavelengths: "aviso: su imagen lleva longitudes de onda; lo que se explica es un camino de rojo, verde y azul",
    no_turntable: "--turntable hace muchas imágenes (no se esperaba --turntable)",
    nothing_asked: "no se pide nada (se esperaba --pixel X,Y, desde 0,0 en la esquina superior izquierda, o --ray OX,OY,OZ,DX,DY,DZ)",
    frame_of_same_hand: "El espacio de la cámara tiene x según e₁, y según e₂ y z según e₃. Aquí e₁×e₂ apunta según e₃: tiene el mismo sentido que los ejes de la escena.",
    frame_of_other_hand: "El espacio de la cámara tiene x según e₁, y según e₂ y z según e₃. Aquí e₁×e₂ apunta contra e₃: el espacio de la cámara es a izquierdas y la escena a derechas.",
    projected: "De vuelta a la imagen: la matriz look-at y después la de proyección llevan un punto del rayo a su píxel.",
    in_focus: "dónde está enfocado el rayo; sin lente, a distancia 1",
    point_of_ray: "un punto del rayo",
    by_look_at: "en el espacio de la cámara, por la matriz look-at",
    by_projection: "por la matriz de proyección, con w",
    by_division: "dividido entre w: en el cubo [-1, 1]³, y hacia arriba",
    back_on_film: "punto de la película, en píxeles desde la esquina superior izquierda, y hacia abajo",
    north_pole: "En un polo, 90° alrededor de y, x y z giran alrededor del mismo eje: solo x − z está determinado, y se toma z = 0.",
    south_pole: "En un polo, −90° alrededor de y, x y z giran alrededor del mismo eje: solo x + z está determinado, y se toma z = 0.",
    barycentrics: "b₁, b₂ (coordenadas baricéntricas)",
    shown_feature: "Lo que se muestra",
    openness: "Lo despejado que está el punto",
    normal_as_colour: "la normal de sombreado como color, (n + 1)/2",
    depth_along_axis: "la profundidad según el eje de la cámara",
    reflectance: "la reflectancia",
    uv_as_colour: "u y v como rojo y verde",
    is_open: "1 si no hay nada cerca en esa dirección; si no, 0",
    tree: "El árbol de rayos: bajo cada vértice están los que encuentran sus rayos reflejados y refractados.",
    going_on: "probabilidad de seguir",
    after_roulette: "lo que transporta el camino por haber seguido",
    radiance_along_ray: "radiancia a lo largo del rayo",
    radiance_before_film: "radiancia de esta muestra",
    exposure: "exposición de la película: tiempo de obturación por ISO / 100",
    exposed: "expuesta",
    max_component: "mayor componente que admite la película",
    held: "reducida a ese valor, con el mismo tono",
    sensor: "por la matriz del sensor",
    filter_weight: "peso del filtro del píxel en ese punto",
    weighted: "φ por la radiancia, lo que se suma a la suma del píxel (φ se suma a su suma de pesos; el píxel es la primera suma entre la segunda)",
    cos_refracted: "coseno del ángulo de refracción",
    perpendicular: "amplitud polarizada perpendicularmente al plano de incidencia",
    parallel: "amplitud polarizada en ese plano",
    fresnel: "la reflectancia de Fresnel: la fracción que se refleja",
    intensity: "intensidad de la luz hacia aquí, entre la probabilidad de elegirla",
    cos_light: "|cos θ|, con la normal de sombreado",
    bsdf_alone: "la BSDF",
    phase: "función de fase hacia ella",
    phase_weight: "función de fase entre la densidad",
    is_scattered: "El medio la dispersa.",
    eta_entered: "índice del lado al que entra entre el del lado del que sale",
    sample: "muestra",
    weight: "peso en el píxel",
};

fn topic(topic: Topic) -> &'static str {
    match topic {
        Topic::Parameters => "La forma",
        Topic::ScaledRay => "La dirección, escalada",
        Topic::SetUp => "Dónde se plantea la ecuación",
        Topic::Quadratic => "La ecuación a·s² + 2·h·s + c = 0",
        Topic::Discriminant => "El discriminante (un cuarto del habitual)",
        Topic::Roots => "Las raíces",
        Topic::Nappe => "En qué hoja del cono",
        Topic::Tip => "El plano por el vértice",
        Topic::FirstCut => "El plano por el primer extremo",
        Topic::SecondCut => "El plano por el segundo extremo",
        Topic::FirstBall => "La bola en el primer extremo",
        Topic::SecondBall => "La bola en el segundo extremo",
        Topic::Plane => "El plano",
        Topic::Slabs => "Las franjas, eje por eje",
        Topic::Span => "El intervalo dentro del sólido",
        Topic::TorusFrame => "La recta en el marco del toro",
        Topic::TorusBounds => "Dónde está la recta cerca del toro",
        Topic::Quartic => "La ecuación de cuarto grado",
        Topic::QuarticExtrema => "Los extremos del polinomio de cuarto grado",
        Topic::QuarticRoots => "Las raíces de la ecuación de cuarto grado",
        Topic::TextbookQuartic => {
            "Para comparar: la ecuación del libro de texto c₄·t⁴ + c₃·t³ + c₂·t² + c₁·t + c₀ = 0"
        }
        Topic::Shear => "El cizallamiento que lleva el rayo a un eje",
        Topic::EdgeFunctions => "Las funciones de las aristas (sin grietas)",
        Topic::MollerTrumbore => "Para comparar: Möller y Trumbore",
        Topic::PlaneAndSides => "Para comparar: el plano y los lados de las aristas",
        Topic::Winding => "Cómo rodea el contorno al rayo",
        Topic::Rulings => "Las generatrices que cortan el rayo",
        Topic::Intervals => "Los intervalos sobre la recta",
        Topic::Surface => "La superficie en la intersección más cercana",
    }
}

fn remark(remark: &Remark, name: &OperandName<'_>) -> String {
    let text = match remark {
        Remark::NoRay => {
            "Algo en el rayo no es un número, o su dirección es cero o infinita: no encuentra nada."
        }
        Remark::Misses => "La recta no lo corta.",
        Remark::Touches => "La recta es tangente: ambas raíces son una.",
        Remark::Parallel => "La recta es paralela.",
        Remark::Between { axis } => {
            return format!(
                "La recta es paralela a ambos planos de {}, y está entre ellos o en uno de ellos.",
                AXES[*axis]
            );
        }
        Remark::Beside { axis } => {
            return format!("La recta es paralela a ambos planos de {}, y no está entre ellos.", AXES[*axis]);
        }
        Remark::AtInfinity => "a = 0: la ecuación es lineal, y una raíz se ha ido al infinito.",
        Remark::InsideThroughout => "a = h = 0 y c < 0: toda la recta está dentro, y no la corta.",
        Remark::InSurface => {
            "a = h = c = 0: la recta está contenida en la superficie, y no la corta en ningún punto."
        }
        Remark::InCappedSide => {
            "a = h = c = 0: la recta está contenida en la superficie lateral, y cuenta como interior."
        }
        Remark::AlongGenerator => {
            "a = h = c = 0: la recta es una generatriz del cono, y cuenta como interior desde el vértice."
        }
        Remark::ThroughTip => "La recta pasa por el vértice: ambas raíces son una.",
        Remark::AlongRuling => {
            "La recta sigue esta generatriz: está sobre el parche desde donde entra hasta donde sale."
        }
        Remark::EveryRuling => {
            "a = h = c = 0: todas las generatrices de esta familia cortan la recta, que es una de la otra familia."
        }
        Remark::ParallelRuling => "Una generatriz es paralela al rayo: no se cortan.",
        Remark::SchoolbookCount { crossings, roots } => {
            return format!(
                "Los coeficientes redondeados tienen otro número de raíces, {roots}, que intersecciones hay: {crossings}."
            );
        }
        Remark::SetUpNearby { start } => {
            return format!(
                "La ecuación se plantea en t₀ = {}, donde se cancelan menos dígitos que en el origen del rayo.",
                exact(*start)
            );
        }
        Remark::TwicePrecision => {
            "La doble precisión no demuestra cuántas raíces hay, o perdería dígitos: se calcula con el doble de precisión."
        }
        Remark::Cancellation { digits } => {
            return format!("La fórmula del libro de texto pierde aquí {digits:.0} de unos 16 dígitos.");
        }
        Remark::SchoolbookMisses => {
            "Por el redondeo, el discriminante del libro de texto es negativo: no hallaría lo que se corta."
        }
        Remark::SchoolbookHits => {
            "Por el redondeo, el discriminante del libro de texto no es negativo: hallaría lo que no se corta."
        }
        Remark::InPlane => "La recta está contenida en el plano, y no lo corta en ningún punto.",
        Remark::OnEdge => "Una función de arista es 0: la recta corta esa arista, o su prolongación.",
        Remark::EdgeByRoundingErrors => {
            "Dos productos se redondearon al mismo número: sus errores de redondeo deciden sobre una arista."
        }
        Remark::Disagrees => "Esta prueba dice otra cosa que la búsqueda.",
        Remark::Flat => "El triángulo no tiene área, y nunca se corta.",
        Remark::EdgeOn => "La recta está en el plano del parche, o sigue una de sus aristas.",
        Remark::Thin => {
            "El tubo es tan fino que la ecuación de cuarto grado no tiene dígitos para él: las intersecciones vienen de la ecuación del propio toro."
        }
        Remark::Descent => "La primera intersección se halla descendiendo por el polinomio.",
        Remark::Pieces => "Las intersecciones se hallan tramo a tramo, entre los extremos del polinomio.",
        Remark::StartsInside { operand } => {
            return format!("La recta empieza dentro del operando {operand} ({}).", name(*operand));
        }
        Remark::NotLookedAt { operand } => {
            return format!(
                "La búsqueda no examina el operando {operand} ({}): la recta no corta su caja, o no podría cambiar nada.",
                name(*operand)
            );
        }
    };
    text.to_owned()
}

const AXES: [&str; 3] = ["x", "y", "z"];

fn fate_of(fate: &Fate, name: &OperandName<'_>) -> String {
    let text = match *fate {
        Fate::Hit => "intersección válida",
        Fate::Behind => "detrás del origen del rayo",
        Fate::BeforeRange { t_min } => return format!("antes del rango, que empieza en {}", exact(t_min)),
        Fate::BeyondRange { t_max } => return format!("más allá del rango, que acaba en {}", exact(t_max)),
        Fate::OtherNappe { radius } => return format!("en la otra hoja del cono (radio {})", exact(radius)),
        Fate::OutsideHeights { z, min, max } => {
            return format!("a la altura {}, fuera de {} a {}", exact(z), exact(min), exact(max));
        }
        Fate::OutsideSegment { v } => {
            return format!("más allá de los extremos del segmento (en {} de él)", exact(v));
        }
        Fate::OutsideSweep { phi, max } => {
            return format!(
                "a un acimut de {}°, más allá de {}°",
                exact(phi.to_degrees()),
                exact(max.to_degrees())
            );
        }
        Fate::OutsideRim { distance, radius } => {
            return format!("a {} del centro, más allá del borde en {}", exact(distance), exact(radius));
        }
        Fate::InsideHole { distance, radius } => {
            return format!("a {} del centro, en el hueco de radio {}", exact(distance), exact(radius));
        }
        Fate::OutsideEdges { weights: [a, b, c] } => {
            return format!("fuera de las aristas (pesos {}, {}, {})", exact(a), exact(b), exact(c));
        }
        Fate::OutsidePatch { u, v } => {
            return format!("fuera del parche (u = {}, v = {})", exact(u), exact(v));
        }
        Fate::OutsideSlab { axis, enter, leave } if enter.is_infinite() && enter == leave => {
            return format!("fuera de la franja de {}, en la que la recta no entra nunca", AXES[axis]);
        }
        Fate::OutsideSlab { axis, enter, leave } => {
            return format!(
                "fuera de la franja de {}, que va de t = {} a {}",
                AXES[axis],
                exact(enter),
                exact(leave)
            );
        }
        Fate::OutsideBox { axis, value, min, max } => {
            return format!(
                "{} = {}, fuera de la caja de recorte ({} a {})",
                AXES[axis],
                exact(value),
                exact(min),
                exact(max)
            );
        }
        Fate::InsideSolid => "dentro del sólido, en una superficie que prolonga una de sus partes",
        Fate::Shared { part } => return format!("en la unión de dos partes; cuenta para la parte {part}"),
        Fate::Flat => "el triángulo no tiene área",
        Fate::Touch => "la recta solo es tangente al operando",
        Fate::InsideOperand { operand } => {
            return format!("dentro del operando {operand} ({}): ahí nada empieza ni acaba", name(operand));
        }
        Fate::OutsideOperand { operand } => {
            return format!("fuera del operando {operand} ({}): ahí nada empieza ni acaba", name(operand));
        }
        Fate::Coincides { operand } => {
            return format!("también sobre la superficie del operando {operand} ({})", name(operand));
        }
        Fate::NoChange { inside: true } => "dentro del resultado a ambos lados",
        Fate::NoChange { inside: false } => "fuera del resultado a ambos lados",
        Fate::NotReturned => "no devuelta por la búsqueda",
    };
    text.to_owned()
}

fn kind_of(kind: &'static str) -> &'static str {
    match kind {
        "sphere" => "esfera",
        "disk" => "disco",
        "cylinder" => "cilindro",
        "cone" => "cono",
        "paraboloid" => "paraboloide",
        "hyperboloid" => "hiperboloide",
        "torus" => "toro",
        "plane" => "plano",
        "box" => "caja",
        "capsule" => "cápsula",
        "quadric" => "cuádrica",
        "triangle" => "triángulo",
        "bilinear" => "parche bilineal",
        "bilinearmesh" => "malla de parches bilineales",
        "mesh" => "malla",
        "csg" => "geometría constructiva (CSG)",
        "curve" => "curva",
        "custom" => "geometría propia",
        "solid" => "sólido",
        "ground" => "suelo",
        "diffuse" => "difuso",
        "conductor" => "conductor",
        "dielectric" => "dieléctrico",
        "thindielectric" => "lámina dieléctrica",
        "coateddiffuse" => "difuso con capa",
        "coatedconductor" => "conductor con capa",
        "diffusetransmission" => "difuso translúcido",
        "principled" => "«principled»",
        "uber" => "«uber»",
        "hair" => "pelo",
        "measured" => "medido",
        "subsurface" => "subsuperficial",
        "pov" => "de POV-Ray",
        "mix" => "mezcla",
        "interface" => "interfaz",
        "point" => "puntual",
        "spot" => "foco",
        "goniometric" => "goniométrica",
        "projection" => "proyector",
        "distant" => "lejana",
        "infinite" => "infinita",
        other => other,
    }
}

fn kind_of_light(kind: &'static str) -> &'static str {
    if kind == "diffuse" { "de área" } else { kind_of(kind) }
}

fn parameter(name: &str) -> &'static str {
    match name {
        "reflectance" => "reflectancia",
        "transmittance" => "transmitancia",
        "roughness" | "interface_roughness" => "rugosidad",
        "uroughness" => "rugosidad en u",
        "vroughness" => "rugosidad en v",
        "eta" | "interface_eta" | "ior" | "index" => "índice de refracción",
        "thickness" => "espesor",
        "g" => "asimetría de la dispersión",
        "scale" => "factor",
        "amount" => "cantidad",
        "opacity" => "opacidad",
        "Kd" => "reflectancia difusa",
        "Ks" => "reflectancia brillante",
        "Kr" => "reflectancia de espejo",
        "Kt" => "transmitancia",
        "eumelanin" => "eumelanina",
        "pheomelanin" => "feomelanina",
        "beta_m" => "rugosidad a lo largo",
        "beta_n" => "rugosidad alrededor",
        "alpha" => "inclinación de las escamas",
        "base_color" => "color de base",
        "metallic" => "metalicidad",
        "anisotropy" => "anisotropía",
        "specular" => "brillo",
        "transmission" => "transmisión",
        "dispersion" => "dispersión",
        "diffuse_transmission" => "transmisión difusa",
        "diffuse_transmission_color" => "color de la transmisión difusa",
        "clearcoat" => "barniz",
        "clearcoat_roughness" => "rugosidad del barniz",
        "sheen_color" => "color del terciopelo",
        "sheen_roughness" => "rugosidad del terciopelo",
        "emissive" => "emisión",
        _ => "",
    }
}

fn symbol(topic: Topic, symbol: &str, kind: &str) -> &'static str {
    match (topic, symbol, kind) {
        (Topic::Parameters, "P₀", "plane") => "un punto suyo",
        (Topic::Parameters, "P₀", "box") => "el vértice de coordenadas menores",
        (Topic::Parameters, "P₁", "box") => "el vértice de coordenadas mayores",
        (Topic::Parameters, "P₀" | "P₁" | "P₂", "triangle") => "vértice",
        (Topic::Parameters, "P₀₀" | "P₁₀" | "P₀₁" | "P₁₁", _) => "vértice en estos u y v",
        (Topic::Parameters, "P₁", "hyperboloid") => "primer extremo del segmento que lo barre",
        (Topic::Parameters, "P₂", "hyperboloid") => "su segundo extremo",
        (Topic::Parameters, "P₁", _) => "primer extremo del eje",
        (Topic::Parameters, "P₂", _) => "segundo extremo del eje",
        (Topic::Parameters, "n", _) => "normal",
        (Topic::Parameters, "r₀", _) => "radio del hueco",
        (Topic::Parameters, "H", "paraboloid") => "altura a la que tiene ese radio",
        (Topic::Parameters, "Z", _) => "dirección de su eje",
        (Topic::Parameters, "Q₁" | "Q₂" | "Q₃", _) => {
            "fila de la matriz simétrica de sus cuadrados y productos"
        }
        (Topic::Parameters, "G", _) => "la mitad de sus coeficientes de x, y y z",
        (Topic::Parameters, "j", _) => "su constante",
        (Topic::Parameters | Topic::FirstBall | Topic::SecondBall, "C", _) => "centro",
        (Topic::Parameters, "r", "torus") => "radio del tubo",
        (Topic::Parameters | Topic::FirstBall | Topic::SecondBall, "r", _) => "radio",
        (Topic::Parameters, "R", _) => "radio del círculo en el centro del tubo",
        (Topic::Parameters, "r₁", _) => "radio en el primer extremo",
        (Topic::Parameters, "r₂", _) => "radio en el segundo extremo",
        (Topic::Parameters, "k", _) => "lo que crece el radio según el eje",
        (Topic::Parameters, "V", _) => "eje unitario",
        (Topic::ScaledRay, "λ", _) => "factor de la dirección",
        (Topic::ScaledRay, "D", _) => {
            "la dirección entre λ, que usan los pasos siguientes; sus t son λ veces mayores"
        }
        (Topic::SetUp | Topic::TorusFrame, "W", _) => "el origen del rayo visto desde la forma",
        (Topic::SetUp, "t₀", _) => "dónde se plantea la ecuación",
        (Topic::SetUp, "W₀", _) => "el punto en ese lugar",
        (Topic::Quadratic, "U", _) => "eje de extremo a extremo, de longitud cercana a 1",
        (Topic::Quadratic, "K", _) => "lo que crece el radio según U, por su longitud",
        (Topic::Quadratic, "ρ₀", _) => "radio donde empieza W, por U·U",
        (Topic::Quadratic, "ε₂", _) => "cota del error de a, en unidades de 2⁻⁵³",
        (Topic::Quadratic, "ε₁", _) => "lo mismo para h",
        (Topic::Quadratic, "ε₀", _) => "lo mismo para c",
        (Topic::Discriminant, "l", _) => "del centro al punto más cercano de la recta",
        (Topic::Discriminant, "ε", _) => "cota del error de Δ",
        (Topic::Nappe, "g", _) => "lo que crece el radio a lo largo del rayo",
        (Topic::Nappe, "ρ", _) => "radio en el punto medio de las raíces; negativo en la otra hoja",
        (Topic::TorusFrame, "g", _) => "longitud de la dirección",
        (Topic::TorusFrame, "t₀", _) => "dónde la recta está más cerca del centro",
        (Topic::TorusFrame, "s₀", _) => "lo que deja el redondeo entre ese lugar y p",
        (Topic::TorusFrame, "p", _) => "el punto en ese lugar, según los ejes del toro",
        (Topic::TorusFrame, "U", _) => "dirección unitaria según los mismos ejes",
        (Topic::TorusBounds, "σ₁", _) => "la parte de la recta desde aquí …",
        (Topic::TorusBounds, "σ₂", _) => "… hasta aquí, en longitudes desde p",
        (Topic::QuarticExtrema, "s", _) => "dónde se anula la derivada, en longitudes desde p",
        (Topic::QuarticExtrema, "y", _) => "el valor del polinomio en cada uno",
        (Topic::QuarticRoots, "s₁" | "s₂" | "s₃" | "s₄", _) => "raíz, en longitudes desde p",
        (Topic::TextbookQuartic, "τ", _) => "sus raíces reales",
        (Topic::Shear, "i₁" | "i₂", _) => "eje de coordenadas",
        (Topic::Shear, "i₃", _) => "eje de coordenadas, aquel en que la dirección es más larga",
        (Topic::Winding, "σ", _) => "signo de cada una",
        (Topic::Winding, "n", _) => "cuántas vueltas da el contorno alrededor del rayo",
        (Topic::Rulings, "w₁" | "w₂", _) => "u de una generatriz que corta el rayo",
        (Topic::Roots, "x₄" | "y₄" | "x₇" | "y₇", "bilinear") => {
            "dónde empieza esta generatriz, vista a lo largo del rayo"
        }
        (Topic::Roots, "x₅" | "y₅" | "x₈" | "y₈", "bilinear") => "dónde acaba",
        (Topic::Roots, "v′₁" | "v′₂", "bilinear") => "v de su punto más cercano al rayo",
        (Topic::Roots, "x₆" | "y₆" | "x₉" | "y₉", "bilinear") => {
            "cuánto se aparta ese punto del rayo"
        }
        (Topic::Roots, "g₁" | "g₂" | "g₃" | "g₄", "bilinear") => "derivada según u",
        (Topic::Roots, "A₁" | "A₂", "bilinear") => "área de las derivadas según u y según v",
        (Topic::Roots, "u₁" | "u₂" | "v₁" | "v₂", "bilinear") => {
            "lugar en el parche, tras un paso del método de Newton"
        }
        (Topic::Roots, "t₁" | "t₂", "bilinear") => "t en ese lugar",
        (Topic::Span, "I₀", "capsule") => "dentro del costado, entre ambos planos",
        (Topic::Span, "I₁", "capsule") => "dentro de la bola en el primer extremo",
        (Topic::Span, "I₂", "capsule") => "dentro de la bola en el segundo extremo",
        (Topic::Span, "t₁", "capsule") => "dónde entra la recta: el primero de todos los extremos",
        (Topic::Span, "t₂", "capsule") => "dónde sale: el último de todos los extremos",
        (Topic::Intervals, "I", _) => "dentro del resultado",
        (Topic::Intervals, _, _) => "dentro del operando de este número",
        (Topic::Surface, "P", _) => "el punto",
        (Topic::Surface, "N", _) => "normal exterior unitaria",
        (Topic::Surface, "u" | "v", _) => "parámetro de la superficie",
        _ => "",
    }
}
