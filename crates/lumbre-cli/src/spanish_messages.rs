//! What is wrong with a scene and with the options of its picture, in Spanish: a table of the sentences in which
//! readers say it.
//!
//! Readers write `PLACE: SENTENCE (found X; expected Y; did you mean Z?)`. A sentence that is not in the table stays as
//! it is.

/// Sentences in both languages. `{}` stands for what comes from the scene, in the same order in both.
const SENTENCES: &[(&str, &str)] = &[
    ("unknown parameter {} of {}", "parámetro desconocido {} de {}"),
    ("unknown {} {}: it is left out", "{} {} no se conoce: se omite"),
    ("unknown directive {}", "directiva desconocida {}"),
    ("unknown type of parameter {}", "tipo desconocido del parámetro {}"),
    ("unknown spectrum {}", "espectro desconocido {}"),
    ("unknown sensor {}", "sensor desconocido {}"),
    ("unknown preset {}", "valor predefinido desconocido {}"),
    ("unknown option {}", "opción desconocida {}"),
    ("unknown medium {}", "medio desconocido {}"),
    ("unknown aperture {}", "apertura desconocida {}"),
    ("unknown coordinate system {}", "sistema de coordenadas desconocido {}"),
    ("unknown colour space", "espacio de color desconocido"),
    ("unknown kind of texture", "tipo de textura desconocido"),
    ("unknown kind of Attribute", "tipo de Attribute desconocido"),
    ("unknown kind of scene file", "tipo de archivo de escena desconocido"),
    ("unknown escape in a string", "secuencia de escape desconocida en un texto"),
    ("unsupported text encoding", "codificación de texto no admitida"),
    (
        "wrong value for parameter {}: no date with a time and its zone",
        "valor incorrecto del parámetro {}: no es una fecha con hora y zona",
    ),
    ("wrong value for parameter {}", "valor incorrecto del parámetro {}"),
    ("wrong type of parameter {}", "tipo incorrecto del parámetro {}"),
    ("wrong number of values for parameter {}", "número incorrecto de valores del parámetro {}"),
    ("wrong number of indices", "número incorrecto de índices"),
    ("wrong number of normals", "número incorrecto de normales"),
    ("wrong number of control points: {}", "número incorrecto de puntos de control: {}"),
    ("wrong value of the option {}", "valor incorrecto de la opción {}"),
    ("wrong value in {}", "valor incorrecto en {}"),
    ("wrong value of {}", "valor incorrecto de {}"),
    ("wrong argument of {}", "argumento incorrecto de {}"),
    ("wrong declaration of a parameter", "declaración incorrecta de un parámetro"),
    ("wrong surface {} of lens {}", "superficie incorrecta {} del objetivo {}"),
    ("wrong spectrum {}", "espectro incorrecto {}"),
    ("wrong lens {}", "objetivo incorrecto {}"),
    ("parameter {} of {} is out of range", "el parámetro {} de {} está fuera de rango"),
    ("index {} of the {} is out of range", "el índice {} de {} está fuera de rango"),
    ("{} without its {}", "{} sin su {}"),
    ("{} without {}", "{} sin {}"),
    ("{} inside the object {}", "{} dentro del objeto {}"),
    ("{} stands before WorldBegin; it belongs after it", "{} está antes de WorldBegin; debe ir después"),
    ("{} stands after WorldBegin; it belongs before it", "{} está después de WorldBegin; debe ir antes"),
    ("{} makes a transform that cannot be inverted", "{} da una transformación que no se puede invertir"),
    (
        "LookAt from a point to itself: eye and target are equal",
        "LookAt de un punto a sí mismo: el ojo y el objetivo son iguales",
    ),
    (
        "a {} light shines from a point to itself: from and to are equal",
        "una luz {} alumbra de un punto a sí mismo: from y to son iguales",
    ),
    (
        "a spot shines from a point to itself: from and to are equal",
        "un foco alumbra de un punto a sí mismo: from y to son iguales",
    ),
    ("a bilinearmesh of other than 4 points has no {}", "un bilinearmesh que no es de 4 puntos no tiene {}"),
    ("a {} has no {}", "un {} no tiene {}"),
    ("an {} has no {}", "un {} no tiene {}"),
    ("material {} has no {}", "el material {} no tiene {}"),
    ("{} has no type", "{} no tiene tipo"),
    ("{} has no file", "{} no tiene archivo"),
    ("{} has no lens", "{} no tiene objetivo"),
    ("{} has no density", "{} no tiene densidad"),
    ("both radii of the cone are 0", "ambos radios del cono son 0"),
    ("nothing of the cylinder lies between zmin and zmax", "nada del cilindro queda entre zmin y zmax"),
    ("nothing of the sphere lies between zmin and zmax", "nada de la esfera queda entre zmin y zmax"),
    ("p0 and p1 of the cone are the same point", "p0 y p1 del cono son el mismo punto"),
    ("p0 and p1 of the cylinder are the same point", "p0 y p1 del cilindro son el mismo punto"),
    (
        "p1 and p2 of the hyperboloid are at the same height: what they sweep is a disk",
        "p1 y p2 del hiperboloide están a la misma altura: lo que barren es un disco",
    ),
    ("p0 without p1", "p0 sin p1"),
    ("p1 without p0", "p1 sin p0"),
    ("this shape cannot be made: {}", "esta forma no se puede construir: {}"),
    ("this curve cannot be made: {}", "esta curva no se puede construir: {}"),
    ("material {} is not defined before this mix", "el material {} no se define antes de esta mezcla"),
    ("material {} is not defined", "el material {} no está definido"),
    ("material {} is defined twice", "el material {} está definido dos veces"),
    ("medium {} is not defined", "el medio {} no está definido"),
    ("medium {} is defined twice", "el medio {} está definido dos veces"),
    ("object {} is not defined before this csg", "el objeto {} no se define antes de este csg"),
    ("object {} is not defined", "el objeto {} no está definido"),
    ("object {} is defined twice", "el objeto {} está definido dos veces"),
    (
        "object {} has no shape: it is no operand of a csg",
        "el objeto {} no tiene ninguna forma: no es operando de un csg",
    ),
    (
        "object {} is an operand of a csg inside it",
        "el objeto {} es operando de un csg que está dentro de él",
    ),
    ("{} texture {} is not defined before this", "la textura {} {} no está definida antes"),
    ("{} texture {} is defined twice", "la textura {} {} está definida dos veces"),
    ("no directive before this", "no hay ninguna directiva antes de esto"),
    ("not an image that can be read", "no es una imagen que se pueda leer"),
    ("stray byte", "byte suelto"),
    ("string is not UTF-8", "el texto no es UTF-8"),
    ("string without an end on its line", "texto sin final en su línea"),
    ("the channels of film {} need an EXR file", "los canales de la película {} necesitan un archivo EXR"),
    ("the file ends too early", "el archivo acaba antes de tiempo"),
    ("the shutter closes before it opens", "el obturador se cierra antes de abrirse"),
    ("the scene has no WorldBegin", "la escena no tiene WorldBegin"),
    ("a file includes itself", "un archivo se incluye a sí mismo"),
    ("the motion ends before it starts", "el movimiento acaba antes de empezar"),
    ("the box of this medium is flat", "la caja de este medio es plana"),
    ("pixelbounds hold no pixel of the film", "pixelbounds no contiene ningún píxel de la película"),
    (
        "an area light has both L and filename: give one of them",
        "una luz de área tiene L y filename: dé uno de los dos",
    ),
    (
        "an infinite light has both L and filename: give one of them",
        "una luz infinita tiene L y filename: dé uno de los dos",
    ),
    (
        "a shape inside an object gives no light: its area light is left out",
        "una forma dentro de un objeto no da luz: se omite su luz de área",
    ),
    (
        "a light inside an object stands in the world, once",
        "una luz dentro de un objeto está en el mundo, una sola vez",
    ),
    (
        "indices that make no whole triangle are dropped",
        "se omiten los índices que no forman un triángulo entero",
    ),
    (
        "this is of pbrt-v3: the scene is upgraded to pbrt-v4 while it is read",
        "esto es de pbrt-v3: la escena se convierte a pbrt-v4 al leerla",
    ),
    ("cannot open {}: {}", "no se puede abrir {}: {}"),
    ("cannot read {}: {}", "no se puede leer {}: {}"),
    ("cannot open: {}", "no se puede abrir: {}"),
    ("cannot read: {}", "no se puede leer: {}"),
    ("cannot write: {}", "no se puede escribir: {}"),
    ("{}: needs {} {}, limit {}; raise it with {}", "{}: necesita {} {}, el límite es {}; se sube con {}"),
    (
        "{}: needs {} bytes of memory, {} are left; raise it with {}",
        "{}: necesita {} bytes de memoria y quedan {}; se sube con {}",
    ),
    ("the scene has no light: its picture is black", "la escena no tiene luz: su imagen es negra"),
    ("light {}: its picture is black, it gives no light", "luz {}: su imagen es negra y no alumbra"),
    ("shape {}: {}", "forma {}: {}"),
    (
        "a picture of {} by {} pixels cannot be made (1 to 65536 each way, 2^30 in all)",
        "no se puede hacer una imagen de {} por {} píxeles (de 1 a 65536 en cada sentido, 2^30 en total)",
    ),
    ("it is an input ({}), which would be overwritten", "es una entrada ({}), que se sobrescribiría"),
    ("--eye and --target are one point", "--eye y --target son un mismo punto"),
    ("--shutter needs the time of a picture", "--shutter necesita el instante de una imagen"),
    ("--fov: {} is orthographic", "--fov: {} es ortográfica"),
    ("there is no {} {}", "no existe {} {}"),
    ("there is no {}", "no existe {}"),
    ("{} has no parameter {}", "{} no tiene el parámetro {}"),
    ("no environment map", "no es un mapa de entorno"),
    (
        "the sun is below the horizon, and the night has no model",
        "el sol está bajo el horizonte, y la noche no tiene modelo",
    ),
    ("the turbidity is out of range", "la turbiedad está fuera de su intervalo"),
    ("a sky has both {} and {}: give one of them", "un cielo tiene {} y {}: dé solo uno"),
];

