// What the page says, in each language.
const ENGLISH = {
  title: "Lumbre playground",
  example: "Example",
  own: "(your own)",
  resolution: "Resolution",
  full: "As in the scene",
  files: "Open files",
  share: "Link to this scene",
  shared: "This link holds the scene:",
  copied: "It is on the clipboard.",
  "without files": "The link holds the text alone, not the files that you opened.",
  save: "Save picture",
  language: "Language",
  scene: "Scene",
  go: "Go to the place",
  picture: "Picture",
  keys: "Picture. Arrow keys turn the camera, plus and minus move it nearer and farther, Enter explains the pixel x, y.",
  hint: "Click a pixel to have its colour explained. Drag, or use the arrow keys, to turn the camera; the wheel, a pinch or + and − move it.",
  "no camera": "The camera cannot be turned: the scene has no LookAt.",
  as: "as",
  page: "Page",
  plain: "Text",
  explain: "Explain this pixel",
  same: "The same bytes:",
  explanation: "Explanation",
  loading: "Loading Lumbre…",
  reading: "Reading the scene…",
  rendering: "{0} of {1} samples per pixel",
  coarse: "First pixels…",
  done: "Done: {0} samples per pixel, {1} × {2}, {3} s",
  stopped: "The scene has an error; the picture is the last one.",
  held: "Files: {0}",
  shown: "{0} is shown as it is. Its bytes are no text to be edited.",
  warnings: "Warnings: {0}",
  "no script": "This browser did not load lumbre.wasm.js. Put the folder on a web server, for example: python3 -m http.server",
  "no module": "lumbre.wasm cannot be loaded: {0}",
  "bad link": "The link does not hold a whole scene.",
  "no example": "The example cannot be loaded.",
  dropped: "Here the files have no scene: expected .pbrt, .pov, .gltf, .glb, .obj, .ply or .stl.",
};
export type Word = keyof typeof ENGLISH;

const SPANISH: Record<Word, string> = {
  title: "Lumbre: pruebas",
  example: "Ejemplo",
  own: "(el suyo)",
  resolution: "Resolución",
  full: "La de la escena",
  files: "Abrir archivos",
  share: "Enlace a esta escena",
  shared: "Este enlace contiene la escena:",
  copied: "Está en el portapapeles.",
  "without files": "El enlace contiene solo el texto, no los archivos que ha abierto.",
  save: "Guardar imagen",
  language: "Idioma",
  scene: "Escena",
  go: "Ir al lugar",
  picture: "Imagen",
  keys: "Imagen. Las flechas giran la cámara, más y menos la acercan y la alejan, Intro explica el píxel x, y.",
  hint: "Pulse un píxel para que se explique su color. Arrastre, o use las flechas, para girar la cámara; la rueda, dos dedos o + y − la mueven.",
  "no camera": "La cámara no se puede girar: la escena no tiene LookAt.",
  as: "como",
  page: "Página",
  plain: "Texto",
  explain: "Explicar este píxel",
  same: "Los mismos bytes:",
  explanation: "Explicación",
  loading: "Cargando Lumbre…",
  reading: "Leyendo la escena…",
  rendering: "{0} de {1} muestras por píxel",
  coarse: "Primeros píxeles…",
  done: "Terminado: {0} muestras por píxel, {1} × {2}, {3} s",
  stopped: "La escena tiene un error; la imagen es la última.",
  held: "Archivos: {0}",
  shown: "{0} se muestra tal como es. Sus bytes no son un texto que se pueda editar.",
  warnings: "Avisos: {0}",
  "no script": "Este navegador no ha cargado lumbre.wasm.js. Ponga la carpeta en un servidor web, por ejemplo: python3 -m http.server",
  "no module": "No se puede cargar lumbre.wasm: {0}",
  "bad link": "El enlace no contiene una escena completa.",
  "no example": "No se puede cargar el ejemplo.",
  dropped: "Entre estos archivos no hay ninguna escena: se esperaba .pbrt, .pov, .gltf, .glb, .obj, .ply o .stl.",
};

export type Language = "en" | "es";
let language: Language = "en";

export function speak(chosen: Language): void {
  language = chosen;
  document.documentElement.lang = chosen;
  document.title = word("title");
  for (const element of document.querySelectorAll<HTMLElement>("[data-word]")) element.textContent = word(element.dataset["word"] as Word);
  for (const element of document.querySelectorAll<HTMLElement>("[data-label]")) element.ariaLabel = word(element.dataset["label"] as Word);
}

export const spoken = (): Language => language;

/** A sentence with what it is about in place of {0}, {1}, … */
export function word(name: Word, ...parts: (string | number)[]): string {
  const text = (language === "es" ? SPANISH : ENGLISH)[name];
  return text.replace(/\{(\d)\}/g, (_, i: string) => String(parts[Number(i)] ?? ""));
}
