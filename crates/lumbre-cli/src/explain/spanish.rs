//! The sentences of explanations in Spanish.

use lumbre::geometry::{Fate, Remark, Topic};

use super::document::exact;
use super::texts::Texts;

pub(super) static SPANISH: Texts = Texts {
    code: "es",
    language: "Español",
    topic,
    remark,
    fate_of,
    camera: "La cámara",
    kind: "tipo",
    name: "nombre",
    size: "tamaño de la imagen",
    eye: "posición",
    right: "hacia la derecha de la imagen",
    up: "hacia arriba",
    forward: "hacia dentro de la imagen",
    frame: "El espacio de la cámara tiene x según u, y según v y z según w: un marco de mano izquierda en un mundo de mano derecha.",
    look_at: "matriz look-at, del mundo a la cámara",
    projection: "matriz de proyección, para una cámara que mira hacia -z, de {0} a {1} (los rayos no necesitan ninguno de los dos límites)",
    perspective: "perspectiva, {0}° en el lado más corto",
    lens: "con una lente de radio {0} enfocada a {1}",
    orthographic: "ortográfica",
    spherical: "esférica, todas las direcciones a la vez",
    realistic: "un objetivo real de distancia focal {0} mm, a {1} mm de la película, cuya diagonal mide {2} mm",
    pixel: "píxel",
    film_point: "punto de la película, en píxeles desde la esquina superior izquierda",
    screen_point: "punto de la pantalla (a distancia 1 en una perspectiva)",
    lens_point: "punto de la lente, como dos números en [0, 1)",
    direction_in_camera: "dirección en el espacio de la cámara",
    direction_turned: "girada al mundo",
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
    sheared: "M contiene una cizalladura: no es una escala con rotaciones y una traslación.",
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
    t_of_search: "tal como lo halló la búsqueda",
    is_seen: "Es la que se ve.",
    point: "el punto, sobre la superficie",
    reprojected: "P se devuelve a la superficie; O + t·D dista {0} de ella por el redondeo.",
    normal_in_object: "normal exterior en el espacio del objeto",
    by_inverse_transpose: "por la traspuesta de la inversa",
    normal: "normal exterior unitaria",
    front: "N·D < 0: el rayo encuentra la cara externa; la normal que le da la cara es N.",
    back: "N·D > 0: el rayo encuentra la cara interna; la normal que le da la cara es −N.",
    grazing: "N·D = 0: el rayo es tangente a la superficie.",
    part: "parte",
    multiplicity: "multiplicidad",
    fate: "qué pasó con ella",
    fates: "Qué pasó con las intersecciones de toda la recta",
    operand_origin: "origen del rayo en el espacio del operando",
    operand_direction: "dirección del rayo allí",
    operand: "Operando {0}, {1}",
    not_looked_at: "El rayo no corta su caja: la búsqueda no lo examina.",
    light: "La luz",
    start: "El comienzo",
    left: "El rayo sale de la escena",
    throughput: "lo que transporta el camino",
    radiance: "luz que llega",
    mis_weight: "peso frente a la otra manera de hallar esta luz",
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
    mirror: "Un espejo, y un límite liso",
    facing: "la normal que da la cara al rayo",
    reflected: "la dirección reflejada",
    index: "índice de refracción",
    eta: "índice de este lado entre el del otro",
    cos_incident: "coseno del ángulo de incidencia",
    cos_squared: "cuadrado del coseno del ángulo de refracción",
    refracted: "la dirección refractada",
    total_reflection: "k < 0: todo se refleja, nada se refracta.",
    each_light: "Cada luz, desde aquí",
    each_light_is: "Un punto de cada luz, en su centro; el camino de abajo toma puntos al azar.",
    light_number: "luz",
    towards_light: "hacia ella",
    arriving: "radiancia que llega",
    pdf: "densidad por ángulo sólido",
    visible: "se ve",
    contribution: "lo que se dispersa de ella",
    yes: "sí",
    no: "no",
    more_lights: "Hay {0} luces; se muestran las primeras.",
    sampled_light: "Se muestrea una luz",
    scattered: "f·|cos θ| hacia ella",
    no_shadow_ray: "No se dispersaría nada de ella: ningún rayo mira si se ve.",
    bsdf_pdf: "densidad con que el material elegiría esta dirección",
    shadow_origin: "origen del rayo de sombra, separado de la superficie por su error",
    shadow_direction: "dirección del rayo de sombra",
    visibility: "lo que pasa",
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
    photon_irradiance: "E (irradiancia, de frente)",
    photon_scattered: "f·E·w (dispersado hacia el observador)",
    more_photons: "{0} más aportan en total {1}.",
    end_depth: "El camino tiene tantos rebotes como puede tener.",
    end_nothing: "Aquí nada dispersa.",
    end_absorbed: "Todo se absorbe.",
    end_roulette: "Termina por azar.",
    end_medium: "Termina en el medio.",
    schoolbook: "según el libro de texto",
    title: "Cómo lo calcula Lumbre",
    sketch: "El rayo, lo que encuentra y las normales allí",
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
        Topic::Shear => "La cizalladura que lleva el rayo a un eje",
        Topic::EdgeFunctions => "Las funciones de las aristas (sin grietas)",
        Topic::MollerTrumbore => "Para comparar: Möller y Trumbore",
        Topic::PlaneAndSides => "Para comparar: el plano y los lados de las aristas",
        Topic::Winding => "Cómo rodea el contorno al rayo",
        Topic::Rulings => "Las generatrices que cortan el rayo",
        Topic::Intervals => "Los intervalos sobre la recta",
        Topic::Surface => "La superficie en la intersección más cercana",
    }
}

