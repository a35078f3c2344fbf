// What many clients take of a viewer's processor time while it renders: node tests/crowd.mjs SCENE CLIENTS SECONDS
import { spawn } from "node:child_process";
import { readFileSync } from "node:fs";
import { randomBytes } from "node:crypto";
import { connect } from "node:net";
import { dirname, join } from "node:path";
import { fileURLToPath } from "node:url";
import { proof } from "./proofs.mjs";

const root = join(dirname(fileURLToPath(import.meta.url)), "../../../..");
const program = process.env.LUMBRE ?? join(root, "target/release/lumbre");
const [scene, clients = "100", seconds = "30"] = process.argv.slice(2);
const words = ["view", "--no-open", "--size", "1280x720", "--spp", "100000", scene];
const child = spawn(program, words, { stdio: ["ignore", "pipe", "inherit"] });
const url = new URL(await new Promise((done) => child.stdout.once("data", (bytes) => done(String(bytes).trim()))));
// The token of the address, and then the session that it becomes.
let secret = url.hash.slice(1);

let frames = 0;
/** A frame of text, masked by zeros. */
function packet(message) {
  const bytes = Buffer.from(JSON.stringify(message));
  const long = bytes.length < 126 ? [0x80 | bytes.length] : [0xfe, bytes.length >> 8, bytes.length & 255];
  return Buffer.concat([Buffer.from([0x81, ...long, 0, 0, 0, 0]), bytes]);
}
/** Is let in, reads frames, and says of each picture that it was shown. */
function client(isIn) {
  const socket = connect(Number(url.port), url.hostname);
  socket.write(`GET /socket HTTP/1.1\r\nHost: ${url.host}\r\nOrigin: http://${url.host}\r\nConnection: Upgrade\r\n`
    + "Upgrade: websocket\r\nSec-WebSocket-Version: 13\r\nSec-WebSocket-Key: dGhlIHNhbXBsZSBub25jZQ==\r\n\r\n");
  const answer = packet({ type: "shown" });
  const nonce = randomBytes(32).toString("hex");
  let greetings = 2;
  let [head, skip, isOpen] = [Buffer.alloc(0), 0, false];
  socket.on("data", (bytes) => {
    for (;;) {
      const passed = Math.min(skip, bytes.length);
      [skip, bytes] = [skip - passed, bytes.subarray(passed)];
      head = Buffer.concat([head, bytes.subarray(0, 400)]);
      const rest = bytes.subarray(400);
      if (skip > 0 || head.length < 2) return;
      if (!isOpen) {
        const end = head.indexOf("\r\n\r\n");
        if (end < 0) {
          if (rest.length === 0) return;
          bytes = rest;
          continue;
        }
        isOpen = true;
        bytes = Buffer.concat([head.subarray(end + 4), rest]);
        head = Buffer.alloc(0);
        continue;
      }
      let [length, from] = [head[1] & 127, 2];
      if (length === 126) [length, from] = [head.length < 4 ? -1 : head.readUInt16BE(2), 4];
      if (length === 127) [length, from] = [head.length < 10 ? -1 : Number(head.readBigUInt64BE(2)), 10];
      if (length < 0 || head.length < from) {
        if (rest.length === 0) return;
        bytes = rest;
        continue;
      }
      if (greetings > 0) {
        // Both are shorter than what of a packet is kept here.
        const message = JSON.parse(head.subarray(from, from + length).toString());
        greetings -= 1;
        if (message.type === "challenge") {
          socket.write(packet({ type: "hello", nonce, proof: proof(secret, "page", message.nonce, nonce) }));
        } else {
          secret = message.session ?? secret;
          isIn();
        }
      }
      if ((head[0] & 15) === 2) {
        frames += 1;
        socket.write(answer);
      }
      skip = length;
      bytes = Buffer.concat([head.subarray(from), rest]);
      head = Buffer.alloc(0);
    }
  });
  socket.on("error", () => {});
}
// Seconds of the thread that serves, which is the first, and of all.
const spent = (path) => {
  const fields = readFileSync(path, "utf8").split(") ")[1].split(" ");
  return (Number(fields[11]) + Number(fields[12])) / 100;
};
const both = () => [spent(`/proc/${child.pid}/task/${child.pid}/stat`), spent(`/proc/${child.pid}/stat`)];
for (let i = 0; i < Number(clients); i++) await new Promise((isIn) => client(isIn));
await new Promise((done) => setTimeout(done, 5000));
const [served, all] = both();
const before = frames;
await new Promise((done) => setTimeout(done, 1000 * Number(seconds)));
const [servedLater, allLater] = both();
const share = (100 * (servedLater - served)) / (allLater - all);
console.log(`${clients} clients, ${frames - before} frames in ${seconds} s: serving takes ${share.toFixed(1)} % of the viewer's processor time`);
child.kill("SIGINT");
process.exit(0);
