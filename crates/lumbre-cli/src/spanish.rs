//! The help of `lumbre explain` and `lumbre math` in Spanish, and what is wrong with their words, where `--lang es` is
//! among them.

use std::error::Error as _;
use std::ffi::OsString;

use clap::error::{ContextKind, ContextValue, ErrorKind};
use clap::{Arg, ArgAction, Command, Error};

use crate::console::escaped;
use crate::spanish_messages::by_table;

/// Whether these words ask for one of the commands that speak Spanish, in Spanish.
pub(crate) fn is_asked_for(words: &[OsString]) -> bool {
    let is = |word: Option<&OsString>, text: &str| word.is_some_and(|word| word == text);
    let speaks = is(words.get(1), "explain") || is(words.get(1), "math");
    let pairs = words.windows(2).any(|pair| pair[0] == "--lang" && pair[1] == "es");
    speaks && (pairs || words.iter().any(|word| word == "--lang=es"))
}

/// The headings of options.
static HEADINGS: [(&str, &str); 7] = [
    ("View", "Vista"),
    ("Showing a model", "Presentación de un modelo"),
    ("Reading", "Lectura"),
    ("Animation", "Animación"),
    ("Parameters", "Parámetros"),
    ("Limits", "Límites"),
    ("Help", "Ayuda"),
];

