// An example that is edited and run where it stands: its commands are fields, and what each prints follows.
import { Engine, button, latest, make, said } from "./engine.js";
import { FigureOf, isFigured } from "./figure.js";
import { Unknown, commandsOf, isKnown, shell, shownAs } from "./shell.js";
import { word } from "./words.js";

/** Milliseconds after the last key until a command is run. */
const TYPED = 200;

/** Lets the example in this block of code be tried, if one of its commands is known; the others stay as they are. */
export function example(block: HTMLPreElement, engine: Engine): boolean {
  const all = commandsOf(block.textContent ?? "");
  if (!all.some(({ command }) => isKnown(command))) return false;
  const bar = make("div", { className: "live-bar" });
  const start = button(word("try"), () => {
    const part = opened(all, engine, () => {
      part.remove();
      block.hidden = false;
      bar.hidden = false;
      start.focus();
    });
    block.hidden = true;
    bar.hidden = true;
    bar.after(part);
    part.querySelector("textarea")?.focus();
  });
  bar.append(start);
  const first = all.find(({ command }) => isFigured(command));
  if (first) {
    const live = button(word("live"), () => {
      const figure = new FigureOf(first.command, engine, () => {
        bar.hidden = false;
        live.focus();
      });
      bar.hidden = true;
      bar.after(figure.element);
      figure.start();
    }, "live-start");
    bar.append(live);
  }
  block.after(bar);
  return true;
}

function opened(all: ReturnType<typeof commandsOf>, engine: Engine, close: () => void): HTMLElement {
  const part = make("section", { className: "live live-example", "aria-label": word("try") });
  part.append(make("p", { className: "live-hint", textContent: word("commands") }));
  const fields = all.map(({ command, output }, i) => {
    const number = all.length > 1 ? ` ${i + 1}` : "";
    const known = isKnown(command);
    const input = make("textarea", { className: "live-command", value: command, rows: 1, spellcheck: false, readOnly: !known, "aria-label": word("command") + number, "autocapitalize": "off" });
    const out = make("pre", { className: "live-output", textContent: output, tabIndex: 0, role: "region", "aria-label": word("output") + number });
    const status = make("p", { className: "live-wrong", role: "status" });
    part.append(make("div", { className: "live-line" }, make("span", { textContent: "$", "aria-hidden": "true" }), input), out, status);
    return { input, out, status, output, known };
  });
  const run = latest(async (from: number) => {
    for (const [i, { input, out, status, output, known }] of fields.entries()) {
      // What a later command reads may have been written by one before.
      if (i < from || !known) continue;
      part.setAttribute("aria-busy", "true");
      try {
        await engine.held.ready();
        const text = await shell(input.value.replace(/\n/g, " "), engine.program, engine.held);
        out.textContent = shownAs(output, text);
        status.textContent = "";
        out.classList.remove("old");
      } catch (error) {
        // What was printed before stays.
        status.textContent = error instanceof Unknown || !/^error: /.test(said(error)) ? said(error) : "";
        if (status.textContent === "") {
          out.textContent = `${said(error)}\n`;
          out.classList.remove("old");
        } else out.classList.add("old");
      }
      part.removeAttribute("aria-busy");
    }
  });
  for (const [i, { input }] of fields.entries()) {
    let typing = 0;
    const fit = () => {
      input.style.height = "auto";
      input.style.height = `${input.scrollHeight + 2}px`;
    };
    requestAnimationFrame(fit);
    input.addEventListener("input", () => {
      fit();
      clearTimeout(typing);
      typing = window.setTimeout(() => run(i), TYPED);
    });
    input.addEventListener("keydown", (event) => {
      if (event.key !== "Enter" || event.shiftKey) return;
      event.preventDefault();
      clearTimeout(typing);
      run(i);
    });
  }
  part.append(make("div", { className: "live-bar" },
    button(word("reset"), () => {
      for (const [i, { input, out }] of fields.entries()) {
        input.value = all[i]!.command;
        out.textContent = all[i]!.output;
      }
      run(0);
    }),
    button(word("close"), close)));
  run(0);
  return part;
}
