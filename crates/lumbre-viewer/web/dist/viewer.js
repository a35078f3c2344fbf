"use strict";
(() => {
  // src/proof.ts
  var IV = [1779033703, 3144134277, 1013904242, 2773480762, 1359893119, 2600822924, 528734635, 1541459225];
  var ORDER = [2, 6, 3, 10, 7, 0, 4, 13, 1, 11, 12, 5, 9, 14, 15, 8];
  var QUARTERS = [
    [0, 4, 8, 12],
    [1, 5, 9, 13],
    [2, 6, 10, 14],
    [3, 7, 11, 15],
    [0, 5, 10, 15],
    [1, 6, 11, 12],
    [2, 7, 8, 13],
    [3, 4, 9, 14]
  ];
  var FLAGS = 1 | 2 | 8 | 16;
  var BLOCK = 64;
  function keyedHash(key2, bytes2) {
    if (key2.length !== 32 || bytes2.length > BLOCK) throw new Error("one block and a key of 32 bytes");
    const words = (of, count) => {
      const view = new DataView(Uint8Array.from({ length: 4 * count }, (_, i) => of[i] ?? 0).buffer);
      return Array.from({ length: count }, (_, i) => view.getUint32(4 * i, true));
    };
    const v = Uint32Array.from([...words(key2, 8), ...IV.slice(0, 4), 0, 0, bytes2.length, FLAGS]);
    const at = (i) => v[i] ?? 0;
    const turned2 = (x, by) => x >>> by | x << 32 - by;
    let block = words(bytes2, 16);
    for (let round = 0; round < 7; round++) {
      QUARTERS.forEach(([a, b, c, d], quarter) => {
        for (const [which, first, second] of [[0, 16, 12], [1, 8, 7]]) {
          v[a] = at(a) + at(b) + (block[2 * quarter + which] ?? 0);
          v[d] = turned2(at(d) ^ at(a), first);
          v[c] = at(c) + at(d);
          v[b] = turned2(at(b) ^ at(c), second);
        }
      });
      block = ORDER.map((from) => block[from] ?? 0);
    }
    const out = new DataView(new ArrayBuffer(32));
    for (let i = 0; i < 8; i++) out.setUint32(4 * i, at(i) ^ at(i + 8), true);
    return new Uint8Array(out.buffer);
  }
  var digits = (bytes2) => Array.from(bytes2, (byte) => byte.toString(16).padStart(2, "0")).join("");
  var bytesOf = (text) => Uint8Array.from(text.match(/../g) ?? [], (pair) => parseInt(pair, 16));
  function proof(secret2, side, viewers, pages) {
    const bytes2 = [...new TextEncoder().encode(side), ...bytesOf(viewers).slice(0, 24), ...bytesOf(pages).slice(0, 24)];
    return digits(keyedHash(bytesOf(secret2), Uint8Array.from(bytes2)));
  }

  // src/protocol.ts
  var HEADER = 32;
  var MAGIC = 827151692;
  function decoded(packet) {
    const numbers = new Uint32Array(packet, 0, HEADER / 4);
    const [magic = 0, width = 0, height = 0, fullWidth = 0, fullHeight = 0, spp = 0, sequence = 0, flags = 0] = numbers;
    if (magic !== MAGIC || packet.byteLength !== HEADER + 4 * width * height) throw new Error("no frame");
    const pixels = new ImageData(new Uint8ClampedArray(packet, HEADER), width, height);
    return { width, height, fullWidth, fullHeight, spp, sequence, isFull: (flags & 1) !== 0, isDone: (flags & 2) !== 0, isDenoised: (flags & 4) !== 0, pixels };
  }

  // src/connection.ts
  var UNKNOWN = 4403;
  var SECRET = "lumbre-session";
  function secret() {
    const token = /^#([0-9a-f]{64})$/.exec(location.hash)?.[1];
    if (token) {
      history.replaceState(null, "", location.pathname);
      sessionStorage.setItem(SECRET, token);
    }
    return sessionStorage.getItem(SECRET);
  }
  var Connection = class {
    constructor(listener2) {
      this.listener = listener2;
      setTimeout(() => this.connect());
      addEventListener("hashchange", () => {
        if (!secret()) return;
        clearTimeout(this.again);
        const before = this.socket;
        this.connect();
        before?.close();
      });
    }
    listener;
    socket;
    wait = 500;
    again = 0;
    isIn = false;
    requests = 0;
    waiting = /* @__PURE__ */ new Map();
    send(message) {
      if (this.isIn && this.socket?.readyState === WebSocket.OPEN) this.socket.send(JSON.stringify(message));
    }
    /** An address for an errand, which works once. */
    ticket(errand) {
      if (!this.isIn) return Promise.reject(new Error("not connected"));
      const request = ++this.requests;
      return new Promise((found) => {
        this.waiting.set(request, found);
        this.send({ type: "ticket", request, errand });
      });
    }
    connect() {
      this.isIn = false;
      const known = secret();
      if (!known) {
        this.listener.onStatus("refused");
        return;
      }
      const socket = new WebSocket(`ws://${location.host}/socket`);
      socket.binaryType = "arraybuffer";
      this.socket = socket;
      const nonce = digits(crypto.getRandomValues(new Uint8Array(32)));
      let challenge = "";
      const greet = (message) => {
        if (message.type === "challenge" && !challenge && /^[0-9a-f]{64}$/.test(message.nonce)) {
          challenge = message.nonce;
          socket.send(JSON.stringify({ type: "hello", nonce, proof: proof(known, "page", challenge, nonce) }));
          return true;
        }
        if (message.type !== "welcome" || !challenge || message.proof !== proof(known, "viewer", challenge, nonce)) return false;
        if (message.session) sessionStorage.setItem(SECRET, message.session);
        [this.isIn, this.wait] = [true, 500];
        this.listener.onStatus("open");
        return true;
      };
      const lost = (how) => {
        if (this.socket !== socket) return;
        [this.socket, this.isIn] = [void 0, false];
        this.waiting.clear();
        this.listener.onStatus(how);
        this.again = setTimeout(() => this.connect(), this.wait);
        this.wait = Math.min(this.wait * 1.5, 5e3);
      };
      socket.onclose = ({ code }) => lost(code === UNKNOWN ? "refused" : "gone");
      socket.onmessage = (event) => {
        if (this.socket !== socket) return;
        if (!this.isIn) {
          let isViewer = false;
          try {
            isViewer = typeof event.data === "string" && greet(JSON.parse(event.data));
          } catch {
          }
          if (isViewer) return;
          lost("foreign");
          socket.close();
          return;
        }
        if (typeof event.data === "string") {
          const message = JSON.parse(event.data);
          if (message.type === "ticket") {
            this.waiting.get(message.request)?.(message.address);
            this.waiting.delete(message.request);
          } else {
            this.listener.onMessage(message);
          }
          return;
        }
        this.listener.onFrame(decoded(event.data));
        this.send({ type: "shown" });
      };
    }
  };

  // src/elements.ts
  function byId(id) {
    const found = document.getElementById(id);
    if (!found) throw new Error(`the page has no ${id}`);
    return found;
  }
  function element(name, text = "", properties = {}) {
    const made = Object.assign(document.createElement(name), properties);
    if (text) made.textContent = text;
    return made;
  }
  function short(value) {
    return Number.isFinite(value) ? String(+value.toPrecision(6)) : String(value);
  }
  function large(value) {
    const units = [[1e9, " G"], [1e6, " M"], [1e3, " k"]];
    for (const [unit2, name] of units) if (value >= unit2) return `${(value / unit2).toFixed(2)}${name}`;
    return `${Math.round(value)}`;
  }
  function spoken(seconds) {
    if (seconds < 1) return `${Math.round(seconds * 1e3)} ms`;
    if (seconds < 90) return `${seconds.toFixed(seconds < 10 ? 1 : 0)} s`;
    return `${Math.floor(seconds / 60)} min ${Math.round(seconds % 60)} s`;
  }
  function options(select, entries, chosen) {
    const same = select.options.length === entries.length && entries.every(([value, text], i) => select.options[i]?.value === value && select.options[i]?.textContent === text);
    if (!same) select.replaceChildren(...entries.map(([value, text]) => element("option", text, { value })));
    select.value = chosen;
  }
  function save(name, text) {
    const url = URL.createObjectURL(new Blob([text], { type: "text/plain" }));
    element("a", "", { href: url, download: name }).click();
    setTimeout(() => URL.revokeObjectURL(url), 1e4);
  }

  // src/edit.ts
  var MOST = 60;
  var toSrgb = (c) => c <= 31308e-7 ? 12.92 * c : 1.055 * c ** (1 / 2.4) - 0.055;
  var hex = (value) => "#" + value.map((c) => Math.round(255 * Math.max(0, Math.min(1, toSrgb(c)))).toString(16).padStart(2, "0")).join("");
  var Editor = class {
    constructor(panel, filter, edit) {
      this.panel = panel;
      this.filter = filter;
      this.edit = edit;
      filter.addEventListener("input", () => this.draw());
    }
    panel;
    filter;
    edit;
    parameters = [];
    settings = /* @__PURE__ */ new Map();
    list(parameters) {
      if (JSON.stringify(parameters) === JSON.stringify(this.parameters)) return;
      this.parameters = parameters;
      this.draw();
    }
    take(settings) {
      this.settings = new Map(settings);
      for (const row of this.panel.querySelectorAll(".parameter")) {
        row.classList.toggle("changed", this.settings.has(row.dataset["path"] ?? ""));
      }
    }
    draw() {
      const wanted = this.filter.value.toLowerCase();
      const found = this.parameters.filter((p) => `${p.owner} ${p.name}`.toLowerCase().includes(wanted));
      const groups = /* @__PURE__ */ new Map();
      for (const parameter of found.slice(0, MOST)) {
        let group = groups.get(parameter.owner);
        if (!group) {
          group = element("fieldset");
          group.append(element("legend", parameter.owner));
          groups.set(parameter.owner, group);
        }
        group.append(this.row(parameter));
      }
      const rest = found.length - MOST;
      const more = rest > 0 ? [element("p", `${rest} more: find them by name.`, { className: "quiet" })] : [];
      const none = found.length === 0 ? [element("p", "No parameter has this name.", { className: "quiet" })] : [];
      this.panel.replaceChildren(...groups.values(), ...more, ...none);
    }
    row(parameter) {
      const id = `parameter-${parameter.path}`;
      const row = element("div", "", { className: "parameter" });
      row.dataset["path"] = parameter.path;
      row.classList.toggle("changed", this.settings.has(parameter.path));
      const input = element("input", "", { id });
      const label = element("label", parameter.name, { htmlFor: id });
      const start = () => {
        const set = this.settings.get(parameter.path);
        if (parameter.kind === "colour") {
          input.type = "color";
          input.value = set?.startsWith("#") ? set : hex(parameter.value ?? [0.5, 0.5, 0.5]);
        } else if (parameter.kind === "number" || parameter.kind === "factor") {
          input.type = "number";
          input.step = "any";
          if (parameter.low !== null) input.min = String(parameter.low);
          if (parameter.high !== null) input.max = String(parameter.high);
          input.value = set ?? (parameter.value ? short(parameter.value[0] ?? 0) : "");
        } else {
          input.type = "text";
          input.value = set ?? (parameter.value ?? []).map(short).join(",");
        }
        if (!parameter.value && !set) input.placeholder = "texture";
      };
      start();
      const event = parameter.kind === "colour" ? "input" : "change";
      input.addEventListener(event, () => input.value !== "" && this.edit(parameter.path, input.value));
      const back = element("button", "\u21BA", { title: `Undo ${parameter.name}` });
      back.setAttribute("aria-label", `Undo ${parameter.name} of ${parameter.owner}`);
      back.addEventListener("click", () => {
        this.settings.delete(parameter.path);
        this.edit(parameter.path, null);
        start();
      });
      row.append(label, input, back);
      return row;
    }
    /** As an overlay file. */
    overlay() {
      return [...this.settings].map(([path, value]) => `${path} = ${value}
`).join("");
    }
    dropAll() {
      for (const path of this.settings.keys()) this.edit(path, null);
      this.settings.clear();
      this.draw();
    }
  };

  // src/explanation.ts
  var Explanation = class {
    constructor(ticket2) {
      this.ticket = ticket2;
      this.button.addEventListener("click", () => this.show());
      this.language.addEventListener("change", () => void this.load());
      this.alone.addEventListener("click", () => setTimeout(() => void this.offerAlone()));
      byId("explanation-close").addEventListener("click", () => this.dialog.close());
      this.dialog.addEventListener("close", () => byId("explanation-text").replaceChildren());
    }
    ticket;
    dialog = byId("explanation");
    button = byId("explain");
    alone = byId("explanation-alone");
    language = byId("language");
    languages = [];
    pixel;
    /** The languages in which there are explanations. */
    offer(languages) {
      this.languages = languages;
      const codes = languages.map(([code]) => code);
      const spoken2 = navigator.languages.map((name) => name.slice(0, 2)).find((code) => codes.includes(code));
      const chosen = codes.includes(this.language.value) ? this.language.value : spoken2 ?? codes[0] ?? "";
      options(this.language, languages, chosen);
      this.draw();
    }
    /** It is this pixel that is asked about. */
    of(x, y) {
      this.pixel = [x, y];
      this.draw();
    }
    /** Explains the pixel that was asked about. */
    show() {
      if (this.button.hidden) return;
      void this.load();
      this.dialog.showModal();
    }
    draw() {
      this.button.hidden = !this.pixel || this.languages.length === 0;
      this.button.textContent = `Explain pixel ${this.pixel?.join(", ") ?? ""}`;
    }
    get errand() {
      return this.pixel && { for: "explanation", language: this.language.value, pixel: this.pixel };
    }
    async offerAlone() {
      this.alone.removeAttribute("href");
      if (this.errand) this.alone.href = await this.ticket(this.errand);
    }
    async load() {
      if (!this.errand) return;
      const title = this.button.textContent ?? "";
      try {
        const address = await this.ticket(this.errand);
        const frame = element("iframe", "", { title });
        frame.setAttribute("sandbox", "");
        frame.src = address;
        byId("explanation-text").replaceChildren(frame);
        await this.offerAlone();
      } catch {
        byId("explanation-text").replaceChildren(element("p", "The viewer does not answer."));
      }
    }
  };

  // src/facts.ts
  var point = (v) => v.map(short).join(", ");
  function showFacts(list, warnings, scene) {
    const counted = (kinds) => Object.entries(kinds).map(([name, count]) => `${count} ${name}`).join(", ") || "none";
    const rows = [
      ["Shapes", counted(scene.shapes)],
      ["Triangles", large(scene.triangles)],
      ["Instances", large(scene.instances)],
      ["Materials", counted(scene.materials)],
      ["Lights", counted(scene.lights)],
      ["Bounds", scene.bounds ? `${point(scene.bounds[0])} to ${point(scene.bounds[1])}` : "none"],
      ["Memory", `${large(scene.memory)}B`],
      ["Built in", spoken(scene.build_seconds)]
    ];
    list.replaceChildren(...rows.flatMap(([name, text]) => [element("dt", name), element("dd", text)]));
    warnings.replaceChildren();
    if (scene.warnings.length > 0) {
      warnings.append(element("p", `${scene.warnings.length} warnings`, { className: "quiet" }));
      warnings.append(element("pre", scene.warnings.join("\n"), { tabIndex: 0 }));
    }
  }
  var named = ({ shape, kind }) => kind === "ground" ? kind : `${shape} (${kind})`;
  function showHits(panel, hits) {
    const first = hits[0];
    if (!first) {
      panel.replaceChildren(element("p", "Nothing is there.", { className: "quiet" }));
      return;
    }
    const rows = [
      ["Shape", named(first)],
      ["Material", first.material ?? "none"],
      ["Position", first.point && point(first.point)],
      ["Normal", first.normal && point(first.normal)],
      ["Distance", short(first.distance)],
      ["uv", first.uv && point(first.uv)],
      ["Triangle", first.kind === "mesh" ? first.primitive?.toString() : void 0],
      ["Instance", first.instance === null ? "none" : first.instance?.toString()],
      ["Side", first.front === void 0 ? void 0 : first.front ? "outside" : "inside"]
    ];
    const table = element("table");
    for (const [name, text] of rows) {
      if (text === void 0) continue;
      const row = element("tr");
      row.append(element("th", name, { scope: "row" }), element("td", text));
      table.append(row);
    }
    panel.replaceChildren(table);
    if (first.front === void 0) return;
    const all = element("details");
    all.append(element("summary", `All ${hits.length} hits of this ray`));
    const list = element("ol");
    for (const hit of hits) {
      list.append(element("li", `${short(hit.distance)}: shape ${named(hit)}, ${hit.material ?? "no material"}, ${hit.front ? "in" : "out"}`));
    }
    all.append(list);
    panel.append(all);
  }

  // src/hands.ts
  var STILL = 4;
  function attach(canvas, sheet2, camera2, handlers) {
    const pointers = /* @__PURE__ */ new Map();
    let travelled = 0;
    const spread = () => {
      const [a, b] = [...pointers.values()];
      return a && b ? Math.hypot(a.clientX - b.clientX, a.clientY - b.clientY) : 0;
    };
    canvas.addEventListener("pointerdown", (event) => {
      canvas.setPointerCapture(event.pointerId);
      canvas.focus();
      pointers.set(event.pointerId, event);
      if (pointers.size === 1) travelled = 0;
    });
    canvas.addEventListener("pointermove", (event) => {
      const before = pointers.get(event.pointerId);
      if (!before) {
        handlers.hover(sheet2.at(event.clientX, event.clientY));
        return;
      }
      const wide = spread();
      const [dx, dy] = [event.clientX - before.clientX, event.clientY - before.clientY];
      pointers.set(event.pointerId, event);
      travelled += Math.hypot(dx, dy);
      if (travelled < STILL) return;
      const height = Math.max(1, sheet2.height * sheet2.scale());
      const pan = () => {
        const span = camera2.fov === null ? 1 : 2 * Math.tan(camera2.fov * Math.PI / 360);
        camera2.move(-dx / height * span, dy / height * span, 0);
      };
      if (pointers.size >= 2) {
        if (wide > 0) camera2.dolly(wide / Math.max(1, spread()));
        pan();
      } else if (sheet2.isZoomed() && event.ctrlKey) {
        sheet2.slide(dx, dy);
        return;
      } else if (before.button === 2 || before.button === 1 || (event.buttons & 6) !== 0 || event.shiftKey) {
        pan();
      } else {
        camera2.orbit(-dx / height * Math.PI, dy / height * Math.PI);
      }
      handlers.moved();
    });
    const up = (event) => {
      const was = pointers.delete(event.pointerId);
      if (was && pointers.size === 0 && travelled < STILL && event.type === "pointerup" && event.button === 0) {
        const at = sheet2.at(event.clientX, event.clientY);
        if (at) handlers.pick(at[0], at[1], false);
      }
    };
    canvas.addEventListener("pointerup", up);
    canvas.addEventListener("pointercancel", up);
    canvas.addEventListener("pointerleave", () => handlers.hover(null));
    canvas.addEventListener("contextmenu", (event) => event.preventDefault());
    canvas.addEventListener("dblclick", (event) => {
      const at = sheet2.at(event.clientX, event.clientY);
      if (at) handlers.pick(at[0], at[1], true);
    });
    canvas.addEventListener("wheel", (event) => {
      event.preventDefault();
      const factor = Math.exp(Math.max(-1, Math.min(1, event.deltaY / 300)));
      if (event.ctrlKey || event.metaKey) {
        const box = (canvas.parentElement?.parentElement ?? canvas).getBoundingClientRect();
        sheet2.zoomBy(1 / factor, event.clientX - box.left, event.clientY - box.top);
        return;
      }
      camera2.dolly(factor);
      handlers.moved();
    }, { passive: false });
    const held = /* @__PURE__ */ new Set();
    let last = 0;
    const FLY = {
      w: [0, 0, 1],
      s: [0, 0, -1],
      a: [-1, 0, 0],
      d: [1, 0, 0],
      q: [0, -1, 0],
      e: [0, 1, 0]
    };
    const TURN = {
      arrowleft: [-1, 0],
      arrowright: [1, 0],
      arrowup: [0, 1],
      arrowdown: [0, -1]
    };
    const fly = (now) => {
      if (held.size === 0) return;
      const seconds = Math.min(0.1, (now - last) / 1e3);
      last = now;
      const fast = held.has("shift") ? 4 : 1;
      let any = false;
      for (const key2 of held) {
        const [step, turn] = [FLY[key2], TURN[key2]];
        const by = seconds * 0.8 * fast;
        if (step) camera2.move(step[0] * by, step[1] * by, step[2] * by);
        if (turn) camera2.orbit(turn[0] * by, turn[1] * by);
        if (key2 === "pageup" || key2 === "pagedown") camera2.dolly(Math.exp(key2 === "pageup" ? -by : by));
        any ||= key2 !== "shift";
      }
      if (any) handlers.moved();
      requestAnimationFrame(fly);
    };
    canvas.addEventListener("keydown", (event) => {
      if (event.ctrlKey || event.metaKey || event.altKey) return;
      const key2 = event.key.toLowerCase();
      if (key2 in FLY || key2 in TURN || key2 === "pageup" || key2 === "pagedown" || key2 === "shift") {
        event.preventDefault();
        if (held.size === 0) {
          last = performance.now() - 16;
          requestAnimationFrame(fly);
        }
        held.add(key2);
      } else if (key2 === "enter") {
        handlers.pick(sheet2.width / 2, sheet2.height / 2, false);
      } else if (handlers.key(key2)) {
        event.preventDefault();
      }
    });
    canvas.addEventListener("keyup", (event) => held.delete(event.key.toLowerCase()));
    canvas.addEventListener("blur", () => held.clear());
  }

  // src/vectors.ts
  var add = (a, b) => [a[0] + b[0], a[1] + b[1], a[2] + b[2]];
  var sub = (a, b) => [a[0] - b[0], a[1] - b[1], a[2] - b[2]];
  var scale = (a, s) => [a[0] * s, a[1] * s, a[2] * s];
  var dot = (a, b) => a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
  var cross = (a, b) => [
    a[1] * b[2] - a[2] * b[1],
    a[2] * b[0] - a[0] * b[2],
    a[0] * b[1] - a[1] * b[0]
  ];
  var length = (a) => Math.hypot(...a);
  var unit = (a) => scale(a, 1 / (length(a) || 1));
  function turned(v, axis, angle) {
    const [c, s] = [Math.cos(angle), Math.sin(angle)];
    return add(add(scale(v, c), scale(cross(axis, v), s)), scale(axis, dot(axis, v) * (1 - c)));
  }

  // src/camera.ts
  var POLE = 0.02;
  var Camera = class {
    placement = { eye: [0, 0, 1], target: [0, 0, 0], up: [0, 1, 0] };
    fov = null;
    zoom = 1;
    mirrored = false;
    /** What stays upwards while the camera turns. */
    axis = [0, 1, 0];
    /** That of a state; what stays upwards is found anew. */
    take(state, scene) {
      if (!state.placement) return;
      const own = scene.cameras[state.camera];
      this.placement = state.placement;
      this.mirrored = own?.mirrored ?? false;
      this.fov = state.fov ?? own?.fov ?? null;
      this.zoom = state.zoom;
      this.axis = this.upright(scene, state.name.endsWith(".pbrt"));
    }
    forward() {
      return unit(sub(this.placement.target, this.placement.eye));
    }
    right() {
      const right = unit(cross(this.placement.up, this.forward()));
      return this.mirrored ? scale(right, -1) : right;
    }
    upward() {
      const forward = this.forward();
      return unit(sub(this.placement.up, scale(forward, dot(this.placement.up, forward))));
    }
    distance() {
      return length(sub(this.placement.target, this.placement.eye));
    }
    /** An axis that the picture does not lean to the side of; pbrt files do not say which is up. */
    upright(scene, unsaid) {
      const [right, up] = [this.right(), this.upward()];
      const axes = [[1, 0, 0], [0, 1, 0], [0, 0, 1]];
      const candidates = [...axes, ...axes.map((axis) => scale(axis, -1)), scene.up];
      let [best, most] = [up, 0];
      for (const axis of candidates) {
        const bonus = axis === scene.up && !unsaid ? 0.5 : 0;
        const standing = dot(axis, up) + bonus;
        if (Math.abs(dot(axis, right)) < 1e-3 && dot(axis, up) > 1e-3 && standing > most) [best, most] = [axis, standing];
      }
      return best;
    }
    /** Turns around the target by angles in radians: to the right, and up. */
    orbit(right, up) {
      let { eye, target } = this.placement;
      let offset = sub(eye, target);
      const sideways = Math.sign(dot(cross(this.axis, offset), this.right())) || 1;
      offset = turned(offset, this.axis, right * sideways);
      const polar = Math.acos(Math.max(-1, Math.min(1, dot(unit(offset), this.axis))));
      const wanted = Math.max(POLE, Math.min(Math.PI - POLE, polar - up));
      const across = cross(this.axis, offset);
      if (length(across) > 0) offset = turned(offset, unit(across), wanted - polar);
      eye = add(target, offset);
      this.placement = { eye, target, up: this.axis };
    }
    /** Moves eye and target: to the right, up and forward, in shares of the distance between them. */
    move(right, up, forward) {
      const by = this.distance();
      const step = add(add(scale(this.right(), right * by), scale(this.upward(), up * by)), scale(this.forward(), forward * by));
      const { eye, target } = this.placement;
      this.placement = { eye: add(eye, step), target: add(target, step), up: this.axis };
    }
    /** Comes nearer to the target by a factor, or shows more of it. */
    dolly(factor) {
      const { eye, target } = this.placement;
      this.placement = { eye: add(target, scale(sub(eye, target), factor)), target, up: this.axis };
      this.zoom = Math.max(1e-4, Math.min(1e4, this.zoom / factor));
    }
    /** Turns around this point from now on. */
    lookAt(point2) {
      const { eye } = this.placement;
      this.placement = { eye, target: point2, up: this.axis };
    }
    /** As pbrt writes it. */
    toPbrt() {
      const { eye, target } = this.placement;
      const numbers = (v) => v.map((x) => +x.toPrecision(9)).join(" ");
      const mirror = this.mirrored ? "Scale -1 1 1\n" : "";
      const lens = this.fov === null ? "" : `
Camera "perspective" "float fov" [${+this.fov.toPrecision(9)}]`;
      return `${mirror}LookAt ${numbers(eye)}  ${numbers(target)}  ${numbers(this.upward())}${lens}`;
    }
    /** As glTF writes it: a node, whose camera looks along -z. */
    toGltf(aspect) {
      const columns = [
        [this.right(), 0],
        [this.upward(), 0],
        [scale(this.forward(), -1), 0],
        [this.placement.eye, 1]
      ];
      const matrix = columns.flatMap(([v, w]) => [...v.map((x) => +x.toPrecision(9)), w]);
      const shorter = (this.fov ?? 45) * Math.PI / 180;
      const yfov = aspect >= 1 ? shorter : 2 * Math.atan(Math.tan(shorter / 2) / aspect);
      const perspective = { aspectRatio: +aspect.toPrecision(9), yfov: +yfov.toPrecision(9), znear: 0.01 };
      return JSON.stringify({ cameras: [{ type: "perspective", perspective }], nodes: [{ camera: 0, matrix }] });
    }
  };

  // src/sheet.ts
  var MOST_ZOOM = 256;
  var NUMBERS_FROM = 32;
  function context(canvas) {
    const found = canvas.getContext("2d", { willReadFrequently: false });
    if (!found) throw new Error("this browser has no canvas");
    return found;
  }
  var Sheet = class {
    constructor(stage2, sheet2, picture, reference, numbers) {
      this.stage = stage2;
      this.sheet = sheet2;
      this.picture = picture;
      this.reference = reference;
      this.numbers = numbers;
      new ResizeObserver(() => this.place()).observe(stage2);
    }
    stage;
    sheet;
    picture;
    reference;
    numbers;
    width = 16;
    height = 9;
    /** Screen pixels a pixel; 0 fits the picture. */
    zoom = 0;
    left = 0;
    top = 0;
    small = document.createElement("canvas");
    changed = () => {
    };
    show(frame) {
      const { fullWidth, fullHeight } = frame;
      if (frame.isFull && (this.width !== frame.width || this.height !== frame.height)) this.size(frame.width, frame.height);
      if (!frame.isFull && Math.abs(this.width / this.height - frame.width / frame.height) > 0.05) this.size(fullWidth, fullHeight);
      const drawing = context(this.picture);
      if (frame.width === this.width && frame.height === this.height) {
        drawing.putImageData(frame.pixels, 0, 0);
      } else {
        if (this.small.width !== frame.width || this.small.height !== frame.height) {
          [this.small.width, this.small.height] = [frame.width, frame.height];
        }
        context(this.small).putImageData(frame.pixels, 0, 0);
        drawing.imageSmoothingQuality = "low";
        drawing.clearRect(0, 0, this.width, this.height);
        drawing.drawImage(this.small, 0, 0, this.width, this.height);
      }
    }
    size(width, height) {
      [this.width, this.height] = [width, height];
      [this.picture.width, this.picture.height] = [width, height];
      this.place();
    }
    fit() {
      return Math.min(this.stage.clientWidth / this.width, this.stage.clientHeight / this.height);
    }
    /** Screen pixels a pixel. */
    scale() {
      return this.zoom || this.fit();
    }
    place() {
      const scale2 = this.scale();
      const [width, height] = [this.width * scale2, this.height * scale2];
      const within = (at, size, room) => size <= room ? (room - size) / 2 : Math.min(0, Math.max(room - size, at));
      this.left = within(this.left, width, this.stage.clientWidth);
      this.top = within(this.top, height, this.stage.clientHeight);
      const style = this.sheet.style;
      [style.left, style.top, style.width, style.height] = [`${this.left}px`, `${this.top}px`, `${width}px`, `${height}px`];
      this.sheet.classList.toggle("pixels", scale2 > 2);
      this.clearNumbers();
      this.changed();
    }
    /** Zooms about a place of the screen. */
    zoomBy(factor, x = this.stage.clientWidth / 2, y = this.stage.clientHeight / 2) {
      const before = this.scale();
      const after = Math.min(MOST_ZOOM, before * factor);
      this.zoom = after <= this.fit() ? 0 : after;
      const ratio = this.scale() / before;
      this.left = x - (x - this.left) * ratio;
      this.top = y - (y - this.top) * ratio;
      this.place();
    }
    zoomOut() {
      this.zoom = 0;
      this.place();
    }
    slide(x, y) {
      this.left += x;
      this.top += y;
      this.place();
    }
    isZoomed() {
      return this.zoom > 0;
    }
    /** The place in the picture, in pixels, of one on the screen; null outside. */
    at(clientX, clientY) {
      const box = this.stage.getBoundingClientRect();
      const [x, y] = [(clientX - box.left - this.left) / this.scale(), (clientY - box.top - this.top) / this.scale()];
      return x >= 0 && y >= 0 && x < this.width && y < this.height ? [x, y] : null;
    }
    /** The pixels whose numbers can be read: x, y, width, height. */
    readable() {
      const scale2 = this.scale();
      if (scale2 < NUMBERS_FROM) return null;
      const x = Math.max(0, Math.floor(-this.left / scale2));
      const y = Math.max(0, Math.floor(-this.top / scale2));
      const width = Math.min(64, this.width - x, Math.ceil(this.stage.clientWidth / scale2) + 1);
      const height = Math.min(64, this.height - y, Math.ceil(this.stage.clientHeight / scale2) + 1);
      return [x, y, width, height];
    }
    clearNumbers() {
      if (this.numbers.width > 1) [this.numbers.width, this.numbers.height] = [1, 1];
    }
    writeNumbers(x0, y0, width, values) {
      const scale2 = this.scale();
      if (scale2 < NUMBERS_FROM) return;
      const canvas = this.numbers;
      const rows = Math.ceil(values.length / Math.max(1, width));
      [canvas.width, canvas.height] = [Math.round(width * scale2), Math.round(rows * scale2)];
      const style = canvas.style;
      [style.left, style.top] = [`${x0 * scale2}px`, `${y0 * scale2}px`];
      [style.width, style.height] = [`${canvas.width}px`, `${canvas.height}px`];
      const drawing = context(canvas);
      drawing.font = `${Math.max(8, Math.min(13, scale2 / 5))}px ui-monospace, monospace`;
      drawing.textAlign = "center";
      drawing.textBaseline = "middle";
      const colours = ["#ff9a9a", "#9dffa6", "#a9c8ff"];
      values.forEach((value, i) => {
        const [x, y] = [(i % width + 0.5) * scale2, (Math.floor(i / width) + 0.5) * scale2];
        value.forEach((number, channel) => {
          const text = typeof number === "number" ? +number.toPrecision(3) + "" : number;
          const at = y + (channel - 1) * scale2 * 0.25;
          drawing.lineWidth = 3;
          drawing.strokeStyle = "#000";
          drawing.strokeText(text, x, at, scale2 - 2);
          drawing.fillStyle = colours[channel] ?? "#fff";
          drawing.fillText(text, x, at, scale2 - 2);
        });
      });
    }
    /** Keeps a picture to compare with; without one, what is shown. */
    keep(source = this.picture) {
      [this.reference.width, this.reference.height] = [this.width, this.height];
      context(this.reference).drawImage(source, 0, 0, this.width, this.height);
      this.reference.hidden = false;
    }
    split(percent) {
      this.reference.style.clipPath = `inset(0 0 0 ${percent}%)`;
    }
  };

  // src/page.ts
  var MOST_TIMES = 2e3;
  var measured = {
    latencies: [],
    frames: [],
    changes: /* @__PURE__ */ new Map(),
    spp: 0,
    done: false,
    sequence: 0,
    /** When the first frame came, and the first without noise, by the clock of the page. */
    first: 0,
    firstDenoised: 0,
    /** Frames with noise, since this was last set to 0. */
    noisy: 0
  };
  Object.assign(globalThis, { lumbreMeasured: measured });
  var Page = class {
    sheet = new Sheet(
      byId("stage"),
      byId("sheet"),
      byId("picture"),
      byId("reference"),
      byId("numbers")
    );
    camera = new Camera();
    scene;
    state;
    connection;
    connected = false;
    /** Called when the camera was moved by hand. */
    onCamera = () => {
    };
    requests = 0;
    isMoving = false;
    // What the camera is at is counted, so that one knows which frame shows it. Others count from elsewhere.
    sequence = Math.floor(Math.random() * 2147418112);
    mine = -1;
    send(message) {
      this.connection?.send(message);
    }
    /** Sends a question, and returns the number by which its answer is known. */
    ask(message) {
      this.requests += 1;
      this.send({ ...message, request: this.requests });
      return this.requests;
    }
    set(options2) {
      this.send({ type: "set", ...options2 });
    }
    /** The camera was moved: it is sent once a frame of the screen. */
    moved() {
      this.onCamera();
      if (this.isMoving) return;
      this.isMoving = true;
      requestAnimationFrame(() => {
        this.isMoving = false;
        this.sequence = this.sequence + 1 >>> 0;
        this.mine = this.sequence;
        measured.changes.set(this.sequence, performance.now());
        const { placement, fov, zoom } = this.camera;
        this.send({ type: "camera", sequence: this.sequence, placement, fov, zoom });
      });
    }
    /** One of the file's cameras, as it is. */
    reset(index) {
      this.sequence = this.sequence + 1 >>> 0;
      this.mine = -1;
      this.onCamera();
      this.send({ type: "reset", sequence: this.sequence, camera: index });
    }
    /** Takes the camera of the state, unless it was moved here: what comes back is older than what the hand does. */
    takeCamera(state, scene) {
      const isOwn = state.moved && state.sequence === this.mine;
      if (!isOwn && !this.isMoving) this.camera.take(state, scene);
    }
    show(frame) {
      this.sheet.show(frame);
      const now = performance.now();
      measured.frames.push(now);
      if (measured.frames.length > MOST_TIMES) measured.frames.splice(0, MOST_TIMES / 2);
      measured.first ||= now;
      if (frame.isDenoised) measured.firstDenoised ||= now;
      else measured.noisy += 1;
      [measured.spp, measured.done, measured.sequence] = [frame.isFull ? frame.spp : 0, frame.isDone, frame.sequence];
      for (const [change, since] of measured.changes) {
        if (change > frame.sequence) continue;
        if (change === frame.sequence) measured.latencies.push(now - since);
        measured.changes.delete(change);
      }
    }
  };

  // src/progress.ts
  var DOING = {
    reading: "Reading the scene",
    building: "Building the scene",
    rendering: "",
    done: "",
    waiting: "Waiting for the file to be mended",
    nothing: "No scene"
  };
  function reached({ spp = 0, target = 0, noise, noise_target }) {
    if (target === 0) return ["done"];
    if (noise_target) {
      const now = noise == null ? [] : [`noise ${noise.toFixed(4)} of ${noise_target}`];
      return [`${spp} samples`, ...now];
    }
    return [`${spp} of ${target} samples`, ...noise != null && spp > 1 ? [`noise ${noise.toFixed(4)}`] : []];
  }
  function showProgress(progress) {
    const { doing, target = 0, share = doing === "done" ? 1 : 0 } = progress;
    let text = DOING[doing];
    if (doing === "rendering" || doing === "done") {
      const parts = reached(progress);
      if (doing === "rendering" && share > 0) parts.push(`${Math.floor(100 * share)} %`);
      if (doing === "rendering" && progress.left != null) parts.push(`${spoken(progress.left)} left`);
      if (doing === "done" && progress.seconds) parts.push(`done in ${spoken(progress.seconds)}`);
      if (progress.rays_per_second) parts.push(`${large(progress.rays_per_second)} rays/s`);
      if (progress.dropped) parts.push(`${progress.dropped} samples dropped`);
      text = parts.join(" \xB7 ");
    }
    byId("progress").textContent = text;
    byId("bar").value = target > 0 || doing === "done" ? share : 0;
  }

  // src/static-connection.ts
  function bytes(base64) {
    return Uint8Array.from(atob(base64), (letter) => letter.charCodeAt(0));
  }
  async function unpacked(base64) {
    const stream = new Blob([bytes(base64)]).stream().pipeThrough(new DecompressionStream("deflate"));
    return new DataView(await new Response(stream).arrayBuffer());
  }
  function half(bits) {
    const sign = bits & 32768 ? -1 : 1;
    const [exponent, fraction] = [bits >> 10 & 31, bits & 1023];
    if (exponent === 31) return fraction ? NaN : sign * Infinity;
    return exponent === 0 ? sign * fraction * 2 ** -24 : sign * (1 + fraction / 1024) * 2 ** (exponent - 15);
  }
  var StaticConnection = class {
    constructor(listener2, data2) {
      this.listener = listener2;
      this.data = data2;
      setTimeout(() => void this.start());
    }
    listener;
    data;
    shown;
    values;
    picks;
    async start() {
      this.listener.onStatus("open");
      this.listener.onMessage({ type: "scene", scene: this.data.scene });
      this.listener.onMessage({ type: "progress", doing: "done", ...this.data.progress });
      await this.show("beauty");
      this.picks = await unpacked(this.data.picks.values);
    }
    state(channel) {
      return {
        name: this.data.name,
        has_scene: true,
        error: null,
        edit_error: null,
        camera: this.data.camera,
        sequence: 0,
        moved: false,
        placement: this.data.placement,
        fov: null,
        zoom: 1,
        size: null,
        channel,
        scale: 1,
        spp: this.data.progress.spp ?? null,
        noise: null,
        denoise: null,
        paused: false,
        exposure: 0,
        tone_map: null,
        false_colour: false,
        time: null,
        variant: null,
        settings: []
      };
    }
    async show(name) {
      const channel = this.data.channels.find((known) => known.name === name);
      if (!channel) return;
      this.listener.onMessage({ type: "state", ...this.state(name) });
      const bitmap = await createImageBitmap(new Blob([bytes(channel.png)], { type: "image/png" }));
      const canvas = new OffscreenCanvas(bitmap.width, bitmap.height);
      const drawing = canvas.getContext("2d");
      if (!drawing) return;
      drawing.drawImage(bitmap, 0, 0);
      const { width, height } = bitmap;
      const pixels = drawing.getImageData(0, 0, width, height);
      [this.shown, this.values] = [pixels, void 0];
      if (channel.values) this.values = await unpacked(channel.values);
      const spp = this.data.progress.spp ?? 0;
      this.listener.onFrame({ width, height, fullWidth: width, fullHeight: height, spp, sequence: 0, isFull: true, isDone: true, isDenoised: false, pixels });
    }
    pick(x, y, request) {
      if (!this.picks || !this.shown) return;
      const at = 8 * (y * this.shown.width + x);
      const thing = this.data.picks.shapes[this.picks.getUint32(at, true) - 1];
      const hits = thing ? [{ ...thing, distance: this.picks.getFloat32(at + 4, true) }] : [];
      this.listener.onMessage({ type: "picked", request, x, y, ray: { hits } });
    }
    /** There is nobody to give one. */
    ticket() {
      return Promise.reject(new Error("at rest"));
    }
    send(message) {
      const { type, channel, x, y, width, height, request } = message;
      if (type === "set" && channel) void this.show(String(channel));
      if (type === "pick") this.pick(Math.floor(x ?? 0), Math.floor(y ?? 0), request ?? 0);
      if (type !== "values" || !this.shown) return;
      const whole = this.shown.width;
      const [x0, y0] = [x ?? 0, y ?? 0];
      const [columns, rows] = [Math.min(width ?? 0, whole - x0), Math.min(height ?? 0, this.shown.height - y0)];
      const found = [];
      for (let row = y0; row < y0 + rows; row++) {
        for (let column = x0; column < x0 + columns; column++) {
          const pixel = row * whole + column;
          const value = (c) => this.values ? half(this.values.getUint16(2 * (3 * pixel + c), true)) : +((this.shown?.data[4 * pixel + c] ?? 0) / 255).toFixed(3);
          found.push([value(0), value(1), value(2)]);
        }
      }
      this.listener.onMessage({ type: "values", request: request ?? 0, x: x0, y: y0, width: columns, height: rows, values: found });
    }
  };
  function hideWhatNeedsAViewer() {
    const live = [
      "pause",
      "reset",
      "exposure",
      "tone-map",
      "false-colour",
      "denoise",
      "spp",
      "noise-target",
      "scale",
      "edit-details",
      "camera-details",
      "save-details",
      "help-open"
    ];
    for (const id of live) {
      byId(id).hidden = true;
      for (const label of document.querySelectorAll(`label[for="${id}"]`)) label.hidden = true;
    }
    for (const option of document.querySelectorAll("option[value=ids], option[value=variance]")) option.remove();
  }

  // src/main.ts
  var page = new Page();
  var { sheet, camera } = page;
  var listener = { onMessage, onFrame, onStatus };
  var data = globalThis.lumbreAtRest;
  page.connection = data ? new StaticConnection(listener, data) : new Connection(listener);
  var turnAround = 0;
  var hovered = null;
  var asked = 0;
  function onFrame(frame) {
    page.show(frame);
    if (frame.isFull) askNumbers();
    if (hovered && frame.isFull) askPixel();
  }
  function onMessage(message) {
    switch (message.type) {
      case "scene":
        page.scene = message.scene;
        showFacts(byId("facts"), byId("warnings"), message.scene);
        editor.list(message.scene.parameters);
        explanation.offer(message.scene.languages);
        if (page.state) showState(page.state);
        break;
      case "state":
        page.state = message;
        showState(message);
        break;
      case "progress":
        showProgress(message);
        break;
      case "picked":
        showHits(byId("picked"), message.ray.hits);
        explanation.of(Math.floor(message.x), Math.floor(message.y));
        if (message.request === turnAround && message.ray.hits[0]?.point) {
          camera.lookAt(message.ray.hits[0].point);
          page.moved();
        }
        break;
      case "values":
        if (message.width === 1 && message.height === 1) {
          const [value] = message.values;
          if (value) byId("pixel").textContent = `${message.x}, ${message.y}: ${value.map((v) => typeof v === "number" ? short(v) : v).join("  ")}`;
        } else {
          sheet.writeNumbers(message.x, message.y, message.width, message.values);
        }
        break;
      case "wrong":
        byId("edit-error").textContent = message.what;
        byId("edit-error").hidden = false;
        break;
    }
  }
  function alertOf(title, text) {
    byId("alert-title").textContent = title;
    byId("alert-text").textContent = text;
    byId("alert").hidden = title === "";
  }
  function onStatus(how) {
    page.connected = how === "open";
    if (how === "open") alertOf("", "");
    if (how === "gone") alertOf("The viewer does not answer.", "It has ended, or the tunnel to it has. This page goes on when it is back.");
    if (how === "refused") alertOf("The viewer does not know this page.", "Open the address that lumbre view printed. It works once, in one tab: to have another one, start the viewer again.");
    if (how === "foreign") alertOf("Another program answers in place of the viewer.", "It cannot prove to be the viewer, and was told nothing.");
    if (!page.connected) byId("progress").textContent = "Not connected";
  }
  function showState(now) {
    document.title = now.name ? `${now.name} \u2013 Lumbre` : "Lumbre";
    byId("name").textContent = now.name || "Lumbre";
    if (page.connected) alertOf(now.error ? now.has_scene ? "The file has an error; this is the last good picture." : "The file has an error." : "", now.error ?? "");
    byId("empty").hidden = now.name !== "";
    byId("sheet").hidden = now.name === "";
    const error = byId("edit-error");
    error.textContent = now.edit_error ?? "";
    error.hidden = !now.edit_error;
    const pause = byId("pause");
    pause.setAttribute("aria-pressed", String(now.paused));
    byId("channel").value = now.channel;
    byId("tone-map").value = now.tone_map ?? "none";
    byId("scale").value = String(now.scale);
    const active = document.activeElement;
    const value = (id, text) => {
      const input = byId(id);
      if (active !== input) input.value = text;
    };
    value("exposure", String(now.exposure ?? 0));
    byId("exposure-value").textContent = (now.exposure ?? 0).toFixed(1);
    value("spp", String(now.spp ?? 64));
    value("noise-target", now.noise ? String(now.noise) : "");
    byId("false-colour").checked = now.false_colour;
    byId("denoise").checked = now.denoise ?? false;
    editor.take(now.settings);
    byId("save-overlay").disabled = now.settings.length === 0;
    byId("drop-edits").disabled = now.settings.length === 0;
    const { scene } = page;
    if (!scene) return;
    options(byId("camera"), scene.cameras.map(({ name }, i) => [String(i), name]), String(now.camera));
    page.takeCamera(now, scene);
    const fov = byId("fov");
    fov.disabled = camera.fov === null;
    value("fov", camera.fov === null ? "" : short(camera.fov));
    const end = Math.max(0, ...scene.animations.map((animation) => animation.end ?? 0));
    for (const part of document.querySelectorAll(".animated")) part.hidden = end === 0;
    byId("animation-time").max = String(end);
    value("animation-time", String(now.time ?? 0));
    byId("time-value").textContent = `${(now.time ?? 0).toFixed(2)} s`;
    for (const part of document.querySelectorAll(".varied")) part.hidden = scene.variants.length === 0;
    const variants = [["", "as in the file"], ...scene.variants.map((name) => [name, name])];
    options(byId("variant"), variants, now.variant ?? "");
  }
  function askPixel() {
    const now = performance.now();
    if (!hovered || now - asked < 40) return;
    asked = now;
    const [x, y] = hovered;
    page.ask({ type: "values", x: Math.floor(x), y: Math.floor(y), width: 1, height: 1 });
  }
  var numbersWait = 0;
  function askNumbers() {
    const rectangle = sheet.readable();
    if (!rectangle) return;
    clearTimeout(numbersWait);
    const [x, y, width, height] = rectangle;
    numbersWait = setTimeout(() => page.ask({ type: "values", x, y, width, height }), 60);
  }
  sheet.changed = askNumbers;
  function key(pressed) {
    const channels = ["beauty", "albedo", "normal", "depth", "uv", "variance", "ids"];
    const channel = channels[Number(pressed) - 1];
    if (channel) page.set({ channel });
    else if (pressed === "r") page.reset(page.state?.camera ?? 0);
    else if (pressed === "x") explanation.show();
    else if (pressed === "p") page.set({ paused: !page.state?.paused });
    else if (pressed === "0") sheet.zoomOut();
    else if (pressed === "+" || pressed === "=") sheet.zoomBy(1.5);
    else if (pressed === "-") sheet.zoomBy(1 / 1.5);
    else if (pressed === "[") page.set({ exposure: (page.state?.exposure ?? 0) - 0.5 });
    else if (pressed === "]") page.set({ exposure: (page.state?.exposure ?? 0) + 0.5 });
    else if (pressed === "?") byId("help").showModal();
    else return false;
    return true;
  }
  attach(sheet.picture, sheet, camera, {
    moved: () => page.moved(),
    key,
    pick(x, y, turns) {
      const request = page.ask({ type: "pick", x, y });
      if (turns) turnAround = request;
    },
    hover(at) {
      hovered = at;
      if (at) askPixel();
      else byId("pixel").textContent = "";
    }
  });
  var ticket = (errand) => page.connection?.ticket(errand) ?? Promise.reject(new Error("not connected"));
  var explanation = new Explanation(ticket);
  var editor = new Editor(byId("parameters"), byId("filter"), (path, value) => page.send({ type: "edit", path, value }));
  function on(id, event, act) {
    const input = byId(id);
    input.addEventListener(event, () => act(input));
  }
  on("pause", "click", () => page.set({ paused: !page.state?.paused }));
  on("reset", "click", () => page.reset(page.state?.camera ?? 0));
  on("help-open", "click", () => byId("help").showModal());
  on("help-close", "click", () => byId("help").close());
  on("channel", "change", ({ value }) => page.set({ channel: value }));
  on("exposure", "input", ({ value }) => page.set({ exposure: Number(value) }));
  on("tone-map", "change", ({ value }) => page.set({ tone_map: value }));
  on("false-colour", "change", ({ checked }) => page.set({ false_colour: checked }));
  on("denoise", "change", ({ checked }) => page.set({ denoise: checked }));
  on("scale", "change", ({ value }) => page.set({ scale: Number(value) }));
  on("noise-target", "change", (input) => input.checkValidity() && page.set({ noise: Number(input.value) }));
  on("spp", "change", (input) => input.checkValidity() && page.set({ spp: Number(input.value) }));
  on("camera", "change", ({ value }) => page.reset(Number(value)));
  on("fov", "change", (input) => {
    if (!input.checkValidity()) return;
    camera.fov = Number(input.value);
    page.moved();
  });
  var moment = (wishes) => page.send({ type: "moment", time: page.state?.time ?? null, variant: page.state?.variant ?? null, ...wishes });
  on("animation-time", "input", ({ value }) => moment({ time: Number(value) }));
  on("variant", "change", ({ value }) => moment({ variant: value || null }));
  on("save-overlay", "click", () => save(`${page.state?.name ?? "scene"}.overlay.txt`, editor.overlay()));
  on("drop-edits", "click", () => editor.dropAll());
  async function savePicture(format) {
    try {
      const link = element("a", "", { href: await ticket({ for: "picture", format }), download: `picture.${format}` });
      link.click();
    } catch {
      alertOf("The picture was not saved.", "The viewer does not answer.");
    }
  }
  on("save-png", "click", () => void savePicture("png"));
  on("save-exr", "click", () => void savePicture("exr"));
  function copy(text) {
    const shown = byId("copied");
    [shown.hidden, shown.value] = [false, text];
    shown.select();
    navigator.clipboard?.writeText(text).catch(() => {
    });
  }
  on("copy-pbrt", "click", () => copy(camera.toPbrt()));
  on("copy-gltf", "click", () => copy(camera.toGltf(sheet.width / sheet.height)));
  function compare(is) {
    byId("split").disabled = !is;
    byId("forget").disabled = !is;
    sheet.reference.hidden = !is;
    if (is) sheet.split(Number(byId("split").value));
  }
  on("keep", "click", () => {
    sheet.keep();
    compare(true);
  });
  on("forget", "click", () => compare(false));
  on("split", "input", ({ value }) => sheet.split(Number(value)));
  on("reference-file", "change", async ({ files }) => {
    const file = files?.[0];
    if (!file) return;
    try {
      sheet.keep(await createImageBitmap(file));
      compare(true);
    } catch {
      alertOf("This is no picture that a browser can show.", file.name);
    }
  });
  if (data) hideWhatNeedsAViewer();
  var stage = byId("stage");
  async function drop(file) {
    if (!file) return;
    try {
      const headers = { "Content-Type": "application/octet-stream" };
      const answer = await fetch(await ticket({ for: "scene" }), { method: "POST", headers, body: file });
      if (!answer.ok) alertOf("The file was not opened.", await answer.text());
    } catch {
      alertOf("The file was not opened.", "The viewer does not answer.");
    }
  }
  on("open", "change", ({ files }) => void drop(files?.[0]));
  stage.addEventListener("dragover", (event) => {
    event.preventDefault();
    stage.classList.add("over");
  });
  stage.addEventListener("dragleave", () => stage.classList.remove("over"));
  stage.addEventListener("drop", (event) => {
    event.preventDefault();
    if (data) return;
    stage.classList.remove("over");
    void drop(event.dataTransfer?.files[0]);
  });
})();
