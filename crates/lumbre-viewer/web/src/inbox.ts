// What comes from the viewer, and where on the page it goes.
import type { App } from "./app";
import type { Listener } from "./connection";
import { byId } from "./elements";
import { showFacts, showHits } from "./facts";
import type { Frame } from "./frame";
import type { Access, SceneFacts, ViewerMessage } from "./messages";
import { showProgress } from "./progress";
import { showState } from "./state";
import { hideWhatNeedsAViewer } from "./static-connection";

export class Inbox implements Listener {
  constructor(private readonly app: App) {}

  onFrame(frame: Frame): void {
    const { page, display, pixels } = this.app;
    page.show(display.shown(frame));
    display.draw();
    if (frame.isFull) pixels.refresh();
  }

  onMessage(message: ViewerMessage): void {
    const { page, pixels } = this.app;
    switch (message.type) {
      case "scene":
        this.onScene(message.scene);
        break;
      case "state":
        page.state = message;
        showState(this.app, message);
        break;
      case "progress":
        showProgress(message);
        break;
      case "picked":
        this.onPicked(message);
        break;
      case "values":
        pixels.show(message);
        break;
      case "ticket":
        // The connection has taken it.
        break;
      case "wrong":
        byId("edit-error").textContent = message.what;
        byId("edit-error").hidden = false;
        break;
    }
  }

  private onScene(scene: SceneFacts): void {
    const { page, editor, lights, handles, tree, explanation } = this.app;
    page.scene = scene;
    showFacts(byId("facts"), byId("warnings"), scene);
    editor.list(scene.parameters);
    lights.list(scene.parameters);
    handles.show(scene.parameters);
    tree.list(scene);
    explanation.offer(scene.languages);
    if (page.state) showState(this.app, page.state);
  }

  private onPicked({ request, x, y, ray }: Extract<ViewerMessage, { type: "picked" }>): void {
    const { app } = this;
    const first = ray.hits[0];
    showHits(byId("picked"), ray.hits);
    app.select(first);
    app.measure.take(x, y, first);
    app.explanation.of(Math.floor(x), Math.floor(y));
    if (request === app.orbitOnPick && first?.surface) {
      app.camera.lookAt(first.surface.point);
      app.page.moved();
    }
  }

  onOpen(access: Access): void {
    const { page } = this.app;
    page.connected = true;
    page.watches = access === "watch";
    byId("watching").hidden = !page.watches;
    if (page.watches) hideWhatNeedsAViewer(true);
    this.app.alert("", "");
  }

  onStatus(how: "gone" | "refused" | "foreign"): void {
    const { app } = this;
    app.page.connected = false;
    if (how === "gone") app.alert("The viewer does not answer.", "It has ended, or the tunnel to it has. This page goes on when it is back.");
    if (how === "refused") app.alert("The viewer does not know this page.", "Open the address that lumbre view printed. It works once, in one tab: to have another one, start the viewer again.");
    if (how === "foreign") app.alert("Another program answers in place of the viewer.", "It cannot prove to be the viewer, and was told nothing.");
    byId("progress").textContent = "Not connected";
  }
}