/// What was found or expected, in both languages; others are names, numbers and quotations, which are the same in both.
const DETAILS: &[(&str, &str)] = &[
    ("a finite number greater than 0", "un número finito mayor que 0"),
    ("a finite number", "un número finito"),
    ("a number from {} to {}", "un número de {} a {}"),
    ("a number from {} up", "un número de {} en adelante"),
    ("a number above 0", "un número mayor que 0"),
    ("a number", "un número"),
    ("a whole number", "un número entero"),
    ("one as {}", "una como {}"),
    ("an elevation of {} degrees", "una elevación de {} grados"),
    ("from {}, clear, to {}, hazy", "de {}, claro, a {}, brumoso"),
    ("more than {} and less than {} degrees", "más de {} y menos de {} grados"),
    ("more than {}", "más de {}"),
    ("less than {}", "menos de {}"),
    ("from {} to less than {}", "de {} a menos de {}"),
    ("degrees in (0, 360]", "grados en (0, 360]"),
    ("the names of two objects or more", "los nombres de dos objetos o más"),
    ("{} or more", "{} o más"),
    ("{} to {} nm", "de {} a {} nm"),
    ("{} to {}", "de {} a {}"),
    ("a directive such as Shape", "una directiva como Shape"),
    ("a file that starts with {}", "un archivo que empieza por {}"),
    ("PNG, JPEG, EXR, HDR, PFM, TGA, BMP, QOI or WebP", "PNG, JPEG, EXR, HDR, PFM, TGA, BMP, QOI o WebP"),
    ("a name that ends in .exr", "un nombre que acaba en .exr"),
    ("a file name in quotes", "un nombre de archivo entre comillas"),
    ("a name in quotes", "un nombre entre comillas"),
    ("a type in quotes", "un tipo entre comillas"),
    ("a value for parameter {}", "un valor del parámetro {}"),
    ("a type and a name such as {}", "un tipo y un nombre como {}"),
    ("a closing quote", "unas comillas de cierre"),
    ("shutterclose after shutteropen = {}", "shutterclose después de shutteropen = {}"),
    ("one of: {}", "uno de: {}"),
    ("one of {}", "uno de {}"),
    ("StartTime, EndTime or All", "StartTime, EndTime o All"),
    ("\"float\" or \"spectrum\"", "\"float\" o \"spectrum\""),
    ("the name of a built-in spectrum or of a file", "el nombre de un espectro incorporado o de un archivo"),
    ("a multiple of {}", "un múltiplo de {}"),
    ("{}, as many as points", "{}, tantos como puntos"),
    ("a temperature in kelvin, more than 0", "una temperatura en kelvin, mayor que 0"),
    ("{} numbers that are not negative", "{} números no negativos"),
    ("three numbers each", "tres números para cada uno"),
    ("one number", "un número"),
    ("{} numbers", "{} números"),
    ("{} integers", "{} enteros"),
    ("{} strings", "{} textos"),
    ("one string", "un texto"),
    ("string {}", "el texto {}"),
    ("the names of two materials", "los nombres de dos materiales"),
    ("pairs of a wavelength and a value", "pares de una longitud de onda y un valor"),
    ("wavelengths that ascend", "longitudes de onda crecientes"),
    ("true or false", "true o false"),
    ("{} or {} or {} or {}", "{} o {} o {} o {}"),
    ("{} or {}", "{} o {}"),
    ("{}, or --input-format", "{}, o --input-format"),
    ("text", "texto"),
    ("another name", "otro nombre"),
    ("two", "dos"),
    ("--zoom", "--zoom"),
    ("--frame or --frames, too", "también --frame o --frames"),
    ("none", "ninguno"),
    ("{} by {} pixels", "{} por {} píxeles"),
    (
        "twice as wide as high, or square in pbrt's equal-area mapping",
        "el doble de ancho que alto, o cuadrado con áreas iguales como en pbrt",
    ),
];