/// What each argument does, by its id, and the name of its value where that is a word.
const ARGUMENTS: &[(&str, &str, &str)] = &[
    (
        "scene",
        "La escena: .pbrt, .gltf, .glb, .obj, .ply, .stl o .pov, también comprimida con gzip. Varias se reúnen en el mismo mundo",
        "ESCENA",
    ),
    ("pixel", "El píxel, desde 0,0 en la esquina superior izquierda", ""),
    (
        "ray",
        "Un rayo en lugar de un píxel: su origen y su dirección (de cualquier longitud menos 0) y, si se quiere, su rango de t (por defecto, de 0 a infinito)",
        "",
    ),
    (
        "format",
        "El formato de la explicación: text (texto), markdown (con fórmulas en LaTeX), html (una página con fórmulas y un dibujo) o json (para programas) [por defecto: text]",
        "FORMATO",
    ),
    ("lang", "El idioma: en (inglés) o es (español) [por defecto: en]", "IDIOMA"),
    ("depth", "Muestra también las intersecciones de los N rayos siguientes del camino [por defecto: 0]", ""),
    ("sample", "Qué muestra del píxel se explica [por defecto: 0]", ""),
    ("nearest", "Explica solo la superficie visible, no las que hay detrás", ""),
    (
        "shape",
        "Explica esta forma, la corte el rayo o no: su número, su tipo o el nombre de su material",
        "NOMBRE|N",
    ),
    ("all_shapes", "Explica todas las formas, también las que el rayo no corta", ""),
    (
        "only",
        "Muestra solo las secciones con estas claves, las de JSON: camera, equation, Quadratic, hit, transform, light, radiance, …",
        "CLAVE,…",
    ),
    (
        "digits",
        "Cifras de los números: full (todas), o a lo sumo tantas, como 6. JSON las tiene siempre todas [por defecto: full]",
        "N|full",
    ),
    ("output", "Escribe en este archivo", "ARCHIVO"),
    ("size", "Ancho y alto de la imagen en píxeles", "ANCHOxALTO"),
    ("camera", "Una cámara de la escena, por su nombre o su índice desde 0", "NOMBRE|ÍNDICE"),
    (
        "integrator",
        "Lo que muestra cada píxel, luz o una propiedad de la superficie visible: path, caustics, whitted, pov, ambientocclusion, normals, depth, albedo o uv",
        "NOMBRE",
    ),
    ("seed", "Semilla de los números aleatorios", ""),
    ("quiet", "Muestra solo los errores", ""),
    (
        "azimuth",
        "Rodea el modelo hacia la derecha tantos grados, desde la vista automática o desde --eye",
        "GRADOS",
    ),
    ("elevation", "Sube tantos grados, como mucho 90° (en vertical hacia abajo)", "GRADOS"),
    ("zoom", "Muestra todo tantas veces más grande", "FACTOR"),
    ("fov", "Campo de visión en grados en el lado más corto de la imagen", "GRADOS"),
    ("ortho", "Proyección ortográfica", ""),
    ("eye", "Dónde está la cámara", ""),
    ("target", "El punto en el centro de la imagen. Por defecto, el centro del modelo", ""),
    (
        "up",
        "Qué dirección es arriba: x, y, z, -x, -y, -z o una dirección X,Y,Z. Por defecto z para .stl, y para un .obj o .ply que claramente se apoya en un plano de z; y para los demás",
        "EJE|X,Y,Z",
    ),
    ("fit", "Encuadra todo el modelo aunque el archivo tenga una cámara", ""),
    ("turntable", "Hace N imágenes alrededor del modelo, como -o imagen.####.png", ""),
    (
        "ground",
        "Sobre qué está el modelo: auto, none (nada), shadow (un suelo del que solo se ve la sombra) o plane (gris mate). Por defecto una sombra si la cámara y la luz son automáticas",
        "QUÉ",
    ),
    (
        "env",
        "Luz de todas partes: una imagen el doble de ancha que alta, o cuadrada con áreas iguales (.hdr, .exr, …); studio; sky:HORA,LATITUD,LONGITUD, el sol y un cielo despejado allí y entonces (sky:2026-06-21T12:00+02:00,40.4,-3.7), con el norte detrás del modelo; o none, solo la del archivo. Por defecto studio si no hay luz, y para un glTF sin cámara",
        "ARCHIVO|studio|sky:HORA,LATITUD,LONGITUD|none",
    ),
    (
        "background",
        "Lo que hay detrás de todo: env (la luz de allí), studio (papel gris), transparent, un color (white, \"#e8e0d8\") o una imagen. Por defecto studio si la luz es automática; si no, env",
        "QUÉ",
    ),
    (
        "input_format",
        "El formato de la entrada estándar o de un archivo sin extensión conocida. Por defecto se deduce del contenido: pbrt, pov, gltf, glb, obj, ply o stl",
        "FORMATO",
    ),
    ("strict", "Los avisos son errores", ""),
    (
        "lenient",
        "Descarta las partes defectuosas (como caras a las que les faltan vértices) con un aviso en vez de un error",
        "",
    ),
    ("variant", "La variante de materiales de un glTF", "NOMBRE"),
    (
        "pov_include",
        "Una carpeta de archivos que incluye una escena de POV-Ray, además de la suya y de la que POV-Ray tiene en Debian. Se puede repetir; primero se busca en la primera",
        "CARPETA",
    ),
    (
        "pov_clock",
        "El valor del reloj de una escena de POV-Ray, o A..B para la primera y la última imagen de --frames",
        "K|A..B",
    ),
    (
        "pov_frames",
        "Todas las imágenes de una animación de POV-Ray, que recorre su reloj, si --frames son solo algunas de ellas",
        "A..B",
    ),
    (
        "pov_cyclic",
        "La animación de una escena de POV-Ray es un bucle: tras la última imagen viene otra vez la primera",
        "",
    ),
    ("pov_declare", "Declara un número o un texto antes de leer una escena de POV-Ray", "NOMBRE=VALOR"),
    ("frame", "El tiempo en segundos en que se evalúan las animaciones de un glTF", ""),
    (
        "shutter",
        "Cuánto está abierto el obturador alrededor del instante de un glTF, como fracción del intervalo entre imágenes (véase --fps): 0, por defecto, es un instante; 0.5 es lo habitual en el cine. Lo que se mueve sale movido",
        "",
    ),
    ("fps", "Imágenes por segundo, para --frames y --shutter [por defecto: 24]", ""),
    (
        "animation",
        "La animación de un glTF que se reproduce, por su nombre o su índice desde 0. Por defecto todas a la vez, salvo las que contradicen a una anterior",
        "NOMBRE|ÍNDICE",
    ),
    (
        "settings",
        "Cambia un parámetro de la escena: material.NOMBRE.PARÁM, light.ÍNDICE.PARÁM, light.area.scale, camera.PARÁM o film.PARÁM. Para un nombre incorrecto, el error enumera los válidos",
        "RUTA=VALOR",
    ),
    ("overlay", "Un archivo de tales cambios, uno por línea; # empieza un comentario", "ARCHIVO"),
    (
        "max_memory",
        "Límite de memoria: para leer archivos (8G por defecto), y para la escena y la imagen (por defecto, la memoria libre)",
        "TAMAÑO",
    ),
    ("max_elements", "Límite del número de vértices, caras, formas y parámetros que se leen", ""),
    ("max_nesting", "Límite de la profundidad de inclusiones y bloques anidados", ""),
    ("max_files", "Límite del número de archivos que se abren", ""),
    (
        "max_expansion",
        "Límite de cuántas veces pueden crecer los datos comprimidos o los archivos incluidos",
        "",
    ),
    (
        "expression",
        "Lo que se evalúa, con ; entre expresiones. Póngalo entre comillas: el intérprete de órdenes trata los paréntesis de otro modo. Sin expresión se abre una consola",
        "EXPRESIÓN",
    ),
    ("file", "Evalúa las sentencias de este archivo; - es la entrada estándar", "ARCHIVO"),
    ("json", "Escribe cada resultado con sus pasos como una línea de JSON", ""),
];