fn remark(remark: &Remark) -> String {
    let text = match remark {
        Remark::NoRay => {
            "Algo en el rayo no es un número, o su dirección es cero o infinita: no encuentra nada."
        }
        Remark::Misses => "La recta no lo corta.",
        Remark::Touches => "La recta es tangente: ambas raíces son una.",
        Remark::Parallel => "La recta es paralela.",
        Remark::Between => "La recta está contenida en él, o todo el camino entre ambos planos.",
        Remark::AtInfinity => "a = 0: la ecuación es lineal, y una raíz se ha ido al infinito.",
        Remark::InsideThroughout => "La recta está dentro de extremo a extremo, y no corta nada.",
        Remark::AlongGenerator => "La recta sigue una generatriz del cono, y está dentro desde el vértice.",
        Remark::SetUpNearby { start } => {
            return format!(
                "El rayo empieza lejos: la ecuación se plantea en t₀ = {}, donde conserva sus dígitos.",
                exact(*start)
            );
        }
        Remark::TwicePrecision => {
            "La doble precisión no basta para decidir, o perdería dígitos: se calcula con el doble de precisión y se muestra redondeado."
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
        Remark::EdgeByRoundingErrors => {
            "Dos productos se redondearon al mismo número: sus errores de redondeo deciden sobre una arista."
        }
        Remark::Disagrees => "Esta prueba dice otra cosa que la búsqueda.",
        Remark::Flat => "El triángulo no tiene área, y nunca se corta.",
        Remark::EdgeOn => "La recta está en el plano del parche, o sigue una de sus aristas.",
        Remark::Thin => {
            "El tubo es tan fino que la ecuación de cuarto grado no tiene dígitos para él: las intersecciones vienen de la ecuación del propio toro."
        }
        Remark::Descent => "La primera intersección se halló descendiendo por el polinomio.",
        Remark::Pieces => "Las intersecciones se hallaron entre los extremos del polinomio, tramo a tramo.",
        Remark::StartsInside { operand } => {
            return format!("La recta empieza dentro del operando {operand}.");
        }
        Remark::NotLookedAt { operand } => {
            return format!(
                "La búsqueda no examina el operando {operand}: el rayo no corta su caja, o no podría cambiar nada."
            );
        }
    };
    text.to_owned()
}

const AXES: [&str; 3] = ["x", "y", "z"];

fn fate_of(fate: &Fate) -> String {
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
            return format!("dentro del operando {operand}: ahí nada empieza ni acaba");
        }
        Fate::OutsideOperand { operand } => {
            return format!("fuera del operando {operand}: ahí nada empieza ni acaba");
        }
        Fate::Coincides { operand } => return format!("también sobre la superficie del operando {operand}"),
        Fate::NoChange { inside: true } => "dentro del resultado a ambos lados",
        Fate::NoChange { inside: false } => "fuera del resultado a ambos lados",
        Fate::NotReturned => "no devuelta por la búsqueda",
    };
    text.to_owned()
}
