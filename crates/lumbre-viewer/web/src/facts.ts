// The facts of the scene, and the hits of a ray.
import { element, large, short, spoken } from "./elements";
import type { ListedHit, SceneFacts } from "./messages";
import { called } from "./tree";

const point = (v: readonly number[]) => v.map(short).join(", ");

export function showFacts(list: HTMLElement, warnings: HTMLElement, scene: SceneFacts): void {
  const counted = (kinds: Record<string, number>) =>
    Object.entries(kinds).map(([name, count]) => `${count} ${name}`).join(", ") || "none";
  const rows: [string, string][] = [
    ["Shapes", counted(scene.shapes)],
    ["Triangles", large(scene.triangles)],
    ["Instances", large(scene.instances)],
    ["Materials", counted(scene.materials)],
    ["Lights", counted(scene.lights)],
    ["Bounds", scene.bounds ? `${point(scene.bounds[0])} to ${point(scene.bounds[1])}` : "none"],
    ["Memory", `${large(scene.memory)}B`],
    ["Built in", spoken(scene.build_seconds)],
  ];
  list.replaceChildren(...rows.flatMap(([name, text]) => [element("dt", name), element("dd", text)]));
  warnings.replaceChildren();
  if (scene.warnings.length > 0) {
    warnings.append(element("p", `${scene.warnings.length} warnings`, { className: "quiet" }));
    warnings.append(element("pre", scene.warnings.join("\n"), { tabIndex: 0 }));
  }
}

export function showHits(panel: HTMLElement, hits: ListedHit[]): void {
  const first = hits[0];
  if (!first) {
    panel.replaceChildren(element("p", "Nothing is there.", { className: "quiet" }));
    return;
  }
  const { surface } = first;
  const rows: [string, string | undefined][] = [
    ["Shape", called(first)],
    ["Material", first.material ?? "none"],
    ["Position", surface ? point(surface.point) : undefined],
    ["Normal", surface ? point(surface.normal) : undefined],
    ["Distance", short(first.distance)],
    ["uv", surface ? point(surface.uv) : undefined],
    ["Triangle", surface && first.kind === "mesh" ? String(surface.primitive) : undefined],
    ["Instance", surface ? String(surface.instance ?? "none") : undefined],
    ["Side", surface ? (surface.front ? "outside" : "inside") : undefined],
  ];
  const table = element("table");
  for (const [name, text] of rows) {
    if (text === undefined) continue;
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
