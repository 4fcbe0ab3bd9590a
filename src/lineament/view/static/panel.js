// One panel: a method's choice, its canvas, and what the pointer does there.

import { describe, element, listOf } from "./details.js";
import { Backdrop } from "./drive.js";
import { Drawing } from "./drawing.js";
import { LAYERS } from "./layers.js";
import { Frame } from "./plane.js";

const NEAR = 12; // pixels within which something is meant, and how much more by a finger
const FINGER = 1.8;
const STILL = 4; // pixels that a click may move
const INSIDE = 0.08; // of the size: nearer to its border a sensor is about to leave

export class Panel {
  scan = null; // with the features that the method found
  frame = null; // of the scan; null where it has no place in the world
  hovered = null;
  #backdrop = new Backdrop();
  #reach = 1; // how much farther than a mouse the pointer reaches
  #pointers = new Map();
  #moved = 0;

  constructor(app, method) {
    this.app = app;
    this.element = element("section", "", "panel");
    this.element.innerHTML =
      '<div class="bar"><select aria-label="Method"></select><span></span></div>' +
      '<canvas tabindex="0" role="img"></canvas><div class="card" role="tooltip" hidden></div>';
    this.select = this.element.querySelector("select");
    this.caption = this.element.querySelector("span");
    this.canvas = this.element.querySelector("canvas");
    this.card = this.element.querySelector(".card");
    this.select.append(...app.methods.map((name) => new Option(name, name)));
    this.select.value = method;
    this.select.addEventListener("change", () => app.changeMethod());
    this.#listen();
    this.observer = new ResizeObserver(() => app.resized());
    this.observer.observe(this.canvas);
  }

  get method() {
    return this.select.value;
  }

  get size() {
    return { width: this.canvas.clientWidth, height: this.canvas.clientHeight };
  }

  remove() {
    this.observer.disconnect();
    this.element.remove();
  }

  clear() {
    this.scan = this.hovered = null;
    this.caption.textContent = "";
    this.card.hidden = true;
  }

  /** Put the scan where it was seen from in the world, or the sensor into the middle. */
  place(isWorld) {
    const pose = isWorld ? this.scan?.pose : undefined;
    this.frame = pose === null ? null : new Frame(this.app.plane, pose);
  }

  /** Points of the plane about which the scan lies; none if it has no place. */
  get outline() {
    const { scan, frame } = this;
    if (!scan || !frame) return [];
    // Lone measurements may lie anywhere.
    const clustered = scan.points.filter((point, i) => point && scan.clusters[i] >= 0);
    const seen = clustered.length ? clustered : scan.points.filter(Boolean);
    return [[0, 0], ...seen].map((point) => frame.toPlane(point));
  }

  get isSensorInside() {
    const { frame, size } = this, [u, v] = frame.toPixels([0, 0], size);
    return [u / size.width, v / size.height].every((share) => Math.abs(share - 0.5) < 0.5 - INSIDE);
  }

  show(scan) {
    this.clear();
    this.scan = scan;
    const clusters = new Set(scan.clusters.filter((c) => c >= 0)).size;
    const count = (n, one) => `${n} ${one}${n === 1 ? "" : "s"}`;
    const found = [
      count(scan.segments.length, "segment"), count(scan.corners.length, "corner"),
      count(scan.edges.length, "edge"), count(scan.arcs.length, "arc"), count(clusters, "cluster"),
    ].join(", ");
    const noise = (scan.parts ?? []).map((part) => `${part.topic} ${noiseOf(part)}`).join(", ") || noiseOf(scan);
    this.caption.textContent = `${scan.parts ? "merged: " : ""}${found}; ${noise}`;
    this.canvas.setAttribute("aria-label", `Scan ${scan.index} by ${scan.method}: ${found}`);
  }