const TEMPLATE: &str = "{about-with-newline}\nUso: {usage}\n\n{all-args}{after-help}";

const EXPLAIN: (&str, &str, &str) = (
    "Explica cómo se llega al color de un píxel, o a la luz a lo largo de un rayo: la cámara y su rayo, cada superficie en su camino con la ecuación de sus intersecciones, las normales, las luces y las sombras, y el camino de una muestra, con todos los números tal como los calcula el render",
    "lumbre explain [OPCIONES] <ESCENA>...",
    "Ejemplos:
  lumbre explain scene.pbrt --pixel 320,240 --lang es
  lumbre explain scene.pbrt --ray 0,0,-5,0,0,1 --nearest --lang es
  lumbre explain scene.pbrt --ray 0,2,-5,0,0,1 --shape sphere --lang es     por qué el rayo no la corta
  lumbre explain scene.pbrt --pixel 320,240 --only equation,radiance --lang es
  lumbre explain scene.pbrt --pixel 320,240 --format html -o pixel.html --lang es
  lumbre explain scene.pbrt --pixel 320,240 --sample 7 --depth 2 --digits 6 --lang es",
);

const MATH: (&str, &str, &str) = (
    "Evalúa vectores, matrices, transformaciones, cámaras y cuaterniones, paso a paso",
    "lumbre math [OPCIONES] [EXPRESIÓN]...",
    "Ejemplos:
  lumbre math --lang es 'cross([1, 2, 2], [2, -1, 2])'
  lumbre math --lang es 'T = translate([1, 2, 3]); R = rotate(z, 90); T * R * [1, 0, 0]'
  lumbre math --lang es 'orders(rotate_x(90), rotate_y(90))'     ambos órdenes, y la inversa de ambas maneras
  lumbre math --lang es 'row_form(rotate_z(90), [1, 0, 0])'      columnas y filas lado a lado
  lumbre math --lang es 'angles(euler(30, 90, 10))'              ángulos de Euler en un polo
  lumbre math --lang es --file notas.txt                         un archivo: sentencias en líneas, # comenta
  lumbre math --lang es                                          una consola; los resultados son ans y nombres
  lumbre math --lang es help                                     todas las funciones

El estado de salida es 2 para una expresión incorrecta, y 3 para una de un archivo o de la entrada estándar.",
);

/// The program with the help of both commands in Spanish.
pub(crate) fn translated(program: Command) -> Command {
    program
        .mut_subcommand("explain", |command| translated_command(command, EXPLAIN))
        .mut_subcommand("math", |command| translated_command(command, MATH))
}