/// How what is expected begins where it is more than one thing.
const PLURALS: [&str; 14] =
    ["2", "3", "4", "5", "6", "7", "8", "9", "10 n", "16 n", "pares ", "longitudes ", "grados ", "los "];

/// Nouns of sentences before a quoted name.
const NOUNS: &[(&str, &str)] = &[
    ("shape", "la forma"),
    ("material", "el material"),
    ("light", "la luz"),
    ("camera", "la cámara"),
    ("film", "la película"),
    ("filter", "el filtro"),
    ("sampler", "el muestreador"),
    ("integrator", "el integrador"),
    ("accelerator", "el acelerador"),
    ("texture", "la textura"),
    ("medium", "el medio"),
    ("area light", "la luz de área"),
    ("transform", "la transformación"),
];

/// What the system says.
const SYSTEM: &[(&str, &str)] = &[
    ("No such file or directory", "no existe el archivo o la carpeta"),
    ("The system cannot find the file specified.", "no existe el archivo"),
    ("The system cannot find the path specified.", "no existe la carpeta"),
    ("Permission denied", "permiso denegado"),
    ("Access is denied.", "permiso denegado"),
    ("Is a directory", "es una carpeta"),
    ("Not a directory", "no es una carpeta"),
    ("No space left on device", "no queda espacio en el dispositivo"),
];

