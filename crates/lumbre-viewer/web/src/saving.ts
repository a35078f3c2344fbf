// What the user takes away: pictures, edits, and the camera as text.
import type { App } from "./app";
import { byId, element, on, save, saveBlob } from "./elements";
import type { FileFormat } from "./messages";

/** The name of the scene without its ending, for files. */
const stem = (name: string) => (name || "picture").replace(/\.(pbrt|pov|gltf|glb|obj|ply|stl)(\.gz)?$/i, "");

export function connectSaving(app: App): void {
  const { page, sheet, camera, editor } = app;
  const name = () => page.state?.name ?? "";
  on("save-overlay", "click", () => save(`${page.state?.name ?? "scene"}.overlay.txt`, editor.overlay()));
  on("drop-edits", "click", () => editor.dropAll());
  on("snapshot", "click", async () => {
    const picture = await sheet.snapshot();
    if (picture) saveBlob(`${stem(name())}.png`, picture);
  });
  /** Takes the picture as a file, which the browser saves. */
  const savePicture = async (format: FileFormat): Promise<void> => {
    try {
      const href = await page.ticket({ for: "picture", format });
      element("a", "", { href, download: `${stem(name())}.${format}` }).click();
    } catch {
      app.alert("The picture was not saved.", "The viewer does not answer.");
    }
  };
  on("save-png", "click", () => void savePicture("png"));
  on("save-exr", "click", () => void savePicture("exr"));
  on("copy-pbrt", "click", () => copy(camera.toPbrt()));
  on("copy-gltf", "click", () => copy(camera.toGltf(sheet.width / sheet.height)));
}

function copy(text: string): void {
  const shown = byId<HTMLTextAreaElement>("copied");
  [shown.hidden, shown.value] = [false, text];
  shown.select();
  // Without permission, the text is there to be copied by hand.
  navigator.clipboard?.writeText(text).catch(() => {});
}
