//! What is wrong with a scene and with the options of its picture, in Spanish: a table of the sentences in which
//! readers say it.
//!
//! Readers write `PLACE: SENTENCE (found X; expected Y; did you mean Z?)`. A sentence that is not in the table stays as
//! it is. Of several entries that a text fits, the one with the most characters of its own holds.

mod counted;
mod files;
mod models;
mod pov;
mod scenes;

use counted::COUNTED;
use files::FILES;
use models::MODELS;
use pov::POV;
use scenes::SCENES;

type Table = &'static [(&'static str, &'static str)];

/// The tables of sentences.
const OF_SENTENCES: [Table; 5] = [SENTENCES, SCENES, MODELS, POV, FILES];
/// The tables of what was found or expected.
const OF_DETAILS: [Table; 5] = [DETAILS, SCENES, MODELS, POV, FILES];
/// Minimum number of characters of a sentence, without those of its places.
const MIN_SENTENCE: usize = 6;

/// Sentences in both languages. `{}` stands for what comes from the scene, in the same order in both; `{=}` for what
/// stays as it is.
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
    ("{} times {}", "{} por {}"),
    ("{} times {} times {}", "{} por {} por {}"),
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
    // Of equals, the last is chosen, without the place.
    let known = starts.filter_map(|at| {
        let (known, spanish) = sentence_in_spanish(&sentence[at..])?;
        let place = sentence[..at].replace(" by the macro ", " en la macro ");
        Some((known, place + &spanish))
    });
    let known = known.max_by_key(|&(known, _)| known).map(|(_, spanish)| spanish);
    format!("{}{}{more}", known.unwrap_or_else(|| sentence.to_owned()), details_in_spanish(details))
}

/// A sentence, which may be followed by its reason, in Spanish; and how many characters of it the tables have.
fn sentence_in_spanish(text: &str) -> Option<(usize, String)> {
    let known = |text| best(&OF_SENTENCES, text).filter(|&(known, _)| known >= MIN_SENTENCE);
    let with_reason = text.match_indices(": ").filter_map(|(at, _)| {
        let (known_of_it, sentence) = known(&text[..at])?;
        let reason = &text[at + 2..];
        let (more, reason) = sentence_in_spanish(reason)
            .or_else(|| best(&OF_DETAILS, reason))
            .unwrap_or_else(|| (0, reason.to_owned()));
        Some((known_of_it + more, format!("{sentence}: {reason}")))
    });
    let whole = known(text).or_else(|| Some((1, of_system(text)?)));
    with_reason.chain(whole).max_by_key(|&(known, _)| known)
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
            let found = detail(found);
            format!("{} {found}", if is_plural(&found) { "se encontraron" } else { "se encontró" })
        } else if let Some(expected) = part.strip_prefix("expected ") {
            let expected = detail(expected);
            let is_none = ["ning", "nada "].iter().any(|begin| expected.starts_with(begin));
            let begin = if is_none { "no " } else { "" };
            format!("{begin}{} {expected}", if is_plural(&expected) { "se esperaban" } else { "se esperaba" })
        } else {
            let name = part.trim_start_matches("did you mean ").trim_end_matches('?');
            format!("¿quería decir {name}?")
        }
    });
    format!(" ({})", parts.collect::<Vec<_>>().join("; "))
}

/// Whether this is more than one thing, in Spanish: several numbers, or a number of things.
fn is_plural(expected: &str) -> bool {
    const NOUNS: [&str; 12] = [
        "dos ",
        "tres ",
        "cuatro ",
        "pares ",
        "longitudes ",
        "grados ",
        "números ",
        "líneas ",
        "nodos ",
        "bytes ",
        "datos ",
        "los ",
    ];
    let after = expected.trim_start_matches(|c: char| c.is_ascii_digit());
    let number = &expected[..expected.len() - after.len()];
    let names_things = after.strip_prefix(' ').is_some_and(|noun| {
        noun.starts_with(char::is_alphabetic) && !noun.starts_with("o ") && !noun.starts_with("a ")
    });
    NOUNS.iter().any(|noun| expected.starts_with(noun))
        || !number.is_empty() && number != "1" && (names_things || after.starts_with(", "))
}

fn detail(text: &str) -> String {
    // A quotation from the scene is what it is.
    if text.starts_with('"') && text.ends_with('"') && text.matches('"').count() == 2 {
        return text.to_owned();
    }
    best(&OF_DETAILS, text).map_or_else(|| text.to_owned(), |(_, spanish)| spanish)
}