/// A message of a reader, in Spanish.
pub(crate) fn in_spanish(message: &str) -> String {
    let mut lines = message.split("\n  included from ");
    let mut text = line_in_spanish(lines.next().unwrap_or_default());
    lines.for_each(|place| text.push_str(&format!("\n  incluido desde {place}")));
    text
}

fn line_in_spanish(line: &str) -> String {
    for (severity, spanish) in [("warning: ", "aviso: "), ("note: ", "nota: "), ("error: ", "error: ")] {
        if let Some(rest) = line.strip_prefix(severity) {
            return format!("{spanish}{}", line_in_spanish(rest));
        }
    }
    let (line, more) = match line.strip_suffix(" more)").and_then(|rest| rest.rsplit_once(" (")) {
        Some((line, count)) if count.parse::<u64>().is_ok() => (line, format!(" (y {count} más)")),
        _ => (line, String::new()),
    };
    let (sentence, details) = with_details(line);
    // The place comes first, and may hold a colon itself.
    let starts = std::iter::once(0).chain(sentence.match_indices(": ").map(|(at, _)| at + 2));
    let known = starts.into_iter().find_map(|at| {
        let spanish = by_table(SENTENCES, &sentence[at..]).or_else(|| of_system(&sentence[at..]))?;
        Some(format!("{}{spanish}", &sentence[..at]))
    });
    format!("{}{}{more}", known.unwrap_or_else(|| sentence.to_owned()), details_in_spanish(details))
}