  draw() {
    const { canvas, app, scan, size } = this, ratio = window.devicePixelRatio || 1;
    canvas.width = Math.round(size.width * ratio);
    canvas.height = Math.round(size.height * ratio);
    const ctx = canvas.getContext("2d");
    ctx.setTransform(ratio, 0, 0, ratio, 0, 0);
    const seen = this.frame ? scan : null, { shown } = app.layers;
    const drawing = new Drawing(ctx, app.plane, this.frame ?? new Frame(app.plane), size, app.theme);
    const scene = {
      scan: seen, index: scan?.index, sigmas: app.sigmas,
      drive: app.world && scan ? app.drive : null, backdrop: this.#backdrop,
      plan: app.world ? app.plan : null, isByScanner: Boolean(seen?.parts) && shown.scanners,
    };
    drawing.grid();
    for (const layer of LAYERS) layer.draw(shown[layer.name], drawing, scene);
    if (seen) {
      if (app.asked?.panel === this) drawing.beam(scan, app.asked.beam);
      if (this.hovered) drawing.highlight(this.hovered, scan, app.sigmas);
    }
    if (app.cursor && app.cursor.panel !== this) drawing.cursor(app.cursor.point);
    drawing.scaleBar();
  }

  #listen() {
    const { canvas, app } = this;
    const on = (name, handle) => canvas.addEventListener(name, handle, { passive: false });
    on("wheel", (event) => {
      event.preventDefault();
      const steps = Math.max(-3, Math.min(3, event.deltaY / (event.deltaMode ? 3 : 100)));
      app.look(() => app.plane.zoom(1.25 ** -steps, this.#pixel(event), this.size));
    });
    on("pointerdown", (event) => {
      canvas.setPointerCapture(event.pointerId);
      this.#pointers.set(event.pointerId, this.#pixel(event));
      this.#moved = this.#pointers.size === 1 ? 0 : Infinity; // two fingers are no click
      this.#reach = event.pointerType === "touch" ? FINGER : 1;
    });
    on("pointermove", (event) => {
      if (this.#pointers.has(event.pointerId)) this.#drag(event);
      else this.#hover(this.#pixel(event));
    });
    on("pointerup", (event) => {
      const isClick = this.#pointers.delete(event.pointerId) && this.#moved <= STILL;
      if (isClick) this.#click(this.#pixel(event));
    });
    on("pointercancel", (event) => this.#pointers.delete(event.pointerId));
    // What a finger has chosen stays when it is lifted.
    on("pointerleave", (event) => event.pointerType !== "touch" && this.#leave());
  }

  #pixel(event) {
    const box = this.canvas.getBoundingClientRect();
    return [event.clientX - box.left, event.clientY - box.top];
  }

  // One pointer moves the view; two move it with what is between them, and zoom.
  #drag(event) {
    const before = this.#pointers.get(event.pointerId), now = this.#pixel(event);
    const { plane } = this.app, shift = [now[0] - before[0], now[1] - before[1]];
    const other = [...this.#pointers].find(([id]) => id !== event.pointerId)?.[1];
    this.#moved += Math.hypot(...shift);
    this.#pointers.set(event.pointerId, now);
    if (this.#moved <= STILL) return;
    this.card.hidden = true;
    this.app.look(() => {
      if (!other) return plane.move(...shift);
      const apart = (p) => Math.hypot(p[0] - other[0], p[1] - other[1]) || 1;
      plane.move(shift[0] / 2, shift[1] / 2);
      plane.zoom(apart(now) / apart(before), [(now[0] + other[0]) / 2, (now[1] + other[1]) / 2], this.size);
    });
  }

  #hover(pixel) {
    this.hovered = this.pick(pixel);
    this.app.cursor = { panel: this, point: this.app.plane.toMetres(pixel, this.size) };
    this.#placeCard(pixel);
    this.app.redraw();
  }

  #leave() {
    this.hovered = this.app.cursor = null;
    this.card.hidden = true;
    this.app.redraw();
  }

  #click(pixel) {
    if (!this.scan || !this.frame) return;
    this.#hover(pixel);
    const picked = this.hovered;
    if (picked && picked.kind !== "measurement") this.app.pins.add(picked, this.scan);
    const beam = ["corner", "edge"].includes(picked?.kind) ? picked.feature.beam : this.#beamAt(pixel);
    if (beam >= 0) this.app.explain(this, beam);
  }

  #placeCard([u, v]) {
    this.card.hidden = !this.hovered;
    if (!this.hovered) return;
    const { title, rows } = describe(this.hovered, this.scan);
    this.card.replaceChildren(element("h3", title), listOf(rows));
    const { width, height } = this.size, top = this.canvas.offsetTop;
    const [w, h] = [this.card.offsetWidth, this.card.offsetHeight];
    const left = u + 16 + w < width ? u + 16 : Math.max(u - 16 - w, 4);
    const below = v + 16 + h < height ? v + 16 : Math.max(v - 16 - h, 4);
    this.card.style.left = `${left}px`;
    this.card.style.top = `${top + below}px`;
  }

