// What the live parts of the book say, in the language of the page.
const ENGLISH = {
  try: "Try it",
  reset: "As it was",
  run: "Run",
  command: "Command",
  commands: "Commands. What they print follows as you type.",
  live: "Live figure",
  close: "Close",
  scene: "Scene",
  output: "Output",
  ray: "Ray",
  origin: "O",
  direction: "D",
  drag: "Drag O, the ray or a point in the sketch, or change a number: by keys, or by dragging it sideways.",
  number: "{0}, number {1}",
  loading: "Loading Lumbre…",
  "no script": "This browser does not let a page that was opened from a file load Lumbre. Put the folder on a web server, for example: python3 -m http.server",
  "no module": "Lumbre cannot be loaded: {0}",
  unknown: "This page runs lumbre math, explain and cast with echo, printf, sed, grep, head and tail; it does not know: {0}",
  "no file": "{0}: there is no such file here",
  rendering: "{0} of {1} samples per pixel",
  coarse: "First pixels…",
  done: "Done: {0} samples per pixel",
  stopped: "The scene has an error; the picture is the last one.",
  picture: "Picture. Click a pixel to have its colour explained; or use the arrow keys and Enter.",
  playground: "Open in the playground",
  render: "Edit and render",
  pixel: "Pixel {0}, {1}",
  hint: "The picture follows the text. Click a pixel to have its colour explained.",
  nothing: "This ray has no figure.",
};
export type Word = keyof typeof ENGLISH;

const SPANISH: Record<Word, string> = {
  try: "Pruébelo",
  reset: "Como estaba",
  run: "Ejecutar",
  command: "Orden",
  commands: "Órdenes. Lo que imprimen sigue a lo que escribe.",
  live: "Figura viva",
  close: "Cerrar",
  scene: "Escena",
  output: "Salida",
  ray: "Rayo",
  origin: "O",
  direction: "D",
  drag: "Arrastre O, el rayo o un punto en el dibujo, o cambie un número: con teclas, o arrastrándolo hacia un lado.",
  number: "{0}, número {1}",
  loading: "Cargando Lumbre…",
  "no script": "Este navegador no deja que una página abierta desde un archivo cargue Lumbre. Ponga la carpeta en un servidor web, por ejemplo: python3 -m http.server",
  "no module": "No se puede cargar Lumbre: {0}",
  unknown: "Esta página ejecuta lumbre math, explain y cast con echo, printf, sed, grep, head y tail; no conoce: {0}",
  "no file": "{0}: aquí no hay tal archivo",
  rendering: "{0} de {1} muestras por píxel",
  coarse: "Primeros píxeles…",
  done: "Terminado: {0} muestras por píxel",
  stopped: "La escena tiene un error; la imagen es la última.",
  picture: "Imagen. Pulse un píxel para que se explique su color; o use las flechas e Intro.",
  playground: "Abrir en la página de pruebas",
  render: "Editar y calcular la imagen",
  pixel: "Píxel {0}, {1}",
  hint: "La imagen sigue al texto. Pulse un píxel para que se explique su color.",
  nothing: "Este rayo no tiene figura.",
};

export const language = (): "en" | "es" => (document.documentElement.lang.startsWith("es") ? "es" : "en");

/** A sentence with what it is about in place of {0}, {1}, … */
export function word(name: Word, ...parts: (string | number)[]): string {
  const text = (language() === "es" ? SPANISH : ENGLISH)[name];
  return text.replace(/\{(\d)\}/g, (_, i: string) => String(parts[Number(i)] ?? ""));
}