fn translated_command(
    command: Command,
    (about, usage, after): (&'static str, &'static str, &'static str),
) -> Command {
    let help = Arg::new("help").short('h').long("help").action(ArgAction::Help);
    let command = command.disable_help_flag(true).arg(help.help("Muestra esta ayuda"));
    command
        .about(about)
        .long_about(about)
        .override_usage(usage)
        .after_help(after)
        .help_template(TEMPLATE)
        .mut_args(translated_argument)
}

fn translated_argument(argument: Arg) -> Arg {
    let heading = match argument.get_help_heading() {
        Some(heading) => HEADINGS
            .iter()
            .find(|(english, _)| *english == heading)
            .map_or("Opciones", |(_, spanish)| *spanish),
        None if argument.is_positional() => "Argumentos",
        None => "Opciones",
    };
    let argument = argument.help_heading(heading);
    // clap's own additions would be English; the texts include them.
    let argument = match argument.get_action().takes_values() {
        true => argument.hide_possible_values(true).hide_default_value(true),
        false => argument,
    };
    let id = argument.get_id().to_string();
    let Some((_, about, value)) = ARGUMENTS.iter().find(|(name, ..)| *name == id) else { return argument };
    let argument = argument.help(*about).long_help(*about);
    if value.is_empty() { argument } else { argument.value_name(*value) }
}

/// What readers of values say, in both languages; `{}` stands for what is the same in both.
const EXPECTATIONS: &[(&str, &str)] = &[
    ("expected two whole numbers, such as 320,240", "se esperaban dos números enteros, como 320,240"),
    ("expected full, or a whole number from 1 to 17", "se esperaba full, o un número entero de 1 a 17"),
    (
        "expected six numbers, the origin and the direction, such as 0,0,-5,0,0,1",
        "se esperaban seis números, el origen y la dirección, como 0,0,-5,0,0,1",
    ),
    (
        "expected finite numbers and a direction other than 0,0,0",
        "se esperaban números finitos y una dirección distinta de 0,0,0",
    ),
    (
        "expected the least and the greatest t after the direction, such as 0,0,-5,0,0,1,0,100",
        "se esperaban el menor y el mayor t tras la dirección, como 0,0,-5,0,0,1,0,100",
    ),
    ("expected three numbers, such as 1,-2.5,3", "se esperaban tres números, como 1,-2.5,3"),
    ("expected degrees, such as 30 or -90", "se esperaban grados, como 30 o -90"),
    ("expected a factor from 1e-6 to 1e6, such as 1.5", "se esperaba un factor de 1e-6 a 1e6, como 1.5"),
    ("expected degrees from 0.001 to 179, such as 40", "se esperaban grados de 0.001 a 179, como 40"),
    (
        "expected x, y, z, -x, -y, -z or a direction such as 0,1,1",
        "se esperaba x, y, z, -x, -y, -z o una dirección como 0,1,1",
    ),
    ("expected a number of seconds", "se esperaba un número de segundos"),
    (
        "expected a share of a frame, such as 0.5",
        "se esperaba una fracción del intervalo entre imágenes, como 0.5",
    ),
    ("expected frames a second, such as 24", "se esperaban imágenes por segundo, como 24"),
    (
        "expected the first and the last frame, such as 0..47, up to {}",
        "se esperaban la primera y la última imagen, como 0..47, hasta {}",
    ),
    ("expected a number, or two, such as 0..1", "se esperaba un número, o dos, como 0..1"),
    ("expected NAME=VALUE, such as Turns=3", "se esperaba NOMBRE=VALOR, como Vueltas=3"),
    (
        "found {}; expected WIDTHxHEIGHT in pixels, each from 1 to 65536, as 640x480",
        "se encontró {}; se esperaba ANCHOxALTO en píxeles, cada uno de 1 a 65536, como 640x480",
    ),
    (
        "found {}; expected a size such as 8G, 512M or 100k",
        "se encontró {}; se esperaba un tamaño como 8G, 512M o 100k",
    ),
    (
        "found {}; expected material.NAME.PARAM=VALUE, light.INDEX.PARAM=VALUE, camera.PARAM=VALUE or film.PARAM=VALUE",
        "se encontró {}; se esperaba material.NOMBRE.PARÁM=VALOR, light.ÍNDICE.PARÁM=VALOR, camera.PARÁM=VALOR o film.PARÁM=VALOR",
    ),
    (
        "expected a colour of three or six hexadecimal digits, as #fa0 or #e8e0d8",
        "se esperaba un color de tres o seis cifras hexadecimales, como #fa0 o #e8e0d8",
    ),
    (
        "expected env, studio, transparent, a colour ({}, or as #e8e0d8) or an image file; did you mean {}?",
        "se esperaba env, studio, transparent, un color ({}, o como #e8e0d8) o un archivo de imagen; ¿quería decir {}?",
    ),
    (
        "expected env, studio, transparent, a colour ({}, or as #e8e0d8) or an image file",
        "se esperaba env, studio, transparent, un color ({}, o como #e8e0d8) o un archivo de imagen",
    ),
    ("invalid float literal", "se esperaba un número"),
    ("cannot parse float from empty string", "se esperaba un número"),
    ("expected a whole number from {} to {}", "se esperaba un número entero de {} a {}"),
];

/// What is wrong with the words, in Spanish.
pub(crate) fn said(error: &Error) -> String {
    let text = |kind| match error.get(kind) {
        Some(ContextValue::String(text)) => escaped(text).into_owned(),
        Some(ContextValue::Strings(texts)) => escaped(&texts.join(", ")).into_owned(),
        _ => String::new(),
    };
    let (argument, value) = (text(ContextKind::InvalidArg), text(ContextKind::InvalidValue));
    let what = match error.kind() {
        ErrorKind::InvalidValue if value.is_empty() => format!("falta un valor para '{argument}'"),
        ErrorKind::InvalidValue => {
            let valid = text(ContextKind::ValidValue);
            format!("valor no válido '{value}' para '{argument}' (se esperaba uno de {valid})")
        }
        ErrorKind::ValueValidation => {
            let source = error.source().map(ToString::to_string).unwrap_or_default();
            let expected = by_table(EXPECTATIONS, &escaped(&source));
            let expected = expected.map_or(String::new(), |spanish| format!(": {spanish}"));
            format!("valor no válido '{value}' para '{argument}'{expected}")
        }
        ErrorKind::UnknownArgument => format!("argumento desconocido '{argument}'"),
        ErrorKind::MissingRequiredArgument => format!("faltan argumentos obligatorios: {argument}"),
        ErrorKind::ArgumentConflict => {
            let other = text(ContextKind::PriorArg);
            match argument == other {
                true => format!("'{argument}' se da más de una vez"),
                false => format!("'{argument}' no puede usarse con '{other}'"),
            }
        }
        ErrorKind::TooManyValues => format!("sobra el valor '{value}' de '{argument}'"),
        ErrorKind::TooFewValues | ErrorKind::WrongNumberOfValues => {
            format!("número incorrecto de valores de '{argument}'")
        }
        ErrorKind::NoEquals => format!("falta = en '{argument}'"),
        ErrorKind::InvalidUtf8 => "las palabras no son texto en UTF-8".to_owned(),
        _ => "no se entienden los argumentos".to_owned(),
    };
    let suggested = text(ContextKind::SuggestedArg);
    let tip = if suggested.is_empty() { String::new() } else { format!("\n\n  existe '{suggested}'") };
    format!("error: {what}{tip}\n\nMás información con '--help'.\n")
}

#[cfg(test)]
mod tests {
    use clap::CommandFactory;

    use super::*;

    fn help_of(command: &mut Command, name: &str) -> String {
        command.build();
        command.find_subcommand_mut(name).expect("it is there").render_long_help().to_string()
    }

    #[test]
    fn every_argument_of_both_commands_has_its_help_in_spanish() {
        let english = crate::Arguments::command();
        for name in ["explain", "math"] {
            let spanish = translated(crate::Arguments::command());
            let theirs = spanish.find_subcommand(name).expect("it is there");
            let mut count = 0;
            for argument in english.find_subcommand(name).expect("it is there").get_arguments() {
                let id = argument.get_id();
                let other = theirs.get_arguments().find(|other| other.get_id() == id).expect("none is lost");
                assert_ne!(argument.get_help(), other.get_help(), "{name} --{id} has no Spanish");
                count += 1;
            }
            assert!(count >= 4, "{count}");
            let text = help_of(&mut translated(crate::Arguments::command()), name);
            for word in [
                "Usage",
                "Options",
                "Arguments",
                "Possible",
                "default",
                "Print",
                "Examples",
                "the ",
                "View",
                "Reading",
            ] {
                let mentions = text.lines().filter(|line| line.contains(word) && !line.contains("defecto"));
                assert_eq!(mentions.collect::<Vec<_>>(), Vec::<&str>::new(), "{word}");
            }
            assert!(text.contains("Uso: lumbre") && text.contains("Muestra esta ayuda"), "{text}");
        }
    }

    #[test]
    fn every_argument_says_in_spanish_what_it_expects() {
        let mut count = 0;
        for name in ["explain", "math"] {
            let program = crate::Arguments::command();
            let command = program.find_subcommand(name).expect("it is there");
            for argument in command.get_arguments().filter(|argument| argument.get_action().takes_values()) {
                let Some(long) = argument.get_long() else { continue };
                let words = ["lumbre", name, &format!("--{long}=?!")];
                let Err(error) = crate::Arguments::command().try_get_matches_from(words) else { continue };
                // Any text is a name, or a file.
                if !matches!(error.kind(), ErrorKind::InvalidValue | ErrorKind::ValueValidation) {
                    continue;
                }
                let text = said(&error);
                assert!(text.contains("se esperaba"), "--{long}: {text}");
                count += 1;
            }
        }
        assert!(count >= 20, "{count}");
    }

    #[test]
    fn only_both_commands_are_asked_in_spanish() {
        let asked = |words: &str| is_asked_for(&words.split(' ').map(OsString::from).collect::<Vec<_>>());
        assert!(asked("lumbre explain a.pbrt --lang es") && asked("lumbre math --lang=es --help"));
        assert!(
            !asked("lumbre explain a.pbrt --lang en")
                && !asked("lumbre render --lang es")
                && !asked("lumbre")
        );
    }
}