/// The translation of the entry that a text fits best.
pub(crate) fn by_table(table: Table, text: &str) -> Option<String> {
    best(&[table], text).map(|(_, spanish)| spanish)
}

/// The translation of the entry of these tables that a text fits best, and how many characters that entry has beside
/// its places.
fn best(tables: &[Table], text: &str) -> Option<(usize, String)> {
    let fitting = tables.iter().copied().flatten().filter_map(|&(english, spanish)| {
        let parts = fitted(english, text)?;
        Some((english.len() - 2 * parts.len(), spanish, parts))
    });
    let (known, spanish, parts) = fitting.max_by_key(|&(known, ..)| known)?;
    let mut pieces = spanish.split('{');
    let mut translated = pieces.next().unwrap_or_default().to_owned();
    for (part, piece) in parts.into_iter().zip(pieces) {
        match piece.strip_prefix("=}") {
            Some(piece) => translated.extend([part, piece]),
            None => translated.extend([&part_in_spanish(part), piece.trim_start_matches('}')]),
        }
    }
    Some((known, translated))
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

/// A part of a sentence: what the system says, a noun and its name, what a limit counts, another detail, or what is the
/// same in both languages.
fn part_in_spanish(part: &str) -> String {
    if let Some(said) = of_system(part) {
        return said;
    }
    if let Some((_, counted)) = COUNTED.iter().find(|(english, _)| part == *english) {
        return (*counted).to_owned();
    }
    for (english, spanish) in NOUNS {
        if let Some(name) = part.strip_prefix(english).and_then(|rest| rest.strip_prefix(' ')) {
            return format!("{spanish} {name}");
        }
        if part == *english {
            return spanish.split_once(' ').map_or(*spanish, |(_, noun)| noun).to_owned();
        }
    }
    detail(part)
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
            (
                "a.gltf:1:40 /buffers/0/uri: b.bin: cannot open: No such file or directory (os error 2)",
                "a.gltf:1:40 /buffers/0/uri: b.bin: no se puede abrir: no existe el archivo o la carpeta (error 2 del sistema)",
            ),
            (
                "a.gltf:1:290 /accessors/0/count: accessor past the end of its buffer view (found 4 elements, which need 48 bytes; expected 36 bytes at most)",
                "a.gltf:1:290 /accessors/0/count: el accesor pasa del final de su vista de búfer (se encontraron 4 elementos, que necesitan 48 bytes; se esperaban 36 bytes como máximo)",
            ),
            (
                "a.ply:3:16: file is truncated: 1 face announced, room for 0",
                "a.ply:3:16: el archivo está cortado: se anuncia 1 cara, hay sitio para 0",
            ),
            (
                "a.ply:10:5: not a number in face 0, property z (found \"x\")",
                "a.ply:10:5: no es un número en face 0, propiedad z (se encontró \"x\")",
            ),
            (
                "a.pov:3:9 by the macro Wall: texture has no meaning for a sky",
                "a.pov:3:9 en la macro Wall: texture no significa nada en un cielo",
            ),
            ("warning: unknown directive \"x\" (5 more)", "aviso: directiva desconocida \"x\" (y 5 más)"),
            ("what nobody foresaw", "what nobody foresaw"),
        ] {
            assert_eq!(in_spanish(english), spanish);
        }
    }

    /// The lines that the catalogues of malformed files say.
    fn catalogue() -> Vec<&'static str> {
        let of_kinds = [
            include_str!("../tests/malformed/pbrt.txt"),
            include_str!("../tests/malformed/gltf.txt"),
            include_str!("../tests/malformed/obj.txt"),
            include_str!("../tests/malformed/ply.txt"),
            include_str!("../tests/malformed/stl.txt"),
        ];
        let said = of_kinds.into_iter().flat_map(|text| {
            let lines: Vec<&str> = text.lines().collect();
            let pairs: Vec<[&str; 2]> = lines.windows(2).map(|pair| [pair[0], pair[1]]).collect();
            pairs.into_iter().filter(|[before, _]| before.starts_with("--- ")).map(|[_, line]| line)
        });
        said.collect()
    }

    /// The English words of a text outside of quotations, which come from a file.
    fn english_words(text: &str) -> Vec<&str> {
        const ENGLISH: &[&str] = &[
            "the", "of", "is", "are", "wrong", "unknown", "expected", "found", "without", "has", "not",
            "cannot", "before", "after", "more", "than", "numbers", "number", "or", "from", "to", "and",
            "at", "with", "that", "which", "there", "an", "its", "less", "least", "most", "left", "out",
            "missing", "file", "every", "used", "taken",
        ];
        // `from` and `to` are parameters of lights.
        let is_of_light = text.contains("from y to");
        let outside = text.split('"').step_by(2);
        let words = outside.flat_map(|part| part.split(|c: char| !c.is_alphabetic() && c != '_' && c != '.'));
        words.filter(|word| ENGLISH.contains(word) && !is_of_light).collect()
    }

    #[test]
    fn what_the_catalogues_of_malformed_files_say_is_in_spanish() {
        let all = catalogue();
        assert!(all.len() > 230, "{}", all.len());
        let mut wrong = Vec::new();
        for line in all {
            let spanish = in_spanish(line);
            let left = english_words(&spanish);
            wrong.extend((!left.is_empty()).then(|| format!("{left:?} in {spanish}")));
        }
        assert!(wrong.is_empty(), "{wrong:#?}");
    }

    /// The string literals of Rust source, without its tests.
    fn literals(source: &str) -> Vec<String> {
        let source = match source.rsplit_once("\n#[cfg(test)]\n") {
            Some((code, tests)) if tests.contains("mod tests") => code,
            _ => source,
        };
        let (mut all, mut rest) = (Vec::new(), source);
        while let Some(at) = rest.find(['"', '\'', '/']) {
            let (before, begin, after) = (&rest[..at], &rest[at..], &rest[at + 1..]);
            rest = match begin.as_bytes()[0] {
                b'/' if after.starts_with('/') => after.find('\n').map_or("", |end| &after[end..]),
                b'\'' if after.starts_with("\"'") => &after[2..],
                b'\'' if after.starts_with("\\\"'") => &after[3..],
                b'"' => {
                    let mut text = String::new();
                    let mut characters = after.char_indices().peekable();
                    let mut end = after.len();
                    while let Some((at, c)) = characters.next() {
                        match c {
                            '"' => {
                                end = at + 1;
                                break;
                            }
                            '\\' => match characters.next() {
                                // The literal goes on in the next line.
                                Some((_, '\n')) => {
                                    while characters.next_if(|(_, c)| c.is_whitespace()).is_some() {}
                                }
                                Some((_, 'n')) => text.push('\n'),
                                Some((_, escaped)) => text.push(escaped),
                                None => {}
                            },
                            c => text.push(c),
                        }
                    }
                    // Why something cannot fail, and what lints say.
                    let is_of_code = [".expect(", "reason = "].iter().any(|end| before.ends_with(end));
                    all.extend((!is_of_code).then_some(text));
                    &after[end..]
                }
                _ => after,
            };
        }
        all
    }

    /// Literals of readers that are no sentences: pieces of sentences that the tables have whole, nouns of such
    /// sentences, what only a picture that is written can meet, and words of formats.
    const NOT_SAID: &[&str] = &[
        "{made}; {ENDINGS} are read",
        "of the unpacked grid {}",
        "property list uchar int vertex_indices",
        "cannot read",
        "cannot open",
        "cannot unpack",
        "cannot write",
        "cannot encode",
        "did you mean {}?",
        "{} {elements} announced, room for {most}",
        "{what}: no face with an area has it",
        "face with a {what} that does not exist",
        "none, as there is no {what}",
        "faces name {what}, and the file has none",
        "Tr is opacity here",
        "d is taken",
        "by the macro {name}",
        ": --integrator path has the light that surfaces give each other",
        ": --integrator caustics has light that glass and mirrors gather",
        "{word} is not rendered by the integrator pov{instead}",
        "{lightless} cannot be an area light (that of {from}); is an AttributeEnd missing?",
        "the tree's {what} are not in the grid",
        "an accessor",
        "an animation",
        "a buffer view",
        "an image",
        "a light profile",
        "{what} on a network: nothing is fetched from there",
        "{what} behind a URI of a scheme that is not supported",
        "{facet} has a vertex that is not finite",
        "GIF images have from 1 to 65535 pixels a side",
        "WebP images have at most 16384 pixels a side",
        "JPEG images have at most 65535 pixels a side",
        "no colours to write",
        "channels R, G and B, or an .exr file",
        "an image without pixels",
        "{} is not written",
        "unknown format to write",
        "no channel can be named {}",
        "a frame of another size",
        "{option} has no effect: {} is not {kind}",
        "a glTF file",
        "the film",
        "the {kind} camera",
        "light area",
        "is orthographic (expected --zoom)",
        "sees all directions",
        "has the lens of the scene",
        "has the faces of meshes",
        " (but the system grants no more: see ulimit -v)",
        " (but the control group has no more: see its memory.max)",
        "raise it with --max-memory{}",
        "{what}: needs {needed} bytes of memory, {left} are left; {raise}",
        "Max address space",
        "the camera",
        "; did you mean {}?",
        "; did you mean {near}?",
        "a factor from 1e-6 to 1e6, such as 1.5",
        "degrees from 0.001 to 179, such as 40",
    ];

    #[test]
    fn every_sentence_of_a_reader_is_in_spanish() {
        fn walk(folder: &std::path::Path, files: &mut Vec<std::path::PathBuf>) {
            for entry in std::fs::read_dir(folder).expect("the folder of a crate") {
                let path = entry.expect("a file").path();
                if path.is_dir() {
                    walk(&path, files);
                } else {
                    files.push(path);
                }
            }
        }
        let crates = std::path::Path::new(env!("CARGO_MANIFEST_DIR")).join("..");
        let mut files = Vec::new();
        walk(&crates.join("lumbre-formats/src"), &mut files);
        walk(&crates.join("lumbre-scene/src"), &mut files);
        for file in [
            "lumbre/src/setting.rs",
            "lumbre-cli/src/reading.rs",
            "lumbre-cli/src/view.rs",
            "lumbre-cli/src/memory.rs",
        ] {
            files.push(crates.join(file));
        }
        let mut count = 0;
        let mut wrong = Vec::new();
        for path in files {
            let name = path.to_string_lossy().replace('\\', "/");
            // Pages of the book, and tests.
            if ["coverage.rs", "pages.rs", "tests.rs", "words.rs"].iter().any(|end| name.ends_with(end)) {
                continue;
            }
            let source = std::fs::read_to_string(&path).expect("source is text");
            // Errors of the scene's crate; all literals of a reader.
            let of_reader = !name.contains("lumbre-scene");
            let errors = || {
                source
                    .lines()
                    .filter(|line| line.trim_start().starts_with("#[error("))
                    .collect::<Vec<_>>()
                    .join("\n")
            };
            let all = if of_reader { literals(&source) } else { literals(&errors()) };
            for literal in all {
                let is_sentence = literal
                    .split(' ')
                    .filter(|word| word.len() > 1 && word.chars().all(|c| c.is_ascii_lowercase()))
                    .count()
                    >= 2;
                // What the readers of arguments expect has another table.
                let is_of_argument = ["expected ", "found "].iter().any(|begin| literal.starts_with(begin));
                if !is_sentence
                    || is_of_argument
                    || literal.contains('\n')
                    || NOT_SAID.contains(&literal.as_str())
                {
                    continue;
                }
                count += 1;
                // Numbers stand for what comes from a file.
                let mut said = String::new();
                for (i, piece) in literal.split('{').enumerate() {
                    said.push_str(if i == 0 { piece } else { "7" });
                    said.push_str(if i == 0 {
                        ""
                    } else {
                        piece.split_once('}').map_or("", |(_, rest)| rest)
                    });
                }
                // As a sentence, or as a part of one.
                let is_translated = |spanish: &String| *spanish != said && english_words(spanish).is_empty();
                let both = [in_spanish(&said), part_in_spanish(&said)];
                if !both.iter().any(is_translated) {
                    wrong.push(format!("{literal:?} of {name}: {both:?}"));
                }
            }
        }
        assert!(count > 700, "{count}");
        assert!(wrong.is_empty(), "{} of {count}: {wrong:#?}", wrong.len());
    }

    #[test]
    fn both_languages_have_the_same_places() {
        let tables = [SENTENCES, DETAILS, SCENES, MODELS, POV, FILES, COUNTED];
        for (english, spanish) in tables.concat() {
            let places = spanish.matches("{}").count() + spanish.matches("{=}").count();
            assert_eq!(english.matches("{}").count(), places, "{english}");
        }
    }

    #[test]
    fn no_entry_is_there_twice() {
        let mut seen = std::collections::BTreeSet::new();
        for (english, _) in [SENTENCES, SCENES, MODELS, POV, FILES].concat() {
            assert!(seen.insert(english), "{english}");
        }
    }
}
