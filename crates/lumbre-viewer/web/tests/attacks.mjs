// What outsiders try: a page on another port of the same host, a program that takes the viewer's port, and files that are dropped.
import assert from "node:assert/strict";
import { createHash } from "node:crypto";
import { createServer } from "node:http";
import { rmSync, writeFileSync } from "node:fs";
import { join } from "node:path";
import { PNG } from "pngjs";

/** A server of another user: what it answers, and all that it hears. */
async function stranger(answer, port = 0) {
  const heard = [];
  const sockets = new Set();
  const server = createServer((request, response) => {
    heard.push(JSON.stringify([request.url, request.headers]));
    response.setHeader("Content-Type", "text/html");
    response.end(answer);
  });
  server.on("connection", (socket) => {
    sockets.add(socket);
    socket.on("data", (bytes) => heard.push(bytes.toString("latin1")));
  });
  await new Promise((done) => server.listen(port, "127.0.0.1", done));
  const stop = () => new Promise((done) => {
    server.close(done);
    for (const socket of sockets) socket.destroy();
  });
  return { server, heard, origin: `http://127.0.0.1:${server.address().port}`, stop };
}

/** Runs in a page of another origin: what it got of each thing that it tried. */
async function outsiderTries(viewer) {
  const got = {};
  const within = (promise) => Promise.race([promise, new Promise((done) => setTimeout(() => done("nothing"), 3000))]);
  const attempt = async (name, act) => {
    try {
      got[name] = await within(act());
    } catch (error) {
      got[name] = "refused";
    }
  };
  const text = async (answer) => (answer.type === "opaque" ? "opaque" : answer.text());
  for (const path of ["/", "/viewer.js", "/socket", "/picture.png", "/picture.exr", "/scene", "/ticket/", `/ticket/${"0".repeat(64)}`]) {
    for (const mode of ["cors", "no-cors"]) {
      await attempt(`GET ${path} ${mode}`, async () => text(await fetch(viewer + path, { credentials: "include", mode })));
      await attempt(`POST ${path} ${mode}`, async () => text(await fetch(viewer + path, { method: "POST", body: "glTF", credentials: "include", mode })));
    }
  }
  const socket = (address, protocols) => new Promise((done) => {
    const made = new WebSocket(address, protocols);
    made.onmessage = ({ data }) => done(String(data));
    made.onclose = () => done("refused");
  });
  const host = viewer.slice("http://".length);
  await attempt("socket", () => socket(`ws://${host}/socket`));
  await attempt("socket with a protocol", () => socket(`ws://${host}/socket`, ["lumbre"]));
  const loads = (kind, properties) => new Promise((done) => {
    const made = Object.assign(document.createElement(kind), properties);
    made.onload = () => done("loaded");
    made.onerror = () => done("refused");
    document.body.append(made);
  });
  await attempt("its script", () => loads("script", { src: `${viewer}/viewer.js` }));
  await attempt("its icon", () => loads("img", { src: `${viewer}/icon.svg` }));
  await attempt("its styles", () => loads("link", { rel: "stylesheet", href: `${viewer}/viewer.css` }));
  await attempt("a frame of it", async () => {
    const frame = document.createElement("iframe");
    frame.src = viewer;
    document.body.append(frame);
    await new Promise((done) => (frame.onload = done));
    return frame.contentWindow.sessionStorage.getItem("lumbre-session") ?? "none";
  });
  await attempt("a window of it", async () => {
    const opened = window.open(viewer);
    await new Promise((done) => setTimeout(done, 1500));
    return opened.sessionStorage.getItem("lumbre-session") ?? "none";
  });
  await attempt("a form", async () => {
    const form = Object.assign(document.createElement("form"), { method: "POST", action: `${viewer}/scene`, target: "nowhere" });
    document.body.append(Object.assign(document.createElement("iframe"), { name: "nowhere" }), form);
    form.submit();
    await new Promise((done) => setTimeout(done, 500));
    return frames.nowhere.document.body.textContent;
  });
  await attempt("its own storage", async () => JSON.stringify([document.cookie, { ...localStorage }, { ...sessionStorage }]));
  return got;
}

/** A packet of a socket that a stranger pretends to serve. */
function packet(message) {
  const bytes = Buffer.from(JSON.stringify(message));
  return Buffer.concat([Buffer.from(bytes.length < 126 ? [0x81, bytes.length] : [0x81, 126, bytes.length >> 8, bytes.length & 255]), bytes]);
}