/// A sentence, and what stands behind it in parentheses.
fn with_details(line: &str) -> (&str, &str) {
    let begins = ["(found ", "(expected ", "(did you mean "].map(|begin| line.find(&format!(" {begin}")));
    match begins.into_iter().flatten().min() {
        Some(at) if line.ends_with(')') => (&line[..at], &line[at + 2..line.len() - 1]),
        _ => (line, ""),
    }
}

fn details_in_spanish(details: &str) -> String {
    if details.is_empty() {
        return String::new();
    }
    // A quotation may hold a semicolon.
    let separators = ["; expected ", "; did you mean "];
    let mut cuts: Vec<usize> = separators.iter().filter_map(|separator| details.rfind(separator)).collect();
    cuts.sort_unstable();
    let starts = std::iter::once(0).chain(cuts.iter().map(|at| at + 2));
    let ends = cuts.iter().copied().chain([details.len()]);
    let parts = starts.zip(ends).map(|(from, to)| {
        let part = &details[from..to];
        if let Some(found) = part.strip_prefix("found ") {
            format!("se encontró {}", detail(found))
        } else if let Some(expected) = part.strip_prefix("expected ") {
            let expected = detail(expected);
            let is_plural = PLURALS.iter().any(|begin| expected.starts_with(begin));
            format!("{} {expected}", if is_plural { "se esperaban" } else { "se esperaba" })
        } else {
            let name = part.trim_start_matches("did you mean ").trim_end_matches('?');
            format!("¿quería decir {name}?")
        }
    });
    format!(" ({})", parts.collect::<Vec<_>>().join("; "))
}

fn detail(text: &str) -> String {
    // A quotation from the scene is what it is.
    if text.starts_with('"') && text.ends_with('"') && text.matches('"').count() == 2 {
        return text.to_owned();
    }
    by_table(DETAILS, text).unwrap_or_else(|| text.to_owned())
}

/// The translation of the first entry that a text fits.
pub(crate) fn by_table(table: &[(&str, &str)], text: &str) -> Option<String> {
    table.iter().find_map(|(english, spanish)| {
        let parts = fitted(english, text)?;
        let parts = parts.iter().map(|part| part_in_spanish(part));
        let mut pieces = spanish.split("{}");
        let first = pieces.next().unwrap_or_default().to_owned();
        Some(parts.zip(pieces).fold(first, |text, (part, piece)| text + &part + piece))
    })
}

/// What stands for each `{}` of a pattern in a text that fits it.
fn fitted<'t>(pattern: &str, text: &'t str) -> Option<Vec<&'t str>> {
    let mut pieces = pattern.split("{}");
    let mut rest = text.strip_prefix(pieces.next()?)?;
    let mut parts = Vec::new();
    let pieces: Vec<&str> = pieces.collect();
    for (i, piece) in pieces.iter().enumerate() {
        let is_last = i + 1 == pieces.len();
        let at = match (is_last, piece.is_empty()) {
            (true, true) => rest.len(),
            (true, false) => rest.strip_suffix(piece)?.len(),
            (false, _) => rest.find(piece)?,
        };
        if at == 0 {
            return None;
        }
        parts.push(&rest[..at]);
        rest = &rest[at + piece.len()..];
    }
    rest.is_empty().then_some(parts)
}

/// What the system says, with the number of its error.
fn of_system(text: &str) -> Option<String> {
    SYSTEM.iter().find_map(|(english, spanish)| {
        let rest = text.strip_prefix(english)?.trim();
        let number = rest.strip_prefix("(os error ").and_then(|rest| rest.strip_suffix(')'));
        Some(match number {
            Some(number) => format!("{spanish} (error {number} del sistema)"),
            None => (*spanish).to_owned(),
        })
    })
}

