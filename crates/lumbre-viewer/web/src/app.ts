// The page with its parts, and what they share.
import { Display } from "./display";
import { Editor } from "./edit";
import { byId } from "./elements";
import { Explanation } from "./explanation";
import { LightHandles } from "./handles";
import { LightList } from "./lights";
import { Measure } from "./measure";
import type { ListedShape } from "./messages";
import { Page } from "./page";
import { PixelReader } from "./pixels";
import { Section } from "./section";
import { SceneTree } from "./tree";
import { Views } from "./views";

export class App {
  readonly page = new Page();
  readonly sheet = this.page.sheet;
  readonly camera = this.page.camera;
  readonly pixels = new PixelReader(this.page);
  readonly explanation = new Explanation((errand) => this.page.ticket(errand));
  readonly editor: Editor;
  readonly lights: LightList;
  readonly handles: LightHandles;
  readonly tree = new SceneTree(this.page, (shape) => this.select(shape));
  readonly views = new Views(this.page, this.camera);
  readonly measure = new Measure(this.sheet);
  readonly section = new Section(this.page);
  readonly display = new Display(this.page);
  /** What was clicked last. */
  picked: ListedShape | undefined;
  /** The question whose answer the camera turns around from then on. */
  orbitOnPick = 0;

  /** `isStatic`: the page was exported, and there is no viewer. */
  constructor(private readonly isStatic: boolean) {
    const edit = (path: string, value: string | null) => this.page.send({ type: "edit", path, value });
    this.editor = new Editor(byId("parameters"), byId("filter"), edit);
    this.lights = new LightList(edit);
    this.handles = new LightHandles(this.page, edit);
    this.page.onCamera = () => {
      this.measure.moved();
      this.section.moved();
      this.handles.draw();
    };
  }

  /** A shape was clicked, in the picture or in the tree: it is marked everywhere. */
  select(shape: ListedShape | undefined): void {
    this.picked = shape;
    this.tree.select(shape?.shape ?? -1);
    this.editor.mark(shape?.owner ?? null);
    const isShape = shape !== undefined && shape.kind !== "ground";
    byId("picked-buttons").hidden = !isShape || this.isStatic || this.page.watches;
    byId("edit-picked").hidden = !shape?.owner;
    byId("light-picked").hidden = !shape?.shines;
  }

  /** A fault above the picture; an empty title takes it away. */
  alert(title: string, text: string): void {
    byId("alert-title").textContent = title;
    byId("alert-text").textContent = text;
    byId("alert").hidden = title === "";
  }
}