/** A binary glTF of a square, whose points or whose texture are in a file. */
function naming(uri, what) {
  const square = Buffer.from(new Float32Array([-1, -1, 0, 1, -1, 0, 1, 1, 0, -1, 1, 0, 0, 1, 1, 1, 1, 0, 0, 0]).buffer);
  const isBuffer = what === "buffer";
  const json = {
    asset: { version: "2.0" },
    scene: 0,
    scenes: [{ nodes: [0] }],
    nodes: [{ mesh: 0 }],
    meshes: [{ primitives: [{ mode: 6, attributes: { POSITION: 0, TEXCOORD_0: 1 }, material: 0 }] }],
    materials: [{ extensions: { KHR_materials_unlit: {} }, pbrMetallicRoughness: isBuffer ? {} : { baseColorTexture: { index: 0 } } }],
    extensionsUsed: ["KHR_materials_unlit"],
    ...(isBuffer ? {} : { textures: [{ source: 0 }], images: [{ uri }] }),
    buffers: [{ byteLength: square.length, ...(isBuffer ? { uri } : {}) }],
    bufferViews: [{ buffer: 0, byteOffset: 0, byteLength: 48 }, { buffer: 0, byteOffset: 48, byteLength: 32 }],
    accessors: [
      { bufferView: 0, componentType: 5126, count: 4, type: "VEC3", min: [-1, -1, 0], max: [1, 1, 0] },
      { bufferView: 1, componentType: 5126, count: 4, type: "VEC2" },
    ],
  };
  const chunk = (type, content, fill) => {
    const padded = Buffer.concat([content, Buffer.alloc(-content.length & 3, fill)]);
    const head = Buffer.alloc(8);
    head.writeUInt32LE(padded.length, 0);
    head.write(type, 4, "latin1");
    return Buffer.concat([head, padded]);
  };
  const chunks = [chunk("JSON", Buffer.from(JSON.stringify(json)), " "), ...(isBuffer ? [] : [chunk("BIN\0", square, 0)])];
  const head = Buffer.alloc(12);
  head.write("glTF", 0);
  head.writeUInt32LE(2, 4);
  head.writeUInt32LE(12 + chunks.reduce((sum, { length }) => sum + length, 0), 8);
  return Buffer.concat([head, ...chunks]);
}