/// A part of a sentence: what the system says, a noun and its name, or what is the same in both languages.
fn part_in_spanish(part: &str) -> String {
    if let Some(said) = of_system(part) {
        return said;
    }
    for (english, spanish) in NOUNS {
        if let Some(name) = part.strip_prefix(english).and_then(|rest| rest.strip_prefix(' ')) {
            return format!("{spanish} {name}");
        }
        if part == *english {
            return spanish.split_once(' ').map_or(*spanish, |(_, noun)| noun).to_owned();
        }
    }
    part.to_owned()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn messages_of_scenes_are_in_spanish() {
        for (english, spanish) in [
            (
                "warning: b.pbrt:1:27: unknown parameter \"radio\" of shape \"sphere\" (did you mean \"radius\"?)",
                "aviso: b.pbrt:1:27: parámetro desconocido \"radio\" de la forma \"sphere\" (¿quería decir \"radius\"?)",
            ),
            (
                "e.pbrt:1:27: parameter \"radius\" of shape \"sphere\" is out of range (found -1; expected a finite number greater than 0)",
                "e.pbrt:1:27: el parámetro \"radius\" de la forma \"sphere\" está fuera de rango (se encontró -1; se esperaba un número finito mayor que 0)",
            ),
            (
                "C:/a b.pbrt: cannot open: No such file or directory (os error 2)",
                "C:/a b.pbrt: no se puede abrir: no existe el archivo o la carpeta (error 2 del sistema)",
            ),
            (
                "a.pbrt:2:1: wrong value for parameter \"L\" (found string \"; expected x\"; expected 3 numbers)\n  included from b.pbrt:1:1",
                "a.pbrt:2:1: valor incorrecto del parámetro \"L\" (se encontró el texto \"; expected x\"; se esperaban 3 números)\n  incluido desde b.pbrt:1:1",
            ),
            ("a.txt: Permission denied (os error 13)", "a.txt: permiso denegado (error 13 del sistema)"),
            ("warning: unknown directive \"x\" (5 more)", "aviso: directiva desconocida \"x\" (y 5 más)"),
            ("what nobody foresaw", "what nobody foresaw"),
        ] {
            assert_eq!(in_spanish(english), spanish);
        }
    }

    /// The lines that the catalogue of malformed scenes says of pbrt files.
    fn catalogue() -> Vec<&'static str> {
        let text = include_str!("../tests/malformed/pbrt.txt");
        let lines: Vec<&str> = text.lines().collect();
        lines.windows(2).filter(|pair| pair[0].starts_with("--- ")).map(|pair| pair[1]).collect()
    }

    #[test]
    fn what_the_catalogue_of_malformed_scenes_says_is_in_spanish() {
        const ENGLISH: [&str; 22] = [
            "the", "of", "is", "are", "wrong", "unknown", "expected", "found", "without", "has", "not",
            "cannot", "before", "after", "more", "than", "numbers", "number", "or", "from", "to", "and",
        ];
        let all = catalogue();
        assert!(all.len() > 140, "{}", all.len());
        let mut wrong = Vec::new();
        for line in all {
            let spanish = in_spanish(line);
            // What is quoted comes from the scene.
            let outside: String = spanish.split('"').step_by(2).collect();
            let words = outside.split(|c: char| !c.is_alphabetic());
            // `from` and `to` are parameters of lights.
            let is_of_light = spanish.contains("from y to");
            let left: Vec<&str> = words.filter(|word| ENGLISH.contains(word) && !is_of_light).collect();
            wrong.extend((!left.is_empty()).then(|| format!("{left:?} in {spanish}")));
        }
        assert!(wrong.is_empty(), "{wrong:#?}");
    }

    #[test]
    fn both_languages_have_the_same_places() {
        for (english, spanish) in [SENTENCES, DETAILS].concat() {
            assert_eq!(english.matches("{}").count(), spanish.matches("{}").count(), "{english}");
        }
    }
}
