// What is drawn of a scan and about it, one layer over another; each can be left out.

import { element } from "./details.js";

/**
 * From the lowest to the highest. `draw(isShown, drawing, scene)` draws a layer of a scene: the
 * scan (null where it has no place), the drive, how large covariances are.
 */
export const LAYERS = [
  { name: "drive", draw: (on, d, s) => on && s.drive && d.drive(s.drive, s.backdrop, s.index) },
  { name: "scanners", draw: (on, d, s) => on && s.scan?.parts && d.scanners(s.scan.parts) },
  { name: "clusters", draw: (on, d, s) => s.scan && !s.isByScanner && d.measurements(s.scan, on) },
  { name: "arcs", key: "arc", draw: (on, d, s) => on && s.scan && d.arcs(s.scan) },
  { name: "segments", key: "segment", draw: (on, d, s) => on && s.scan && d.segments(s.scan) },
  { name: "breakpoints", key: "break", draw: (on, d, s) => on && s.scan && d.breakpoints(s.scan) },
  { name: "edges", key: "edge", draw: (on, d, s) => on && s.scan && d.edges(s.scan, s.sigmas) },
  { name: "corners", key: "corner", draw: (on, d, s) => on && s.scan && d.corners(s.scan, s.sigmas) },
  { name: "plan", draw: (on, d, s) => on && s.plan && d.plan(s.plan) },
  { name: "pose", draw: (on, d, s) => on && s.plan && s.scan && d.pose(s.scan.where) },
];

/** The boxes that switch them. */
export class Layers {
  #boxes = {};

  constructor(place, changed) {
    const chips = LAYERS.map(({ name, key }) => {
      const box = Object.assign(element("input"), { type: "checkbox", id: `show-${name}`, checked: true });
      const chip = element("label");
      chip.title = "Show or hide (1 … 9, in the order of the boxes)";
      chip.append(box, ...(key ? [element("i", "", `key ${key}`)] : []), name);
      box.addEventListener("change", changed);
      this.#boxes[name] = box;
      return chip;
    });
    place.prepend(...chips);
  }

  get shown() {
    return Object.fromEntries(Object.entries(this.#boxes).map(([name, box]) => [name, box.checked]));
  }

  get hidden() {
    return LAYERS.map(({ name }) => name).filter((name) => !this.#boxes[name].checked);
  }

  hide(names) {
    for (const name of names) if (this.#boxes[name]) this.#boxes[name].checked = false;
  }

  /** Switch one of the boxes that are there. */
  toggle(k) {
    const there = LAYERS.filter(({ name }) => !this.#boxes[name].parentElement.hidden);
    if (there[k]) this.#boxes[there[k].name].click();
  }

  /** Whether these layers are there: of a plan and a pose on it, of several scanners. */
  offer(isThere, ...names) {
    for (const name of names) this.#boxes[name].parentElement.hidden = !isThere;
  }

  /** The drive is there in the world frame alone. */
  allowDrive(isWorld) {
    this.#boxes.drive.disabled = !isWorld;
  }
}