export const attacks = ({ view, open, done, pixels, freePort, folder }) => ({
  async "a page on another port of the same host gets nothing"() {
    const viewer = await view(join(folder, "scene.pbrt"));
    const page = await open(viewer.url);
    await done(page);
    const before = await pixels(page);
    const secret = await page.evaluate(() => sessionStorage.getItem("lumbre-session"));
    assert.match(secret, /^[0-9a-f]{64}$/);
    assert.deepEqual(await page.context().cookies(), [], "there is no cookie that other ports would get");
    const other = await stranger("<!doctype html><title>outsider</title><body>");
    const outsider = await page.context().newPage();
    await outsider.goto(other.origin);
    const { origin } = new URL(viewer.url);
    const got = await outsider.evaluate(outsiderTries, origin);
    assert.ok(Object.keys(got).length > 40, JSON.stringify(got));
    const nothing = new Set(["refused", "nothing", "opaque"]);
    for (const [name, what] of Object.entries(got)) {
      if (name === "its own storage") assert.equal(what, JSON.stringify(["", {}, {}]));
      else assert.ok(nothing.has(what), `${name}: ${what}`);
    }
    assert.ok(other.heard.length > 0 && !other.heard.some((text) => text.includes(secret) || /\bcookie:|authorization:/i.test(text)), other.heard.join("\n"));
    // The other port of the same host by its other name, and the page that is open has noticed nothing.
    await outsider.goto(other.origin.replace("127.0.0.1", "localhost")).catch(() => {});
    assert.equal(await page.isVisible("#alert"), false);
    assert.deepEqual(await pixels(page), before);
    await other.stop();
    await viewer.stop();
  },

  async "a program that takes the port of a viewer that has ended learns nothing from its page"() {
    const port = String(await freePort());
    let viewer = await view("--port", port, join(folder, "scene.pbrt"));
    const page = await open(viewer.url);
    await done(page);
    const secret = await page.evaluate(() => sessionStorage.getItem("lumbre-session"));
    await viewer.stop();
    const impostor = await stranger("<!doctype html>", Number(port));
    let count = 0;
    impostor.server.on("upgrade", (request, socket) => {
      impostor.heard.push(JSON.stringify([request.url, request.headers]));
      count += 1;
      const accept = createHash("sha1").update(`${request.headers["sec-websocket-key"]}258EAFA5-E914-47DA-95CA-C5AB0DC85B11`).digest("base64");
      socket.write(`HTTP/1.1 101 Switching Protocols\r\nUpgrade: websocket\r\nConnection: Upgrade\r\nSec-WebSocket-Accept: ${accept}\r\n\r\n`);
      // It asks as the viewer does, and then pretends: by what it has heard, by nothing, or by no greeting at all.
      socket.write(packet({ type: "challenge", nonce: "00".repeat(32) }));
      const pretences = [
        { type: "welcome", proof: "00".repeat(32), session: null },
        { type: "state", name: "impostor" },
        { type: "challenge", nonce: "11".repeat(32) },
      ];
      socket.once("data", () => socket.write(packet(pretences[count % pretences.length])));
      socket.on("error", () => {});
    });
    await page.waitForFunction(() => /Another program answers/.test(document.getElementById("alert").textContent));
    while (count < 4) await page.waitForTimeout(100);
    assert.notEqual(await page.textContent("#name"), "impostor");
    // What it was sent: a proof each time, masked; and nothing that has the secret, as text or unmasked.
    const said = [];
    for (const text of impostor.heard) {
      const bytes = Buffer.from(text, "latin1");
      assert.ok(!text.includes(secret), text);
      if (bytes[0] !== 0x81) continue;
      const long = (bytes[1] & 127) === 126;
      const [length, at] = long ? [bytes.readUInt16BE(2), 4] : [bytes[1] & 127, 2];
      said.push(Buffer.from(bytes.subarray(at + 4, at + 4 + length).map((byte, i) => byte ^ bytes[at + (i & 3)])).toString());
    }
    assert.ok(said.length >= 4, JSON.stringify(impostor.heard));
    for (const text of said) {
      const { type, nonce, proof, ...more } = JSON.parse(text);
      assert.deepEqual([type, nonce.length, proof.length, more], ["hello", 64, 64, {}]);
      assert.ok(!text.includes(secret));
    }
    await impostor.stop();
    viewer = await view("--port", port, join(folder, "scene.pbrt"));
    await page.waitForFunction(() => document.getElementById("alert").hidden);
    await done(page);
    await viewer.stop();
  },

  async "a file that is dropped reads no other file"() {
    // Beside the scene, in the folder above, and by their whole names: a secret text, and a picture of one colour.
    const secret = "root:x:0:0:the secret of this test:/root:/bin/sh\n".repeat(20);
    const image = new PNG({ width: 2, height: 2 });
    image.data.set(new Array(4).fill([255, 0, 255, 255]).flat());
    const [text, picture] = [join(folder, "secret.txt"), join(folder, "secret.png")];
    writeFileSync(text, secret);
    writeFileSync(picture, PNG.sync.write(image));
    const viewer = await view("--size", "64x48", "--spp", "2", "--background", "black", join(folder, "scene.pbrt"));
    const page = await open(viewer.url);
    await done(page);
    const before = await pixels(page);
    const encoded = (path) => path.replaceAll("/", "%2F").replaceAll(".", "%2e");
    const ways = (path) => {
      const up = `${"../".repeat(12)}${path.slice(1)}`;
      return [path, up, `file://${path}`, `file:${path}`, `FILE://${path}`, encoded(path), up.replaceAll("..", "%2e%2e"), encoded(up), `./${up}`, `/proc/self/root${path}`];
    };
    const drop = (bytes) => page.setInputFiles("#open", { name: "a.glb", mimeType: "model/gltf-binary", buffer: bytes });
    let count = 0;
    for (const uri of [...ways(text), ...ways("/etc/passwd"), ...ways(join(folder, "not-there")), "scene.pbrt", "/dev/zero", "/proc/self/environ"]) {
      await drop(naming(uri, "buffer"));
      // Each is in a folder of its own, by its number.
      await page.waitForFunction((wanted) => document.getElementById("alert-text").textContent.includes(wanted), `/${count}/a.glb`, { timeout: 20_000 });
      const told = await page.textContent("#alert");
      // Its folder is its own, and has nothing but what was dropped.
      const refused = uri === "scene.pbrt" ? /\/\d+\/scene\.pbrt: cannot open/ : /the scene may use no files but its own/;
      assert.match(told, refused, `${uri}: ${told}`);
      assert.ok(!told.includes("root:x"), told);
      assert.deepEqual(await pixels(page), before, "the last good picture stays");
      count += 1;
    }
    assert.ok(count > 30);
    for (const uri of [...ways(picture), ...ways(join(folder, "not-there.png"))]) {
      await page.evaluate(() => document.getElementById("warnings").replaceChildren());
      await drop(naming(uri, "image"));
      await page.waitForFunction(() => /no files but its own/.test(document.getElementById("warnings").textContent), undefined, { timeout: 20_000 });
      await done(page);
      const [width, height, ...shown] = await pixels(page);
      assert.deepEqual([width, height], [64, 48]);
      for (let i = 0; i < shown.length; i += 4) {
        assert.ok(!(shown[i] > 200 && shown[i + 1] < 50 && shown[i + 2] > 200), `${uri}: the colour of the secret picture`);
      }
    }
    rmSync(text);
    rmSync(picture);
    await viewer.stop();
  },

  async "a scene of any format that is dropped reads nothing outside its folder, and does not learn what is there"() {
    const secret = join(folder, "outside-a.txt");
    writeFileSync(secret, "400 0.5 700 0.5\n".repeat(3));
    const scene = (rest) => `LookAt 0 -7 3  0 0 0  0 0 1 Camera "perspective" WorldBegin LightSource "infinite" ${rest} Shape "sphere"`;
    // Each names a file: by its whole name, or by a way out of the folder.
    const ways = {
      "include.pbrt": (uri) => scene(`Include "${uri}"`),
      "mesh.pbrt": (uri) => scene(`Shape "plymesh" "string filename" "${uri}"`),
      "image.pbrt": (uri) => scene(`Texture "t" "spectrum" "imagemap" "string filename" "${uri}" Material "diffuse" "texture reflectance" "t"`),
      "spectrum.pbrt": (uri) => scene(`Material "diffuse" "spectrum reflectance" "${uri}"`),
      "sky.pbrt": (uri) => scene(`LightSource "infinite" "string filename" "${uri}"`),
      "library.obj": (uri) => `mtllib ${uri}\nv 0 0 0\nv 1 0 0\nv 0 1 0\nusemtl a\nf 1 2 3\n`,
      "buffer.gltf": (uri) => JSON.stringify({
        asset: { version: "2.0" }, scene: 0, scenes: [{ nodes: [0] }], nodes: [{ mesh: 0 }],
        meshes: [{ primitives: [{ attributes: { POSITION: 0 } }] }], buffers: [{ byteLength: 36, uri }], bufferViews: [{ buffer: 0, byteLength: 36 }],
        accessors: [{ bufferView: 0, componentType: 5126, count: 3, type: "VEC3", min: [0, 0, 0], max: [1, 1, 1] }],
      }),
      "include.pov": (uri) => `#include "${uri}"\nsphere { 0, 1 }\n`,
      "image.pov": (uri) => `sphere { 0, 1 pigment { image_map { png "${uri}" } } }\n`,
    };
    const viewer = await view("--size", "32x24", "--spp", "1");
    const page = await open(viewer.url);
    await page.waitForSelector("#empty:not([hidden])");
    const said = async (name, text) => {
      await page.evaluate(() => {
        document.getElementById("progress").textContent = "";
        document.getElementById("warnings").replaceChildren();
      });
      await page.setInputFiles("#open", { name, mimeType: "text/plain", buffer: Buffer.from(text) });
      await page.waitForFunction((wanted) => document.getElementById("name").textContent === wanted && /Waiting|done in/.test(document.getElementById("progress").textContent), name);
      return page.evaluate(() => ["alert", "warnings"].map((id) => document.getElementById(id)).map((part) => (part.hidden ? "" : part.textContent)).join("\n"));
    };
    const up = (path) => `${"../".repeat(12)}${path.slice(1)}`;
    const tried = [];
    for (const [name, text] of Object.entries(ways)) {
      for (const way of [(path) => path, up]) {
        const told = [];
        for (const file of [secret, join(folder, "outside-b.txt")]) {
          told.push((await said(name, text(way(file)))).replaceAll(file.slice(1), "FILE").replaceAll(/dropped-?\w*|\/\d+\//g, "/N/"));
        }
        assert.equal(told[0], told[1], `${name}: whether there is such a file`);
        assert.ok(!told[0].includes("0.5"), told[0]);
        tried.push(`${name}: ${told[0]}`);
      }
    }
    assert.equal(tried.length, 18);
    assert.ok(tried.filter((text) => /no files but its own|unknown|cannot|not found|no such/i.test(text)).length >= 14, tried.join("\n\n"));
    rmSync(secret);
    await viewer.stop();
  },
});
