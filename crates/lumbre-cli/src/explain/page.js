
"use strict";
{
  const digits = (x) => String(Number(x.toPrecision(6)));
  const numbers = (text) => text.trim().split(/\s+/).map(Number);

  // A slider along t: the point P(t) in the sketches, and F(t) in the plot.
  for (const slider of document.querySelectorAll(".slider")) {
    const figure = slider.closest("figure");
    const range = slider.querySelector("input");
    const [ox, oy, oz, dx, dy, dz] = numbers(figure.dataset.ray);
    const pieces = slider.dataset.pieces ? slider.dataset.pieces.split(";").map(numbers) : [];
    const plot = figure.querySelector(".plot");
    const { from, to, left, right, zero, one } = Object.fromEntries(Object.entries(plot.dataset).map(([name, x]) => [name, Number(x)]));
    const at = (t) => {
      const piece = pieces.findLast(([first]) => first <= t) ?? pieces[0];
      return piece?.slice(3).reduceRight((sum, coefficient) => sum * (t * piece[1] - piece[2]) + coefficient, 0);
    };
    const show = (t) => {
      for (const point of figure.querySelectorAll(".sketch > .moving")) {
        const [start, step] = [numbers(point.dataset.start), numbers(point.dataset.step)];
        const [x, y] = [start[0] + t * step[0], start[1] + t * step[1]];
        const { width, height } = point.ownerSVGElement.viewBox.baseVal;
        point.setAttribute("cx", x);
        point.setAttribute("cy", y);
        point.setAttribute("visibility", t >= Number(point.dataset.first) && x >= 0 && x <= width && y >= 0 && y <= height ? "visible" : "hidden");
      }
      const value = at(t);
      const moving = plot.querySelector(".moving");
      const x = left + ((t - from) / (to - from)) * (right - left);
      moving.setAttribute("visibility", "visible");
      for (const [name, place] of [["x1", x], ["x2", x]]) moving.querySelector("line").setAttribute(name, place);
      const { height } = plot.viewBox.baseVal;
      const y = value === undefined ? zero : Math.min(Math.max(zero - value * one, 8), height - 8);
      moving.querySelector("circle").setAttribute("cx", x);
      moving.querySelector("circle").setAttribute("cy", y);
      const point = [ox + t * dx, oy + t * dy, oz + t * dz].map(digits).join(", ");
      const told = `t = ${digits(t)}, P(t) = (${point})${value === undefined ? "" : `, F(t) = ${digits(value)}`}`;
      slider.querySelector("output").textContent = told;
      range.setAttribute("aria-valuetext", told);
    };
    range.step = (to - from) / 400;
    range.addEventListener("input", () => show(Number(range.value)));
    for (const button of slider.querySelectorAll("button")) {
      button.addEventListener("click", () => {
        range.value = button.dataset.t;
        show(Number(button.dataset.t));
      });
    }
    slider.hidden = false;
    range.value = from;
    show(from);
  }

  // Steps: one section after the other is open, with those around it.
  const steps = [...document.querySelectorAll("main section")];
  const id = (name) => document.getElementById(name);
  let current = -1;
  const go = (to) => {
    current = to;
    const isGoing = current >= 0;
    id("begin").hidden = isGoing;
    id("going").hidden = !isGoing;
    for (const [i, section] of steps.entries()) {
      section.classList.toggle("current", i === current);
      section.firstElementChild.open = !isGoing || section.contains(steps[current]);
    }
    if (!isGoing) return;
    const title = steps[current].querySelector("summary").textContent;
    id("where").textContent = id("where").dataset.text.replace("{0}", current + 1).replace("{1}", steps.length).replace("{2}", title);
    id("previous").disabled = current === 0;
    id("next").disabled = current === steps.length - 1;
    steps[current].querySelector("summary").scrollIntoView({ block: "center" });
  };
  id("begin").addEventListener("click", () => { go(0); id("next").focus(); });
  id("previous").addEventListener("click", () => go(current - 1));
  id("next").addEventListener("click", () => go(current + 1));
  id("all").addEventListener("click", () => { go(-1); id("begin").focus(); });
  addEventListener("keydown", (event) => {
    if (current < 0 || event.target.matches("input") || event.ctrlKey || event.altKey || event.metaKey || event.shiftKey) return;
    const to = current + { ArrowLeft: -1, ArrowRight: 1 }[event.key];
    if (to >= 0 && to < steps.length) { event.preventDefault(); go(to); }
  });
  id("steps").hidden = steps.length < 2;
}
