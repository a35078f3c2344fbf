// The page: makes its parts, and connects them to the viewer and to the user.
import { App } from "./app";
import { connectComparing } from "./compare";
import { Connection } from "./connection";
import { connectControls } from "./controls";
import { Drop } from "./drop";
import { attach } from "./hands";
import { Inbox } from "./inbox";
import { pressKey } from "./keys";
import type { StaticPage } from "./messages";
import { connectSaving } from "./saving";
import { StaticConnection, hideWhatNeedsAViewer } from "./static-connection";

/** What an exported page shows; it is read before this script. */
const data = (globalThis as { lumbreAtRest?: StaticPage }).lumbreAtRest;
const app = new App(data !== undefined);
const { page, sheet, camera } = app;
const inbox = new Inbox(app);
page.connection = data ? new StaticConnection(inbox, data) : new Connection(inbox);

attach(sheet.picture, sheet, camera, {
  moved: () => page.moved(),
  key: (event) => pressKey(app, event),
  pick(x, y, turns) {
    const request = page.ask({ type: "pick", x, y });
    if (turns) app.orbitOnPick = request;
  },
  hover: (at) => app.pixels.hover(at),
});
connectControls(app);
connectSaving(app);
connectComparing(app);
if (data) hideWhatNeedsAViewer();
else new Drop((errand) => page.ticket(errand), app.alert);
