"use strict";
(() => {
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
  function saveBlob(name, blob) {
    const url = URL.createObjectURL(blob);
    element("a", "", { href: url, download: name }).click();
    setTimeout(() => URL.revokeObjectURL(url), 1e4);
  }
  var save = (name, text) => saveBlob(name, new Blob([text], { type: "text/plain" }));
  function on(id, event, act) {
    const input = byId(id);
    input.addEventListener(event, () => act(input));
  }

  // src/display.ts
  var LEVELS = 256;
  var hasScale = (state) => state.channel === "depth" || state.channel === "variance" || state.channel === "beauty" && state.false_colour;
  function histogram({ data: data2 }) {
    const counts = [0, 1, 2].map(() => new Uint32Array(LEVELS));
    for (let at = 0; at < data2.length; at += 4) {
      for (let channel = 0; channel < 3; channel++) {
        const count = counts[channel];
        const level = data2[at + channel] ?? 0;
        if (count) count[level] = (count[level] ?? 0) + 1;
      }
    }
    return counts;
  }
  function marked(pixels) {
    const copy2 = new ImageData(new Uint8ClampedArray(pixels.data), pixels.width, pixels.height);
    const { data: data2 } = copy2;
    for (let at = 0; at < data2.length; at += 4) {
      const levels = [data2[at] ?? 0, data2[at + 1] ?? 0, data2[at + 2] ?? 0];
      if (Math.max(...levels) === 255) data2.set([255, 0, 60, 255], at);
      else if (Math.max(...levels) === 0) data2.set([0, 90, 255, 255], at);
    }
    return copy2;
  }
  var Display = class {
    constructor(page2) {
      this.page = page2;
      const range = () => {
        const [low, high] = ["range-low", "range-high"].map((id) => byId(id).value);
        if (low !== "" && high !== "" && Number(low) < Number(high)) page2.set({ range: [Number(low), Number(high)] });
      };
      for (const id of ["range-low", "range-high"]) byId(id).addEventListener("change", range);
      byId("range-found").addEventListener("click", () => page2.set({ range: [] }));
      byId("map").addEventListener("change", () => page2.set({ map: byId("map").value }));
      byId("mark-clipped").addEventListener("change", () => this.redraw());
      byId("histogram-details").addEventListener("toggle", () => this.draw());
    }
    page;
    canvas = byId("histogram");
    last;
    /** The frame as it is shown. */
    shown(frame) {
      this.last = frame;
      return byId("mark-clipped").checked ? { ...frame, pixels: marked(frame.pixels) } : frame;
    }
    take(state) {
      for (const part of document.querySelectorAll(".scaled")) part.hidden = !hasScale(state);
      byId("map").value = state.map;
      byId("legend").className = `scaled map-${state.map === "automatic" ? state.channel === "depth" ? "near" : "rainbow" : state.map === "grey" && state.channel === "depth" ? "near" : state.map}`;
    }
    /** Shows the range and the histogram of the last frame. */
    draw() {
      const frame = this.last;
      if (!frame) return;
      for (const [id, value] of [["range-low", frame.low], ["range-high", frame.high]]) {
        const input = byId(id);
        if (document.activeElement !== input) input.value = short(value);
      }
      if (byId("histogram-details").open) this.drawHistogram(frame);
    }
    redraw() {
      if (this.last) this.page.sheet.show(this.shown(this.last));
    }
    drawHistogram(frame) {
      const counts = histogram(frame.pixels);
      const drawing = this.canvas.getContext("2d");
      if (!drawing) return;
      const { width, height } = this.canvas;
      drawing.clearRect(0, 0, width, height);
      drawing.globalCompositeOperation = "lighter";
      const most = Math.max(1, ...counts.flatMap((count) => [...count.subarray(1, LEVELS - 1)]));
      counts.forEach((count, channel) => {
        drawing.fillStyle = ["#d03030", "#30a040", "#3060e0"][channel] ?? "#888";
        count.forEach((number, level) => {
          const tall = height * Math.min(1, number / most);
          drawing.fillRect(level * width / LEVELS, height - tall, width / LEVELS, tall);
        });
      });
      const pixels = frame.width * frame.height;
      let [white, black] = [0, 0];
      const { data: data2 } = frame.pixels;
      for (let at = 0; at < data2.length; at += 4) {
        const top = Math.max(data2[at] ?? 0, data2[at + 1] ?? 0, data2[at + 2] ?? 0);
        if (top === 255) white += 1;
        if (top === 0) black += 1;
      }
      const share = (count) => `${(100 * count / pixels).toFixed(1)} %`;
      byId("clipped").textContent = `${share(white)} at white, ${share(black)} black`;
    }
  };

  // src/colour.ts
  var toSrgb = (c) => c <= 31308e-7 ? 12.92 * c : 1.055 * c ** (1 / 2.4) - 0.055;
  var toLinear = (c) => c <= 0.04045 ? c / 12.92 : ((c + 0.055) / 1.055) ** 2.4;
  var toHex = (linear) => "#" + linear.map((c) => Math.round(255 * Math.max(0, Math.min(1, toSrgb(c)))).toString(16).padStart(2, "0")).join("");
  var fromHex = (hex) => [1, 3, 5].map((at) => toLinear(parseInt(hex.slice(at, at + 2), 16) / 255));

  // src/lights.ts
  function parted(light) {
    const power = Math.max(0, ...light);
    return { power, colour: power > 0 ? light.map((c) => c / power) : [1, 1, 1] };
  }
  function asOptions(settings) {
    const quoted = (text) => /^[\w.,=+-]+$/.test(text) ? text : `'${text.replaceAll("'", "'\\''")}'`;
    return settings.map(([path, value]) => `-D ${quoted(`${path}=${value}`)}`).join(" \\\n");
  }
  function numbers(text) {
    const all = text.split(",").map(Number);
    return all.length === 1 ? [all[0] ?? 0, all[0] ?? 0, all[0] ?? 0] : all;
  }
  var LightList = class {
    constructor(edit) {
      this.edit = edit;
    }
    edit;
    panel = byId("lights");
    lights = [];
    settings = /* @__PURE__ */ new Map();
    list(parameters) {
      const lights = parameters.filter(({ path, kind }) => kind === "light" || path === "light.area.scale");
      if (JSON.stringify(lights) === JSON.stringify(this.lights)) return;
      this.lights = lights;
      const none = element("p", "The scene has no light that can be set: the stage brings it.", { className: "quiet" });
      this.panel.replaceChildren(...lights.length > 0 ? lights.map((light) => this.row(light)) : [none]);
    }
    take(settings) {
      this.settings = new Map(settings);
      const own = settings.filter(([path]) => path.startsWith("light.") || this.lights.some((light) => light.path === path));
      const text = byId("light-options");
      text.value = asOptions(own);
      text.hidden = own.length === 0;
      for (const row of this.panel.querySelectorAll("[data-path]")) {
        row.classList.toggle("changed", this.settings.has(row.dataset["path"] ?? ""));
      }
    }
    /** Opens the list, and marks what makes shapes of this material shine. */
    reveal(owner) {
      byId("light-details").open = true;
      const rows = [...this.panel.querySelectorAll("[data-path]")];
      const found = rows.find((row) => row.dataset["owner"] === owner) ?? rows.find((row) => row.dataset["path"] === "light.area.scale");
      for (const row of rows) row.classList.toggle("marked", row === found);
      found?.scrollIntoView({ block: "nearest" });
    }
    value(light) {
      const set = this.settings.get(light.path);
      return set === void 0 ? light.value ?? [1, 1, 1] : numbers(set);
    }
    row(light) {
      const row = element("fieldset");
      [row.dataset["path"], row.dataset["owner"]] = [light.path, light.owner];
      row.append(element("legend", light.kind === "light" && light.path.startsWith("material.") ? `${light.owner}: ${light.name}` : light.owner));
      const fields = element("div", "", { className: "parameter" });
      const power = element("input", "", { type: "number", min: "0", step: "any", id: `power-${light.path}` });
      const colour = element("input", "", { type: "color" });
      colour.setAttribute("aria-label", `Colour of ${light.owner}`);
      const start = () => {
        const now = parted(this.value(light));
        power.value = short(light.kind === "factor" ? this.value(light)[0] ?? 1 : now.power);
        colour.value = toHex(now.colour);
      };
      const send = () => {
        const factor = Number(power.value);
        if (power.value === "" || !(factor >= 0)) return;
        const all = fromHex(colour.value).map((c) => short(c * factor));
        this.edit(light.path, light.kind === "factor" ? short(factor) : all.join(","));
      };
      start();
      power.addEventListener("change", send);
      colour.addEventListener("input", send);
      const back = element("button", "\u21BA", { title: `Undo ${light.owner}` });
      back.setAttribute("aria-label", `Undo ${light.owner}`);
      back.addEventListener("click", () => {
        this.settings.delete(light.path);
        this.edit(light.path, null);
        start();
      });
      fields.append(element("label", light.kind === "factor" ? "Power, as a factor" : "Power", { htmlFor: power.id }), power, back);
      row.append(fields);
      if (light.kind !== "factor") row.append(colour);
      return row;
    }
  };

  // src/edit.ts
  var MAX_LISTED = 60;
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
      const text = byId("edit-options");
      text.value = asOptions(settings);
      text.hidden = settings.length === 0;
    }
    /** Marks the parameters of a material, where they are listed. */
    mark(owner) {
      for (const group of this.panel.querySelectorAll("fieldset")) {
        group.classList.toggle("marked", group.dataset["owner"] === owner);
      }
    }
    /** Opens the list at the parameters of a material. */
    reveal(owner) {
      byId("edit-details").open = true;
      this.filter.value = owner;
      this.draw();
      this.mark(owner);
      this.panel.querySelector(".marked")?.scrollIntoView({ block: "nearest" });
    }
    draw() {
      const wanted = this.filter.value.toLowerCase();
      const found = this.parameters.filter((p) => `${p.owner} ${p.name}`.toLowerCase().includes(wanted));
      const groups = /* @__PURE__ */ new Map();
      for (const parameter of found.slice(0, MAX_LISTED)) {
        let group = groups.get(parameter.owner);
        if (!group) {
          group = element("fieldset");
          group.dataset["owner"] = parameter.owner;
          group.append(element("legend", parameter.owner));
          groups.set(parameter.owner, group);
        }
        group.append(this.row(parameter));
      }
      const rest = found.length - MAX_LISTED;
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
          input.value = set?.startsWith("#") ? set : toHex(parameter.value ?? [0.5, 0.5, 0.5]);
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
    constructor(ticket) {
      this.ticket = ticket;
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
    /** Chooses the pixel to explain. */
    of(x, y) {
      this.pixel = [x, y];
      this.draw();
    }
    /** Shows the explanation of the chosen pixel. */
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
        frame.setAttribute("sandbox", "allow-scripts");
        frame.src = address;
        byId("explanation-text").replaceChildren(frame);
        await this.offerAlone();
      } catch {
        byId("explanation-text").replaceChildren(element("p", "The viewer does not answer."));
      }
    }
  };

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

  // src/handles.ts
  var STEP = 0.02;
  var KEYS = {
    ArrowLeft: [-1, 0, 0],
    ArrowRight: [1, 0, 0],
    ArrowUp: [0, 1, 0],
    ArrowDown: [0, -1, 0],
    PageUp: [0, 0, 1],
    PageDown: [0, 0, -1]
  };
  var LightHandles = class {
    constructor(page2, edit) {
      this.page = page2;
      this.edit = edit;
      this.list.addEventListener("toggle", () => this.draw());
    }
    page;
    edit;
    layer = byId("handles");
    list = byId("light-details");
    handles = [];
    /** The handle under the pointer, and where that was last. */
    held = null;
    isWaiting = false;
    /** The lights of a scene. */
    show(parameters) {
      const places = parameters.filter(({ path, kind }) => kind === "point" && path.startsWith("light."));
      const known = (handle, { path, owner }) => handle?.path === path && handle.owner === owner;
      const isSame = places.length === this.handles.length && places.every((place, i) => known(this.handles[i], place));
      if (!isSame) {
        this.handles = places.map((place) => this.handle(place));
        this.layer.replaceChildren(...this.handles.map(({ button }) => button));
      }
      for (const [i, { value }] of places.entries()) {
        const handle = this.handles[i];
        if (handle && value) handle.start = vector(value);
      }
      this.draw();
    }
    /** The edits that hold: a light that is not edited stands where the file says. */
    take(settings) {
      const edits = new Map(settings);
      for (const handle of this.handles) {
        const set = edits.get(handle.path);
        if (handle !== this.held?.handle) handle.at = set === void 0 ? handle.start : vector(set.split(",").map(Number));
      }
      this.draw();
    }
    /** Puts the handles where the camera sees the lights. */
    draw() {
      const { camera: camera2, scene, state, watches } = this.page;
      this.layer.hidden = !this.list.open || !scene || camera2.fov === null || watches;
      if (this.layer.hidden) return;
      const window = scene?.cameras[state?.camera ?? 0]?.window ?? null;
      for (const { at, button } of this.handles) {
        const seen = this.seen(at, window);
        button.hidden = seen === null;
        if (seen) [button.style.left, button.style.top] = [`${100 * seen[0]}%`, `${100 * seen[1]}%`];
      }
    }
    /** The place in the picture of a point, in shares of its width and height; null behind the camera and outside. */
    seen(point2, window) {
      const { camera: camera2, sheet: sheet2 } = this.page;
      const way = sub(point2, camera2.placement.eye);
      const depth = dot(way, camera2.forward());
      if (depth <= 0) return null;
      const slope = this.slope();
      const [x, y] = [dot(way, camera2.right()) / depth / slope, dot(way, camera2.upward()) / depth / slope];
      const shorter = Math.min(sheet2.width, sheet2.height);
      const [half2, high] = [sheet2.width / shorter, sheet2.height / shorter];
      const [left, right, bottom, top] = window ?? [-half2, half2, -high, high];
      const place = [(x - left) / (right - left), (top - y) / (top - bottom)];
      return place.every((share) => share >= 0 && share <= 1) ? place : null;
    }
    /** Half the field of view, as a slope. */
    slope() {
      return Math.tan((this.page.camera.fov ?? 45) * Math.PI / 360);
    }
    handle({ path, owner, value }) {
      const button = element("button", "", { className: "handle", title: `${owner}: drag it; with Shift, nearer and farther` });
      button.setAttribute("aria-label", `Move ${owner}: arrow keys, Page Up and Page Down`);
      const at = vector(value ?? [0, 0, 0]);
      const handle = { path, owner, start: at, at, button };
      button.addEventListener("pointerdown", (event) => {
        button.setPointerCapture(event.pointerId);
        this.held = { handle, x: event.clientX, y: event.clientY };
      });
      button.addEventListener("pointermove", (event) => {
        if (this.held?.handle !== handle) return;
        const { sheet: sheet2 } = this.page;
        const pixel = 2 * this.slope() / (Math.min(sheet2.width, sheet2.height) * sheet2.scale());
        const [x, y] = [(event.clientX - this.held.x) * pixel, (this.held.y - event.clientY) * pixel];
        this.held = { handle, x: event.clientX, y: event.clientY };
        this.move(handle, event.shiftKey ? [0, 0, y] : [x, y, 0]);
      });
      for (const end of ["pointerup", "pointercancel"]) {
        button.addEventListener(end, () => {
          this.held = null;
        });
      }
      button.addEventListener("keydown", (event) => {
        const along = KEYS[event.key];
        if (!along) return;
        event.preventDefault();
        this.move(handle, scale(along, STEP));
      });
      return handle;
    }
    /** Moves a light to the right, up and away from the camera, in shares of its depth. */
    move(handle, [right, up, away]) {
      const { camera: camera2 } = this.page;
      const depth = dot(sub(handle.at, camera2.placement.eye), camera2.forward());
      const across = add(scale(camera2.right(), right * depth), scale(camera2.upward(), up * depth));
      handle.at = add(handle.at, add(across, scale(camera2.forward(), away * depth)));
      this.draw();
      if (this.isWaiting) return;
      this.isWaiting = true;
      requestAnimationFrame(() => {
        this.isWaiting = false;
        this.edit(handle.path, handle.at.map(short).join(","));
      });
    }
  };
  function vector([x, y, z]) {
    return [x ?? 0, y ?? 0, z ?? 0];
  }

  // src/measure.ts
  var Measure = class {
    constructor(sheet2) {
      this.sheet = sheet2;
      this.button.addEventListener("click", () => this.toggle());
    }
    sheet;
    button = byId("measure");
    points = [];
    isOn = false;
    toggle() {
      this.isOn = !this.isOn;
      this.points = [];
      this.button.setAttribute("aria-pressed", String(this.isOn));
      if (this.isOn) byId("measure-details").open = true;
      this.draw();
    }
    /** Another point; a third one begins anew. */
    take(x, y, hit) {
      if (!this.isOn || !hit?.surface) return;
      if (this.points.length >= 2) this.points = [];
      this.points.push({ at: [x, y], point: hit.surface.point });
      this.draw();
    }
    /** The picture shows the points elsewhere now. */
    moved() {
      this.sheet.mark([]);
    }
    draw() {
      this.sheet.mark(this.points.map(({ at }) => at));
      const [a, b] = this.points;
      const rows = [];
      if (a && b) {
        const by = sub(b.point, a.point);
        rows.push(["Distance", short(length(by))]);
        rows.push(...by.map((value, i) => [`Along ${"xyz"[i]}`, short(value)]));
      } else if (this.isOn) {
        rows.push(["", a ? "Click on the second point." : "Click on the first point."]);
      }
      byId("measured").replaceChildren(...rows.flatMap(([name, text]) => [element("dt", name), element("dd", text)]));
    }
  };

  // src/camera.ts
  var POLE = 0.02;
  var MIN_HEIGHT = 0.01;
  var Camera = class {
    placement = { eye: [0, 0, 1], target: [0, 0, 0], up: [0, 1, 0] };
    fov = null;
    zoom = 1;
    mirrored = false;
    /** Whether it may go below the ground. */
    mayGoBelow = false;
    ground = null;
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
      this.ground = scene.ground;
      if (this.height(this.placement.eye) < 0) this.mayGoBelow = true;
    }
    /** Stands there from now on. */
    place(placement) {
      this.placement = placement;
      this.rise(false);
    }
    /** How far a point is above the ground; infinitely far without one. */
    height(point2) {
      return this.ground ? dot(sub(point2, this.ground.point), this.ground.normal) : Infinity;
    }
    /** Comes out of the ground, the target with the eye or alone. */
    rise(withTarget) {
      if (this.mayGoBelow || !this.ground) return;
      const least = MIN_HEIGHT * this.distance();
      const missing = least - this.height(this.placement.eye);
      if (missing <= 0) return;
      const step = scale(unit(this.ground.normal), missing);
      const { eye, target, up } = this.placement;
      this.placement = { eye: add(eye, step), target: withTarget ? add(target, step) : target, up };
    }
    /** What stays upwards while the camera turns. */
    get upwards() {
      return this.axis;
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
      const wanted = Math.max(POLE, Math.min(Math.PI - POLE, this.lowest(), polar - up));
      const across = cross(this.axis, offset);
      if (length(across) > 0) offset = turned(offset, unit(across), wanted - polar);
      eye = add(target, offset);
      this.placement = { eye, target, up: this.axis };
      this.rise(false);
    }
    /** The largest angle from straight above at which the camera is above the ground, as far from its target as it is. */
    lowest() {
      const { ground } = this;
      if (this.mayGoBelow || !ground || dot(unit(ground.normal), this.axis) < 0.999) return Math.PI;
      const reach = this.distance();
      const drop = (MIN_HEIGHT * reach - this.height(this.placement.target)) / reach;
      return Math.acos(Math.max(-1, Math.min(1, drop)));
    }
    /** Moves eye and target: to the right, up and forward, in shares of the distance between them. */
    move(right, up, forward) {
      const by = this.distance();
      const step = add(add(scale(this.right(), right * by), scale(this.upward(), up * by)), scale(this.forward(), forward * by));
      const { eye, target } = this.placement;
      this.placement = { eye: add(eye, step), target: add(target, step), up: this.axis };
      this.rise(true);
    }
    /** Comes nearer to the target by a factor, or shows more of it. */
    dolly(factor) {
      const { eye, target } = this.placement;
      this.placement = { eye: add(target, scale(sub(eye, target), factor)), target, up: this.axis };
      this.rise(false);
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
      const numbers2 = (v) => v.map((x) => +x.toPrecision(9)).join(" ");
      const mirror = this.mirrored ? "Scale -1 1 1\n" : "";
      const lens = this.fov === null ? "" : `
Camera "perspective" "float fov" [${+this.fov.toPrecision(9)}]`;
      return `${mirror}LookAt ${numbers2(eye)}  ${numbers2(target)}  ${numbers2(this.upward())}${lens}`;
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
  var MAX_ZOOM = 256;
  var NUMBERS_FROM = 32;
  function context(canvas) {
    const found = canvas.getContext("2d", { willReadFrequently: false });
    if (!found) throw new Error("this browser has no canvas");
    return found;
  }
  var Sheet = class {
    constructor(stage, sheet2, picture, reference, numbers2, marks) {
      this.stage = stage;
      this.sheet = sheet2;
      this.picture = picture;
      this.reference = reference;
      this.numbers = numbers2;
      this.marks = marks;
      new ResizeObserver(() => this.place()).observe(stage);
    }
    stage;
    sheet;
    picture;
    reference;
    numbers;
    marks;
    width = 16;
    height = 9;
    /** Screen pixels a pixel; 0 fits the picture. */
    zoom = 0;
    left = 0;
    top = 0;
    /** Where the reference begins, in percent of the width. */
    part = 50;
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
      const after = Math.min(MAX_ZOOM, before * factor);
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
    /** Marks places of the picture, and the line between two of them; none takes the marks away. */
    mark(places) {
      const svg = (name, attributes) => {
        const made = document.createElementNS("http://www.w3.org/2000/svg", name);
        for (const [key, value] of Object.entries(attributes)) made.setAttribute(key, String(value));
        return made;
      };
      this.marks.setAttribute("viewBox", `0 0 ${this.width} ${this.height}`);
      const radius = 5 / this.scale();
      const dots = places.map(([cx, cy]) => svg("circle", { cx, cy, r: radius }));
      const [a, b] = places;
      const line = a && b ? [svg("line", { x1: a[0], y1: a[1], x2: b[0], y2: b[1] })] : [];
      this.marks.replaceChildren(...line, ...dots);
    }
    /** What is shown, the reference too where it covers the picture, as a PNG. */
    async snapshot() {
      const canvas = document.createElement("canvas");
      [canvas.width, canvas.height] = [this.width, this.height];
      const drawing = context(canvas);
      drawing.drawImage(this.picture, 0, 0);
      if (!this.reference.hidden) {
        const from = Math.round(this.width * this.part / 100);
        const wide = this.width - from;
        if (wide > 0) drawing.drawImage(this.reference, from, 0, wide, this.height, from, 0, wide, this.height);
      }
      return new Promise((found) => canvas.toBlob(found, "image/png"));
    }
    /** Keeps a picture to compare with; without one, what is shown. */
    keep(source = this.picture) {
      [this.reference.width, this.reference.height] = [this.width, this.height];
      context(this.reference).drawImage(source, 0, 0, this.width, this.height);
      this.reference.hidden = false;
    }
    split(percent) {
      this.part = percent;
      this.reference.style.clipPath = `inset(0 0 0 ${percent}%)`;
    }
  };

  // src/page.ts
  var MAX_TIMES = 2e3;
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
      byId("numbers"),
      document.querySelector("#marks")
    );
    camera = new Camera();
    scene;
    state;
    connection;
    connected = false;
    /** Whether it only watches. */
    watches = false;
    /** Called when the camera was moved by hand. */
    onCamera = () => {
    };
    requests = 0;
    isMoving = false;
    // Changes of the camera are counted, so that a frame can say which it shows. Each page starts at its own number.
    sequence = Math.floor(Math.random() * 2147418112);
    mine = -1;
    send(message) {
      this.connection?.send(message);
    }
    /** An address for an errand, which works once. */
    ticket(errand) {
      return this.connection?.ticket(errand) ?? Promise.reject(new Error("not connected"));
    }
    /** Sends a question, and returns the number by which its answer is known. */
    ask(question) {
      this.requests += 1;
      this.send({ ...question, request: this.requests });
      return this.requests;
    }
    set(options2) {
      this.send({ type: "set", ...options2 });
    }
    /** The camera was moved: it is sent once a frame of the screen. */
    moved() {
      if (this.watches) {
        if (this.state && this.scene) this.camera.take(this.state, this.scene);
        return;
      }
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
      if (measured.frames.length > MAX_TIMES) measured.frames.splice(0, MAX_TIMES / 2);
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

  // src/pixels.ts
  var PIXEL_EVERY = 40;
  var NUMBERS_AFTER = 60;
  var PixelReader = class {
    constructor(page2) {
      this.page = page2;
      page2.sheet.changed = () => this.askNumbers();
    }
    page;
    hovered = null;
    lastAsked = 0;
    timer = 0;
    /** The pointer is at this place of the picture, or outside. */
    hover(at) {
      this.hovered = at;
      if (at) this.askPixel();
      else byId("pixel").textContent = "";
    }
    /** There is a new picture. */
    refresh() {
      this.askNumbers();
      if (this.hovered) this.askPixel();
    }
    show({ x, y, width, height, values }) {
      if (width !== 1 || height !== 1) {
        this.page.sheet.writeNumbers(x, y, width, values);
        return;
      }
      const [value] = values;
      if (value) byId("pixel").textContent = `${x}, ${y}: ${value.map((v) => typeof v === "number" ? short(v) : v).join("  ")}`;
    }
    askPixel() {
      const now = performance.now();
      if (!this.hovered || now - this.lastAsked < PIXEL_EVERY) return;
      this.lastAsked = now;
      const [x, y] = this.hovered;
      this.page.ask({ type: "values", x: Math.floor(x), y: Math.floor(y), width: 1, height: 1 });
    }
    askNumbers() {
      const rectangle = this.page.sheet.readable();
      if (!rectangle) return;
      clearTimeout(this.timer);
      const [x, y, width, height] = rectangle;
      this.timer = setTimeout(() => this.page.ask({ type: "values", x, y, width, height }), NUMBERS_AFTER);
    }
  };

  // src/section.ts
  var AXES = { x: [1, 0, 0], y: [0, 1, 0], z: [0, 0, 1] };
  var Section = class {
    constructor(page2) {
      this.page = page2;
      this.axis.addEventListener("change", () => this.send());
      this.place.addEventListener("input", () => this.send());
      this.draw();
    }
    page;
    axis = byId("section-axis");
    place = byId("section-place");
    shown = null;
    take({ section }) {
      this.shown = section;
      if (!section && document.activeElement !== this.axis) this.axis.value = "none";
      this.draw();
    }
    /** The camera was moved: what is on its side of the plane is cut away. */
    moved() {
      const plane = this.plane();
      if (plane && this.shown && this.axis.value !== "view" && dot(plane.normal, this.shown.normal) < 0) this.send();
    }
    plane() {
      const { camera: camera2, scene } = this.page;
      const share = Number(this.place.value) / 100;
      if (this.axis.value === "view") {
        const point3 = add(camera2.placement.eye, scale(camera2.forward(), 2 * share * camera2.distance()));
        return { point: point3, normal: scale(camera2.forward(), -1) };
      }
      const axis = AXES[this.axis.value];
      if (!axis || !scene?.bounds) return null;
      const [low, high] = scene.bounds;
      const point2 = add(low, scale(sub(high, low), share));
      const side = dot(sub(camera2.placement.eye, point2), axis) < 0 ? -1 : 1;
      return { point: point2, normal: scale(axis, side) };
    }
    send() {
      this.shown = this.plane();
      this.page.send({ type: "section", plane: this.shown });
      this.draw();
    }
    draw() {
      this.place.disabled = this.axis.value === "none";
    }
  };

  // src/tree.ts
  var MAX_LISTED2 = 200;
  function called({ shape, kind, name }) {
    if (kind === "ground") return kind;
    return name ? `${name} (${kind})` : `${kind} ${shape}`;
  }
  var SceneTree = class {
    constructor(page2, onSelect) {
      this.page = page2;
      this.onSelect = onSelect;
      this.filter.addEventListener("input", () => this.draw());
      this.all.addEventListener("click", () => this.send([], false));
    }
    page;
    onSelect;
    panel = byId("tree");
    filter = byId("tree-filter");
    all = byId("show-all");
    scene;
    hidden = { shapes: [], others: false };
    selected = -1;
    list(scene) {
      const isSame = JSON.stringify(scene.tree) === JSON.stringify(this.scene?.tree);
      this.scene = scene;
      if (!isSame) this.draw();
    }
    take(hidden) {
      this.hidden = hidden;
      this.all.disabled = hidden.shapes.length === 0;
      for (const row of this.panel.querySelectorAll("li")) this.mark(row);
    }
    /** Marks a shape, and brings it into sight where the tree is open. */
    select(shape) {
      this.selected = shape;
      for (const row2 of this.panel.querySelectorAll("li")) this.mark(row2);
      const row = this.panel.querySelector(`li[data-shape="${shape}"]`);
      if (row && byId("tree-details").open) row.scrollIntoView({ block: "nearest" });
    }
    /** Opens the tree at a shape. */
    reveal(shape) {
      byId("tree-details").open = true;
      if (this.filter.value !== "") {
        this.filter.value = "";
        this.draw();
      }
      this.select(shape);
    }
    isHidden(shape) {
      return this.hidden.shapes.includes(shape) !== this.hidden.others;
    }
    hide(shape) {
      const { shapes, others } = this.hidden;
      const rest = shapes.filter((known) => known !== shape);
      this.send(rest.length < shapes.length ? rest : [...rest, shape], others);
    }
    /** Shows this shape alone, or everything again. */
    isolate(shape) {
      const { shapes, others } = this.hidden;
      const isAlone = others && shapes.length === 1 && shapes[0] === shape;
      this.send(isAlone ? [] : [shape], !isAlone);
    }
    send(shapes, others) {
      this.page.send({ type: "hide", shapes, others });
    }
    draw() {
      const wanted = this.filter.value.toLowerCase();
      const { groups = [], left_out = 0 } = this.scene?.tree ?? {};
      const isWanted = (thing, group) => `${group ?? ""} ${called(thing)} ${thing.material ?? ""}`.toLowerCase().includes(wanted);
      let left = MAX_LISTED2;
      let rest = left_out;
      const parts = groups.flatMap(({ name, shapes }) => {
        const found = shapes.filter((thing) => isWanted(thing, name));
        const listed = found.slice(0, left);
        left -= listed.length;
        rest += found.length - listed.length;
        if (listed.length === 0) return [];
        const list = element("ul");
        list.append(...listed.map((thing) => this.row(thing)));
        if (name === null) return [list];
        const part = element("details", "", { open: true });
        part.append(element("summary", name || "moving"), list);
        return [part];
      });
      const more = rest > 0 ? [element("p", `${rest} more: find them by name.`, { className: "quiet" })] : [];
      const none = parts.length === 0 ? [element("p", "No shape has this name.", { className: "quiet" })] : [];
      this.panel.replaceChildren(...parts, ...more, ...none);
    }
    row(thing) {
      const row = element("li");
      row.dataset["shape"] = String(thing.shape);
      const name = called(thing);
      const select = element("button", name, { className: "select" });
      select.append(element("span", thing.material ?? "no material", { className: "quiet" }));
      select.addEventListener("click", () => {
        this.select(thing.shape);
        this.onSelect(thing);
      });
      const hide = element("button", "", { className: "hide" });
      hide.setAttribute("aria-label", `Hide ${name}`);
      hide.addEventListener("click", () => this.hide(thing.shape));
      const isolate = element("button", "Only", { className: "isolate" });
      isolate.setAttribute("aria-label", `Only ${name}`);
      isolate.addEventListener("click", () => this.isolate(thing.shape));
      row.append(select, hide, isolate);
      this.mark(row);
      return row;
    }
    mark(row) {
      const shape = Number(row.dataset["shape"]);
      const isHidden = this.isHidden(shape);
      row.classList.toggle("hidden-shape", isHidden);
      row.querySelector(".select")?.setAttribute("aria-pressed", String(shape === this.selected));
      const hide = row.querySelector(".hide");
      if (!hide) return;
      hide.textContent = isHidden ? "Show" : "Hide";
      hide.setAttribute("aria-pressed", String(isHidden));
      const { shapes, others } = this.hidden;
      const isAlone = others && shapes.length === 1 && shapes[0] === shape;
      row.querySelector(".isolate")?.setAttribute("aria-pressed", String(isAlone));
    }
  };

  // src/views.ts
  var OPPOSITE = { front: "back", back: "front", right: "left", left: "right", top: "bottom", bottom: "top" };
  var TILT = 2e-3;
  function sides(up) {
    const y = [0, 1, 0];
    const z = [0, 0, 1];
    const n = unit(up);
    const c = dot(y, n);
    const axis = cross(y, n);
    const front = c < -1 + 1e-9 ? [0, 0, -1] : add(add(scale(z, c), cross(axis, z)), scale(axis, dot(axis, z) / (1 + c)));
    return { front: unit(front), right: unit(cross(n, front)) };
  }
  var Views = class {
    constructor(page2, camera2) {
      this.page = page2;
      this.camera = camera2;
      for (const button of document.querySelectorAll("button[data-view]")) {
        button.addEventListener("click", () => this.show(button.dataset["view"]));
      }
      byId("keep-view").addEventListener("click", () => this.keep());
    }
    page;
    camera;
    kept = [];
    sceneName = "";
    /** The views that were kept of a scene. */
    open(name) {
      if (name === this.sceneName) return;
      this.sceneName = name;
      this.kept = JSON.parse(sessionStorage.getItem(this.key) ?? "[]");
      this.draw();
    }
    /** All of the scene from one of its sides. */
    show(side) {
      const { scene } = this.page;
      if (!scene?.bounds) return;
      const [low, high] = scene.bounds;
      const up = unit(this.camera.upwards);
      const { front, right } = sides(up);
      const above = unit(add(up, scale(front, TILT)));
      const below = unit(add(scale(up, -1), scale(front, TILT)));
      const from = { front, back: scale(front, -1), right, left: scale(right, -1), top: above, bottom: below };
      const target = scale(add(low, high), 0.5);
      const radius = 0.5 * length(sub(high, low)) || 1;
      const half2 = (this.camera.fov ?? 45) * Math.PI / 360;
      const eye = add(target, scale(from[side], 1.05 * radius / Math.sin(half2)));
      if (side === "bottom") this.camera.mayGoBelow = true;
      this.camera.place({ eye, target, up });
      this.page.moved();
    }
    /** From the other side. */
    turn() {
      const { eye, target, up } = this.camera.placement;
      this.camera.place({ eye: sub(scale(target, 2), eye), target, up });
      this.page.moved();
    }
    static opposite(side) {
      return OPPOSITE[side];
    }
    get key() {
      return `lumbre-views:${this.sceneName}`;
    }
    keep() {
      const input = byId("view-name");
      const { placement, fov, zoom } = this.camera;
      this.kept.push({ name: input.value.trim() || `View ${this.kept.length + 1}`, placement, fov, zoom });
      input.value = "";
      this.store();
    }
    store() {
      sessionStorage.setItem(this.key, JSON.stringify(this.kept));
      this.draw();
    }
    draw() {
      const rows = this.kept.map((view, i) => {
        const row = element("li");
        const show = element("button", view.name, { className: "select" });
        show.addEventListener("click", () => {
          [this.camera.fov, this.camera.zoom] = [view.fov, view.zoom];
          this.camera.place(view.placement);
          this.page.moved();
        });
        const drop = element("button", "Remove");
        drop.setAttribute("aria-label", `Remove ${view.name}`);
        drop.addEventListener("click", () => {
          this.kept.splice(i, 1);
          this.store();
        });
        row.append(show, drop);
        return row;
      });
      byId("kept-views").replaceChildren(...rows);
    }
  };

  // src/app.ts
  var App = class {
    /** `isStatic`: the page was exported, and there is no viewer. */
    constructor(isStatic) {
      this.isStatic = isStatic;
      const edit = (path, value) => this.page.send({ type: "edit", path, value });
      this.editor = new Editor(byId("parameters"), byId("filter"), edit);
      this.lights = new LightList(edit);
      this.handles = new LightHandles(this.page, edit);
      this.page.onCamera = () => {
        this.measure.moved();
        this.section.moved();
        this.handles.draw();
      };
    }
    isStatic;
    page = new Page();
    sheet = this.page.sheet;
    camera = this.page.camera;
    pixels = new PixelReader(this.page);
    explanation = new Explanation((errand) => this.page.ticket(errand));
    editor;
    lights;
    handles;
    tree = new SceneTree(this.page, (shape) => this.select(shape));
    views = new Views(this.page, this.camera);
    measure = new Measure(this.sheet);
    section = new Section(this.page);
    display = new Display(this.page);
    /** What was clicked last. */
    picked;
    /** The question whose answer the camera turns around from then on. */
    orbitOnPick = 0;
    /** A shape was clicked, in the picture or in the tree: it is marked everywhere. */
    select(shape) {
      this.picked = shape;
      this.tree.select(shape?.shape ?? -1);
      this.editor.mark(shape?.owner ?? null);
      const isShape = shape !== void 0 && shape.kind !== "ground";
      byId("picked-buttons").hidden = !isShape || this.isStatic || this.page.watches;
      byId("edit-picked").hidden = !shape?.owner;
      byId("light-picked").hidden = !shape?.shines;
    }
    /** A fault above the picture; an empty title takes it away. */
    alert(title, text) {
      byId("alert-title").textContent = title;
      byId("alert-text").textContent = text;
      byId("alert").hidden = title === "";
    }
  };

  // src/compare.ts
  function connectComparing({ sheet: sheet2, alert }) {
    const compare = (is) => {
      byId("split").disabled = !is;
      byId("forget").disabled = !is;
      sheet2.reference.hidden = !is;
      if (is) sheet2.split(Number(byId("split").value));
    };
    on("keep", "click", () => {
      sheet2.keep();
      compare(true);
    });
    on("forget", "click", () => compare(false));
    on("split", "input", ({ value }) => sheet2.split(Number(value)));
    on("reference-file", "change", async ({ files }) => {
      const file = files?.[0];
      if (!file) return;
      try {
        sheet2.keep(await createImageBitmap(file));
        compare(true);
      } catch {
        alert("This is no picture that a browser can show.", file.name);
      }
    });
  }

  // src/frame.ts
  var HEADER = 40;
  var MAGIC = 843928908;
  function decoded(packet) {
    const numbers2 = new Uint32Array(packet, 0, HEADER / 4);
    const [magic = 0, width = 0, height = 0, fullWidth = 0, fullHeight = 0, spp = 0, sequence = 0, flags = 0] = numbers2;
    if (magic !== MAGIC || packet.byteLength !== HEADER + 4 * width * height) throw new Error("no frame");
    const pixels = new ImageData(new Uint8ClampedArray(packet, HEADER), width, height);
    const [low = 0, high = 0] = new Float32Array(packet, 32, 2);
    const [isFull, isDone, isDenoised] = [1, 2, 4].map((bit) => (flags & bit) !== 0);
    return { width, height, fullWidth, fullHeight, spp, sequence, isFull, isDone, isDenoised, low, high, pixels };
  }

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
  function keyedHash(key, bytes2) {
    if (key.length !== 32 || bytes2.length > BLOCK) throw new Error("one block and a key of 32 bytes");
    const words = (of, count) => {
      const view = new DataView(Uint8Array.from({ length: 4 * count }, (_, i) => of[i] ?? 0).buffer);
      return Array.from({ length: count }, (_, i) => view.getUint32(4 * i, true));
    };
    const v = Uint32Array.from([...words(key, 8), ...IV.slice(0, 4), 0, 0, bytes2.length, FLAGS]);
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
    constructor(listener) {
      this.listener = listener;
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
      return new Promise((found, failed) => {
        this.waiting.set(request, (address) => address === null ? failed(new Error("no address")) : found(address));
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
          const hello = { type: "hello", nonce, proof: proof(known, "page", challenge, nonce) };
          socket.send(JSON.stringify(hello));
          return true;
        }
        if (message.type !== "welcome" || !challenge || message.proof !== proof(known, "viewer", challenge, nonce)) return false;
        if (message.session) sessionStorage.setItem(SECRET, message.session);
        [this.isIn, this.wait] = [true, 500];
        this.listener.onOpen(message.access);
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

  // src/controls.ts
  function connectControls(app2) {
    const { page: page2 } = app2;
    on("pause", "click", () => page2.set({ paused: !page2.state?.paused }));
    on("reset", "click", () => page2.reset(page2.state?.camera ?? 0));
    on("help-open", "click", () => byId("help").showModal());
    on("help-close", "click", () => byId("help").close());
    on("channel", "change", ({ value }) => page2.set({ channel: value }));
    on("exposure", "input", ({ value }) => page2.set({ exposure: Number(value) }));
    on("tone-map", "change", ({ value }) => page2.set({ tone_map: value }));
    on("false-colour", "change", ({ checked }) => page2.set({ false_colour: checked }));
    on("denoise", "change", ({ checked }) => page2.set({ denoise: checked }));
    on("scale", "change", ({ value }) => page2.set({ scale: Number(value) }));
    on("noise-target", "change", (input) => input.checkValidity() && page2.set({ noise: Number(input.value) }));
    on("spp", "change", (input) => input.checkValidity() && page2.set({ spp: Number(input.value) }));
    connectPicked(app2);
    connectCamera(app2);
    connectMoment(app2);
  }
  function connectPicked(app2) {
    const { editor, lights, tree } = app2;
    on("edit-picked", "click", () => app2.picked?.owner && editor.reveal(app2.picked.owner));
    on("light-picked", "click", () => lights.reveal(app2.picked?.owner ?? null));
    on("find-picked", "click", () => app2.picked && tree.reveal(app2.picked.shape));
    on("hide-picked", "click", () => app2.picked && tree.hide(app2.picked.shape));
    on("isolate-picked", "click", () => app2.picked && tree.isolate(app2.picked.shape));
  }
  function connectCamera({ page: page2, camera: camera2 }) {
    on("below-ground", "change", ({ checked }) => {
      camera2.mayGoBelow = checked;
    });
    on("camera", "change", ({ value }) => page2.reset(Number(value)));
    on("fov", "change", (input) => {
      if (!input.checkValidity()) return;
      camera2.fov = Number(input.value);
      page2.moved();
    });
  }
  function connectMoment({ page: page2 }) {
    const send = (changed) => page2.send({ type: "moment", time: page2.state?.time ?? null, variant: page2.state?.variant ?? null, ...changed });
    on("animation-time", "input", ({ value }) => send({ time: Number(value) }));
    on("variant", "change", ({ value }) => send({ variant: value || null }));
  }

  // src/drop.ts
  var MAX_BYTES = 256 * 2 ** 20;
  async function filesOf(entry) {
    const name = entry.fullPath.slice(1);
    if (entry.isFile) {
      const file = await new Promise((found, failed) => entry.file(found, failed));
      return [{ name, file }];
    }
    const reader = entry.createReader();
    const all = [];
    for (; ; ) {
      const some = await new Promise((found, failed) => reader.readEntries(found, failed));
      if (some.length === 0) return all;
      for (const inner of some) all.push(...await filesOf(inner));
    }
  }
  async function dropped(data2) {
    const entries = [...data2.items].map((item) => item.webkitGetAsEntry?.() ?? null);
    const plain = [...data2.files].map((file) => ({ name: file.name, file }));
    if (entries.length === 0 || entries.some((entry) => entry === null)) return plain;
    return (await Promise.all(entries.map((entry) => entry ? filesOf(entry) : []))).flat();
  }
  function bundled(files) {
    const entries = files.map(({ name, file }) => ({ name, size: file.size }));
    const list = new TextEncoder().encode(JSON.stringify(entries));
    const length2 = new DataView(new ArrayBuffer(4));
    length2.setUint32(0, list.length, true);
    return new Blob(["LUMF", length2, list, ...files.map(({ file }) => file)], { type: "application/octet-stream" });
  }
  var Drop = class {
    constructor(ticket, alert) {
      this.ticket = ticket;
      this.alert = alert;
      const stage = byId("stage");
      stage.addEventListener("dragover", (event) => {
        event.preventDefault();
        stage.classList.add("over");
      });
      stage.addEventListener("dragleave", () => stage.classList.remove("over"));
      stage.addEventListener("drop", (event) => {
        event.preventDefault();
        stage.classList.remove("over");
        if (event.dataTransfer) void dropped(event.dataTransfer).then((files) => this.send(files));
      });
      for (const input of document.querySelectorAll("input.opens")) {
        input.addEventListener("change", () => {
          const files = [...input.files ?? []].map((file) => ({ name: file.webkitRelativePath || file.name, file }));
          void this.send(files).then(() => input.value = "");
        });
      }
    }
    ticket;
    alert;
    async send(files) {
      if (files.length === 0) return;
      if (files.reduce((sum, { file }) => sum + file.size, 0) > MAX_BYTES) {
        this.alert("The files were not opened.", "They are more than 256 MiB: open them from the command line.");
        return;
      }
      try {
        const headers = { "Content-Type": "application/octet-stream" };
        const answer = await fetch(await this.ticket({ for: "scene" }), { method: "POST", headers, body: bundled(files) });
        if (!answer.ok) this.alert("The files were not opened.", await answer.text());
      } catch {
        this.alert("The files were not opened.", "The viewer does not answer.");
      }
    }
  };

  // src/hands.ts
  var STILL = 4;
  function attach(canvas, sheet2, camera2, handlers) {
    const pointers = /* @__PURE__ */ new Map();
    let travelled = 0;
    let wasPair = false;
    const spread = () => {
      const [a, b] = [...pointers.values()];
      return a && b ? Math.hypot(a.clientX - b.clientX, a.clientY - b.clientY) : 0;
    };
    canvas.addEventListener("pointerdown", (event) => {
      canvas.setPointerCapture(event.pointerId);
      canvas.focus();
      pointers.set(event.pointerId, event);
      if (pointers.size === 1) [travelled, wasPair] = [0, false];
      if (pointers.size > 1) wasPair = true;
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
      const pan = (share = 1) => {
        const span = camera2.fov === null ? 1 : 2 * Math.tan(camera2.fov * Math.PI / 360);
        camera2.move(-dx / height * span * share, dy / height * span * share, 0);
      };
      if (pointers.size >= 2) {
        if (wide > 0) camera2.dolly(wide / Math.max(1, spread()));
        pan(1 / pointers.size);
      } else if (wasPair) {
        return;
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
      if (was && pointers.size === 0 && travelled < STILL && !wasPair && event.type === "pointerup" && event.button === 0) {
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
      for (const key of held) {
        const [step, turn] = [FLY[key], TURN[key]];
        const by = seconds * 0.8 * fast;
        if (step) camera2.move(step[0] * by, step[1] * by, step[2] * by);
        if (turn) camera2.orbit(turn[0] * by, turn[1] * by);
        if (key === "pageup" || key === "pagedown") camera2.dolly(Math.exp(key === "pageup" ? -by : by));
        any ||= key !== "shift";
      }
      if (any) handlers.moved();
      requestAnimationFrame(fly);
    };
    canvas.addEventListener("keydown", (event) => {
      if (event.metaKey || event.altKey) return;
      if (event.ctrlKey) {
        if (handlers.key(event)) event.preventDefault();
        return;
      }
      const key = event.key.toLowerCase();
      if (key in FLY || key in TURN || key === "pageup" || key === "pagedown" || key === "shift") {
        event.preventDefault();
        if (held.size === 0) {
          last = performance.now() - 16;
          requestAnimationFrame(fly);
        }
        held.add(key);
      } else if (key === "enter") {
        handlers.pick(sheet2.width / 2, sheet2.height / 2, false);
      } else if (handlers.key(event)) {
        event.preventDefault();
      }
    });
    canvas.addEventListener("keyup", (event) => held.delete(event.key.toLowerCase()));
    canvas.addEventListener("blur", () => held.clear());
  }

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
  function showHits(panel, hits) {
    const first = hits[0];
    if (!first) {
      panel.replaceChildren(element("p", "Nothing is there.", { className: "quiet" }));
      return;
    }
    const { surface } = first;
    const rows = [
      ["Shape", called(first)],
      ["Material", first.material ?? "none"],
      ["Position", surface ? point(surface.point) : void 0],
      ["Normal", surface ? point(surface.normal) : void 0],
      ["Distance", short(first.distance)],
      ["uv", surface ? point(surface.uv) : void 0],
      ["Triangle", surface && first.kind === "mesh" ? String(surface.primitive) : void 0],
      ["Instance", surface ? String(surface.instance ?? "none") : void 0],
      ["Side", surface ? surface.front ? "outside" : "inside" : void 0]
    ];
    const table = element("table");
    for (const [name, text] of rows) {
      if (text === void 0) continue;
      const row = element("tr");
      row.append(element("th", name, { scope: "row" }), element("td", text));
      table.append(row);
    }
    panel.replaceChildren(table);
    if (!surface) return;
    const all = element("details");
    all.append(element("summary", `All ${hits.length} hits of this ray`));
    const list = element("ol");
    for (const hit of hits) {
      list.append(element("li", `${short(hit.distance)}: shape ${called(hit)}, ${hit.material ?? "no material"}, ${hit.surface?.front ? "in" : "out"}`));
    }
    all.append(list);
    panel.append(all);
  }

  // src/progress.ts
  var DOING = {
    reading: "Reading the scene",
    building: "Building the scene",
    rendering: "",
    done: "",
    waiting: "Waiting for the file to be mended",
    nothing: "No scene"
  };
  function reached({ spp, target, noise, noise_target }) {
    if (!target) return ["done"];
    if (noise_target) {
      const now = noise === null ? [] : [`noise ${noise.toFixed(4)} of ${noise_target}`];
      return [`${spp ?? 0} samples`, ...now];
    }
    return [`${spp ?? 0} of ${target} samples`, ...noise !== null && (spp ?? 0) > 1 ? [`noise ${noise.toFixed(4)}`] : []];
  }
  function showProgress(progress) {
    const { doing } = progress;
    const share = progress.share ?? (doing === "done" ? 1 : 0);
    let text = DOING[doing];
    if (doing === "rendering" || doing === "done") {
      const parts = reached(progress);
      if (doing === "rendering" && share > 0) parts.push(`${Math.floor(100 * share)} %`);
      if (doing === "rendering" && progress.left !== null) parts.push(`${spoken(progress.left)} left`);
      if (doing === "done" && progress.seconds) parts.push(`done in ${spoken(progress.seconds)}`);
      if (progress.rays_per_second) parts.push(`${large(progress.rays_per_second)} rays/s`);
      if (progress.dropped) parts.push(`${progress.dropped} samples dropped`);
      text = parts.join(" \xB7 ");
    }
    byId("progress").textContent = text;
    byId("bar").value = progress.target || doing === "done" ? share : 0;
  }

  // src/state.ts
  function fill(id, text) {
    const input = byId(id);
    if (document.activeElement !== input) input.value = text;
  }
  function showState(app2, state) {
    const { page: page2 } = app2;
    showName(app2, state);
    const error = byId("edit-error");
    error.textContent = state.edit_error ?? "";
    error.hidden = !state.edit_error;
    showPicture(state);
    app2.editor.take(state.settings);
    app2.lights.take(state.settings);
    app2.tree.take(state.hidden);
    app2.display.take(state);
    app2.section.take(state);
    app2.views.open(state.name);
    byId("save-overlay").disabled = state.settings.length === 0;
    byId("drop-edits").disabled = state.settings.length === 0;
    if (!page2.scene) return;
    showCamera(app2, state, page2.scene);
    app2.handles.take(state.settings);
    showMoment(state, page2.scene);
  }
  function showName({ page: page2, alert }, state) {
    document.title = state.name ? `${state.name} \u2013 Lumbre` : "Lumbre";
    byId("name").textContent = state.name || "Lumbre";
    const title = state.has_scene ? "The file has an error; this is the last good picture." : "The file has an error.";
    if (page2.connected) alert(state.error ? title : "", state.error ?? "");
    byId("empty").hidden = state.name !== "";
    byId("sheet").hidden = state.name === "";
  }
  function showPicture(state) {
    byId("pause").setAttribute("aria-pressed", String(state.paused));
    byId("channel").value = state.channel;
    byId("tone-map").value = state.tone_map ?? "none";
    byId("scale").value = String(state.scale);
    const exposure = state.exposure ?? 0;
    fill("exposure", String(exposure));
    byId("exposure-value").textContent = exposure.toFixed(1);
    fill("spp", String(state.spp ?? 64));
    fill("noise-target", state.noise ? String(state.noise) : "");
    byId("false-colour").checked = state.false_colour;
    byId("denoise").checked = state.denoise ?? false;
  }
  function showCamera({ page: page2, camera: camera2 }, state, scene) {
    options(byId("camera"), scene.cameras.map(({ name }, i) => [String(i), name]), String(state.camera));
    page2.takeCamera(state, scene);
    byId("ground-details").hidden = scene.ground === null;
    byId("below-ground").checked = camera2.mayGoBelow;
    byId("fov").disabled = camera2.fov === null;
    fill("fov", camera2.fov === null ? "" : short(camera2.fov));
  }
  function showMoment(state, scene) {
    const end = Math.max(0, ...scene.animations.map((animation) => animation.end ?? 0));
    for (const part of document.querySelectorAll(".animated")) part.hidden = end === 0;
    byId("animation-time").max = String(end);
    const time = state.time ?? 0;
    fill("animation-time", String(time));
    byId("time-value").textContent = `${time.toFixed(2)} s`;
    for (const part of document.querySelectorAll(".varied")) part.hidden = scene.variants.length === 0;
    const variants = [["", "as in the file"], ...scene.variants.map((name) => [name, name])];
    options(byId("variant"), variants, state.variant ?? "");
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
    constructor(listener, data2) {
      this.listener = listener;
      this.data = data2;
      setTimeout(() => void this.start());
    }
    listener;
    data;
    shown;
    values;
    picks;
    async start() {
      this.listener.onOpen("edit");
      this.listener.onMessage({ type: "scene", scene: this.data.scene });
      const unknown = { share: null, noise_target: null, left: null, dropped: null };
      this.listener.onMessage({ type: "progress", doing: "done", ...unknown, ...this.data.progress });
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
        spp: this.data.progress.spp,
        noise: null,
        denoise: null,
        paused: false,
        exposure: 0,
        tone_map: null,
        false_colour: false,
        map: "automatic",
        range: null,
        hidden: { shapes: [], others: false },
        section: null,
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
      const spp = this.data.progress.spp;
      this.listener.onFrame({ width, height, fullWidth: width, fullHeight: height, spp, sequence: 0, isFull: true, isDone: true, isDenoised: false, low: 0, high: 0, pixels });
    }
    pick(x, y, request) {
      if (!this.picks || !this.shown) return;
      const at = 8 * (y * this.shown.width + x);
      const shape = this.data.picks.shapes[this.picks.getUint32(at, true) - 1];
      const hits = shape ? [{ ...shape, distance: this.picks.getFloat32(at + 4, true), surface: null }] : [];
      this.listener.onMessage({ type: "picked", request, x, y, ray: { origin: null, direction: null, hits } });
    }
    /** No viewer gives an address. */
    ticket() {
      return Promise.reject(new Error("at rest"));
    }
    send(message) {
      if (message.type === "set" && message.channel) void this.show(message.channel);
      if (message.type === "pick") this.pick(Math.floor(message.x), Math.floor(message.y), message.request);
      if (message.type === "values") this.read(message);
    }
    read({ x, y, width, height, request }) {
      if (!this.shown) return;
      const whole = this.shown.width;
      const [columns, rows] = [Math.min(width, whole - x), Math.min(height, this.shown.height - y)];
      const values = [];
      for (let row = y; row < y + rows; row++) {
        for (let column = x; column < x + columns; column++) {
          const pixel = row * whole + column;
          const value = (c) => this.values ? half(this.values.getUint16(2 * (3 * pixel + c), true)) : +((this.shown?.data[4 * pixel + c] ?? 0) / 255).toFixed(3);
          values.push([value(0), value(1), value(2)]);
        }
      }
      this.listener.onMessage({ type: "values", request, x, y, width: columns, height: rows, values });
    }
  };
  var CHANGES = [
    "pause",
    "reset",
    "exposure",
    "tone-map",
    "false-colour",
    "map",
    "range-low",
    "range-high",
    "range-found",
    "denoise",
    "spp",
    "noise-target",
    "scale",
    "edit-details",
    "camera-details",
    "tree-details",
    "light-details",
    "section-details",
    "open-more"
  ];
  var ASKS = ["save-details", "help-open", "measure-details"];
  function hideWhatNeedsAViewer(watches = false) {
    for (const id of watches ? [...CHANGES, "channel"] : [...CHANGES, ...ASKS]) {
      byId(id).classList.add("gone");
      for (const label of document.querySelectorAll(`label[for="${id}"]`)) label.classList.add("gone");
    }
    if (watches) return;
    for (const option of document.querySelectorAll("option[value=ids], option[value=variance]")) option.remove();
  }

  // src/inbox.ts
  var Inbox = class {
    constructor(app2) {
      this.app = app2;
    }
    app;
    onFrame(frame) {
      const { page: page2, display, pixels } = this.app;
      page2.show(display.shown(frame));
      display.draw();
      if (frame.isFull) pixels.refresh();
    }
    onMessage(message) {
      const { page: page2, pixels } = this.app;
      switch (message.type) {
        case "scene":
          this.onScene(message.scene);
          break;
        case "state":
          page2.state = message;
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
          break;
        case "wrong":
          byId("edit-error").textContent = message.what;
          byId("edit-error").hidden = false;
          break;
      }
    }
    onScene(scene) {
      const { page: page2, editor, lights, handles, tree, explanation } = this.app;
      page2.scene = scene;
      showFacts(byId("facts"), byId("warnings"), scene);
      editor.list(scene.parameters);
      lights.list(scene.parameters);
      handles.show(scene.parameters);
      tree.list(scene);
      explanation.offer(scene.languages);
      if (page2.state) showState(this.app, page2.state);
    }
    onPicked({ request, x, y, ray }) {
      const { app: app2 } = this;
      const first = ray.hits[0];
      showHits(byId("picked"), ray.hits);
      app2.select(first);
      app2.measure.take(x, y, first);
      app2.explanation.of(Math.floor(x), Math.floor(y));
      if (request === app2.orbitOnPick && first?.surface) {
        app2.camera.lookAt(first.surface.point);
        app2.page.moved();
      }
    }
    onOpen(access) {
      const { page: page2 } = this.app;
      page2.connected = true;
      page2.watches = access === "watch";
      byId("watching").hidden = !page2.watches;
      if (page2.watches) hideWhatNeedsAViewer(true);
      this.app.alert("", "");
    }
    onStatus(how) {
      const { app: app2 } = this;
      app2.page.connected = false;
      if (how === "gone") app2.alert("The viewer does not answer.", "It has ended, or the tunnel to it has. This page goes on when it is back.");
      if (how === "refused") app2.alert("The viewer does not know this page.", "Open the address that lumbre view printed. It works once, in one tab: to have another one, start the viewer again.");
      if (how === "foreign") app2.alert("Another program answers in place of the viewer.", "It cannot prove to be the viewer, and was told nothing.");
      byId("progress").textContent = "Not connected";
    }
  };

  // src/keys.ts
  var CHANNELS = ["beauty", "albedo", "normal", "depth", "uv", "variance", "ids"];
  var VIEWS = { 1: "front", 3: "right", 7: "top" };
  var EXPOSURE_STEP = 0.5;
  var ZOOM_STEP = 1.5;
  function pressKey(app2, event) {
    const { page: page2, sheet: sheet2, views, tree, picked } = app2;
    const pressed = event.key.toLowerCase();
    const digit = /^(?:Digit|Numpad)([0-9])$/.exec(event.code)?.[1] ?? pressed;
    const channel = event.shiftKey ? CHANNELS[Number(digit) - 1] : void 0;
    const view = VIEWS[digit];
    const exposure = page2.state?.exposure ?? 0;
    if (channel) page2.set({ channel });
    else if (view) views.show(event.ctrlKey ? Views.opposite(view) : view);
    else if (event.ctrlKey) return false;
    else if (digit === "9") views.turn();
    else if (pressed === "r") page2.reset(page2.state?.camera ?? 0);
    else if (pressed === "x") app2.explanation.show();
    else if (pressed === "m") app2.measure.toggle();
    else if (pressed === "h" && picked) tree.hide(picked.shape);
    else if (pressed === "i" && picked) tree.isolate(picked.shape);
    else if (pressed === "p") page2.set({ paused: !page2.state?.paused });
    else if (digit === "0") sheet2.zoomOut();
    else if (pressed === "+" || pressed === "=") sheet2.zoomBy(ZOOM_STEP);
    else if (pressed === "-") sheet2.zoomBy(1 / ZOOM_STEP);
    else if (pressed === "[") page2.set({ exposure: exposure - EXPOSURE_STEP });
    else if (pressed === "]") page2.set({ exposure: exposure + EXPOSURE_STEP });
    else if (pressed === "?") byId("help").showModal();
    else return false;
    return true;
  }

  // src/saving.ts
  var stem = (name) => (name || "picture").replace(/\.(pbrt|pov|gltf|glb|obj|ply|stl)(\.gz)?$/i, "");
  function connectSaving(app2) {
    const { page: page2, sheet: sheet2, camera: camera2, editor } = app2;
    const name = () => page2.state?.name ?? "";
    on("save-overlay", "click", () => save(`${page2.state?.name ?? "scene"}.overlay.txt`, editor.overlay()));
    on("drop-edits", "click", () => editor.dropAll());
    on("snapshot", "click", async () => {
      const picture = await sheet2.snapshot();
      if (picture) saveBlob(`${stem(name())}.png`, picture);
    });
    const savePicture = async (format) => {
      try {
        const href = await page2.ticket({ for: "picture", format });
        element("a", "", { href, download: `${stem(name())}.${format}` }).click();
      } catch {
        app2.alert("The picture was not saved.", "The viewer does not answer.");
      }
    };
    on("save-png", "click", () => void savePicture("png"));
    on("save-exr", "click", () => void savePicture("exr"));
    on("copy-pbrt", "click", () => copy(camera2.toPbrt()));
    on("copy-gltf", "click", () => copy(camera2.toGltf(sheet2.width / sheet2.height)));
  }
  function copy(text) {
    const shown = byId("copied");
    [shown.hidden, shown.value] = [false, text];
    shown.select();
    navigator.clipboard?.writeText(text).catch(() => {
    });
  }

  // src/main.ts
  var data = globalThis.lumbreAtRest;
  var app = new App(data !== void 0);
  var { page, sheet, camera } = app;
  var inbox = new Inbox(app);
  page.connection = data ? new StaticConnection(inbox, data) : new Connection(inbox);
  attach(sheet.picture, sheet, camera, {
    moved: () => page.moved(),
    key: (event) => pressKey(app, event),
    pick(x, y, turns) {
      const request = page.ask({ type: "pick", x, y });
      if (turns) app.orbitOnPick = request;
    },
    hover: (at) => app.pixels.hover(at)
  });
  connectControls(app);
  connectSaving(app);
  connectComparing(app);
  if (data) hideWhatNeedsAViewer();
  else new Drop((errand) => page.ticket(errand), app.alert);
})();