  /** What is under a pixel: { kind, index, feature }, corners before lines before measurements. */
  pick(pixel) {
    const { scan } = this, { shown } = this.app.layers, reach = this.#reach;
    if (!scan || !this.frame) return null;
    const pick = (kind, features, near, distance) => {
      const index = nearest(features, near, distance);
      return index < 0 ? null : { kind, index, feature: features[index] };
    };
    const away = (f) => this.#distance(pixel, f.position);
    return (shown.corners && pick("corner", scan.corners, NEAR * reach, away))
      || (shown.edges && pick("edge", scan.edges, NEAR * reach, away))
      || (shown.breakpoints && pick("breakpoint", scan.breakpoints, (NEAR / 2) * reach, away))
      || (shown.arcs && pick("arc", scan.arcs, 7 * reach, (arc) => this.#offArc(pixel, arc)))
      || (shown.segments && pick("segment", scan.segments, 7 * reach, (s) => this.#offSegment(pixel, s)))
      || this.#measurement(pixel);
  }

  #measurement(pixel) {
    const beam = nearest(this.scan.points, NEAR * this.#reach, (point) => this.#distance(pixel, point));
    return beam < 0 ? null : { kind: "measurement", index: beam, feature: { beam } };
  }

  // The beam of the nearest measurement; far from all of them, the beam that passes nearest.
  #beamAt(pixel) {
    const measurement = this.#measurement(pixel);
    if (measurement) return measurement.index;
    const [x, y] = this.frame.toMetres(pixel, this.size), turn = Math.atan2(y, x);
    const off = (a) => Math.abs(Math.atan2(Math.sin(a - turn), Math.cos(a - turn)));
    return nearest(this.scan.bearings, Infinity, off);
  }

  #distance([u, v], point) {
    if (!point) return Infinity;
    const [pu, pv] = this.frame.toPixels(point, this.size);
    return Math.hypot(u - pu, v - pv);
  }

  #offSegment([u, v], { start, end }) {
    const [pu, pv] = this.frame.toPixels(start, this.size);
    const [qu, qv] = this.frame.toPixels(end, this.size);
    const [du, dv] = [qu - pu, qv - pv], square = du * du + dv * dv || 1;
    const t = Math.min(Math.max(((u - pu) * du + (v - pv) * dv) / square, 0), 1);
    return Math.hypot(u - pu - t * du, v - pv - t * dv);
  }

  #offArc(pixel, { center, radius }) {
    return Math.abs(this.#distance(pixel, center) - radius * this.app.plane.scale);
  }
}

/** Standard deviation of a range in the middle of those of a scan, in words. */
function noiseOf({ noise, ranges }) {
  const sorted = ranges.filter((r) => r !== null).sort((a, b) => a - b);
  if (!noise || !sorted.length) return "nothing valid";
  const { sigma, proportional, quantum } = noise, middle = sorted[sorted.length >> 1];
  const deviation = 1000 * Math.hypot(sigma, proportional * middle, quantum / Math.sqrt(12));
  return `noise ${deviation.toFixed(1)} mm at ${middle.toFixed(1)} m`;
}

/** Index of the item with the least distance below `near`; -1 if there is none. */
function nearest(items, near, distance) {
  let index = -1, least = near;
  items.forEach((item, i) => {
    const d = distance(item);
    if (d < least) [index, least] = [i, d];
  });
  return index;
}
