// A scan and its features on a canvas.

import { ellipseOf, isKnown, seenOf } from "./geometry.js";
import { roundLength } from "./plane.js";

const NAMES = ["ink", "soft", "page", "grid", "axis", "faint", "drive", "accent", "corner", "edge", "break", "arc"];

/** The colours of the page, light or dark. */
export function readTheme() {
  const style = getComputedStyle(document.documentElement);
  const read = (name) => style.getPropertyValue(`--${name}`).trim();
  const lists = ["clusters", "scanners"].map((name) => [name, read(name).split(/\s+/)]);
  return { ...Object.fromEntries([...NAMES.map((n) => [n, read(n)]), ...lists]), stroke: 1.2 };
}

/** The colour of a scanner, by the number of its topic. */
export const colorOf = (number, theme) => theme.scanners[number % theme.scanners.length];

/** Draws on a canvas: the world by a plane, a scan and its features by their frame in it. */
export class Drawing {
  constructor(ctx, plane, frame, size, theme) {
    Object.assign(this, { ctx, plane, frame, size, theme });
  }

  at(point) {
    return this.frame.toPixels(point, this.size);
  }

  measurements(scan, inClusters) {
    const { ctx, theme, plane } = this, half = Math.min(Math.max(plane.scale / 40, 1.9), 3.2);
    this.#invalid(scan);
    scan.points.forEach((point, i) => {
      if (!point) return;
      const cluster = scan.clusters[i];
      if (cluster < 0) return this.#cross(point, half + 0.8);
      ctx.fillStyle = inClusters ? theme.clusters[cluster % theme.clusters.length] : theme.soft;
      this.#round(point, half);
      ctx.fill();
    });
    this.#sensor();
  }

  /** What each of several scanners sees, in its colour and its place on the robot. */
  scanners(parts) {
    for (const part of parts) {
      const { ctx, plane, frame, size, theme } = this, c = colorOf(part.number, theme);
      const own = { ...theme, soft: c, ink: c, corner: c, edge: c, arc: c, stroke: 3.5 };
      const drawing = new Drawing(ctx, plane, frame.within(part.place), size, own);
      drawing.measurements(part, false);
      drawing.arcs(part);
      drawing.segments(part);
      drawing.corners(part, 0);
    }
    this.#sensor();
  }

  arcs(scan) {
    scan.arcs.forEach((arc) => this.#arc(arc, scan));
  }

  segments(scan) {
    scan.segments.forEach((segment) => this.#segment(segment));
  }

  breakpoints(scan) {
    scan.breakpoints.forEach((breakpoint) => this.#breakpoint(breakpoint));
  }

  // A square, smaller and lighter than the diamond of a corner.
  edges(scan, sigmas) {
    this.#points(scan.edges, this.theme.edge, 1.2, scan.reach, sigmas, (u, v) => this.ctx.strokeRect(u - 3, v - 3, 6, 6));
  }

  corners(scan, sigmas) {
    this.#points(scan.corners, this.theme.corner, 1.6, scan.reach, sigmas,
      (u, v) => this.#path([[u - 5, v], [u, v - 5], [u + 5, v], [u, v + 5], [u - 5, v]]));
  }

  /** Points of the scans up to one, the path up to it, and lighter the rest of the path. */
  drive(drive, backdrop, last) {
    const { ctx, theme, size, plane } = this;
    backdrop.draw(ctx, drive, plane, size, theme.drive, last);
    for (const [first, end, alpha] of [[last, drive.poses.length, 0.3], [0, last + 1, 0.8]]) {
      let before = null;
      ctx.beginPath();
      for (const [x, y] of drive.poses.slice(first, end)) {
        const pixel = x === null ? null : plane.toPixels([x, y], size);
        // Steps that are too short to be seen are left out.
        if (pixel && before && Math.abs(pixel[0] - before[0]) + Math.abs(pixel[1] - before[1]) < 1.5) continue;
        if (pixel) ctx[before ? "lineTo" : "moveTo"](...pixel);
        before = pixel;
      }
      ctx.globalAlpha = alpha;
      this.#pen(theme.accent, 1.2);
      ctx.stroke();
      ctx.globalAlpha = 1;
    }
  }

  /** The walls of the plan. */
  plan(walls) {
    this.#pen(this.theme.ink, 1.2);
    for (const [a, b, c, d] of walls) this.#path([[a, b], [c, d]].map((p) => this.plane.toPixels(p, this.size)));
  }

  /** The ellipse of three deviations about the sensor, at least as large as can be seen. */
  pose(where) {
    if (!where?.covariance) return;
    const { major, minor, direction } = ellipseOf(where.covariance);
    const radii = [major, minor].map((sigma) => Math.max(3 * sigma * this.plane.scale, 4));
    this.ctx.beginPath();
    this.ctx.ellipse(...this.at([0, 0]), ...radii, -direction, 0, 2 * Math.PI);
    this.#pen(where.verdict === "located" ? this.theme.accent : this.theme.edge, 2);
    this.ctx.stroke();
  }

  grid() {
    const { plane, size, theme } = this, step = roundLength(plane.scale, 56);
    const [left, top] = plane.toMetres([0, 0], size);
    const [right, bottom] = plane.toMetres([size.width, size.height], size);
    for (let k = Math.ceil(left / step); k * step <= right; k++) {
      const u = Math.round(plane.toPixels([k * step, 0], size)[0]) + 0.5;
      this.#pen(k === 0 ? theme.axis : theme.grid);
      this.#path([[u, 0], [u, size.height]]);
    }
    for (let k = Math.ceil(bottom / step); k * step <= top; k++) {
      const v = Math.round(plane.toPixels([0, k * step], size)[1]) + 0.5;
      this.#pen(k === 0 ? theme.axis : theme.grid);
      this.#path([[0, v], [size.width, v]]);
    }
  }

  scaleBar() {
    const { ctx, plane, size, theme } = this, length = roundLength(plane.scale, 70);
    const u = 14.5, v = size.height - 14.5, w = length * plane.scale;
    this.#pen(theme.ink, 1.5);
    this.#path([[u, v - 5], [u, v], [u + w, v], [u + w, v - 5]]);
    ctx.fillStyle = theme.ink;
    ctx.font = "12px system-ui, sans-serif";
    ctx.textAlign = "left";
    ctx.fillText(metresText(length), u + 6, v - 6);
  }

  /** Make a feature stand out, with the band or ellipse of its covariance. */
  highlight({ kind, feature }, scan, sigmas) {
    const { ctx, theme } = this;
    ctx.save();
    ctx.lineCap = "round";
    ctx.globalAlpha = 0.35;
    this.#pen(theme.accent, 6);
    if (kind === "segment") {
      this.#stroke([feature.start, feature.end]);
      this.#band(feature, sigmas);
    } else if (kind === "arc") {
      this.#circle(feature, ...seenOf(feature, scan));
    } else {
      ctx.lineWidth = 3;
      this.#ring(feature.position ?? scan.points[feature.beam], 9);
    }
    ctx.restore();
  }

  /** The beam that is asked about: a line from the sensor, and a ring where it ends. */
  beam(scan, i) {
    const { ctx, theme, size, plane, frame } = this;
    const far = (size.width + size.height) / plane.scale + Math.hypot(plane.x - frame.x, plane.y - frame.y);
    const a = scan.bearings[i];
    ctx.save();
    this.#pen(theme.accent);
    ctx.setLineDash([2, 4]);
    this.#stroke([[0, 0], scan.points[i] ?? [far * Math.cos(a), far * Math.sin(a)]]);
    if (scan.points[i]) {
      ctx.setLineDash([]);
      ctx.lineWidth = 2;
      this.#ring(scan.points[i], 7);
    }
    ctx.restore();
  }

  /** Where the pointer is in the other panel, in the plane. */
  cursor(point) {
    const [u, v] = this.plane.toPixels(point, this.size);
    this.#pen(this.theme.accent);
    this.#path([[u - 7, v], [u + 7, v]]);
    this.#path([[u, v - 7], [u, v + 7]]);
  }

  // Short ticks on a ring about the sensor, in the directions from which nothing usable came.
  #invalid(scan) {
    const [u, v] = this.at([0, 0]);
    this.#pen(this.theme.faint);
    scan.points.forEach((point, i) => {
      if (point) return;
      const a = scan.bearings[i] + this.frame.turn, c = Math.cos(a), s = -Math.sin(a);
      this.#path([[u + 16 * c, v + 16 * s], [u + 22 * c, v + 22 * s]]);
    });
  }

  #segment({ start, end }) {
    if (!isKnown([start, end])) return;
    this.#pen(this.theme.ink, this.theme.stroke);
    this.#stroke([start, end]);
    const [p, q] = [this.at(start), this.at(end)];
    const length = Math.hypot(q[0] - p[0], q[1] - p[1]) || 1;
    const [nu, nv] = [(4 * (q[1] - p[1])) / length, (-4 * (q[0] - p[0])) / length];
    for (const [u, v] of [p, q]) this.#path([[u - nu, v - nv], [u + nu, v + nv]]);
  }

  // Standard deviations of the line's place along it: offset and angle, and what they share.
  #band({ start, end, centroid, angle, covariance }, sigmas) {
    if (!isKnown(covariance) || !sigmas) return;
    const [c, s] = [Math.cos(angle), Math.sin(angle)];
    const along = ([x, y]) => c * (x - centroid[0]) + s * (y - centroid[1]);
    const [t0, t1] = [along(start), along(end)], upper = [], lower = [];
    for (let k = 0; k <= 24; k++) {
      const t = t0 + ((t1 - t0) * k) / 24;
      const variance = covariance[0][0] + 2 * t * covariance[0][1] + t * t * covariance[1][1];
      const half = sigmas * Math.sqrt(Math.max(variance, 0));
      const [x, y] = [centroid[0] + t * c, centroid[1] + t * s];
      upper.push([x - half * s, y + half * c]);
      lower.unshift([x + half * s, y - half * c]);
    }
    this.#area([...upper, ...lower].map((p) => this.at(p)), this.theme.accent);
  }

  // Corners or edges by their mark, with their ellipses.
  #points(features, color, width, reach, sigmas, mark) {
    for (const { position, covariance } of features) {
      if (!isKnown(position)) continue;
      this.#pen(color, width);
      mark(...this.at(position));
      if (sigmas && isKnown(covariance)) this.#spread(position, covariance, color, sigmas, reach);
    }
  }

  #spread(position, covariance, color, sigmas, reach) {
    const { ctx, plane } = this, [u, v] = this.at(position);
    const { major, minor, direction } = ellipseOf(covariance);
    const [a, b] = [major, minor].map((sigma) => sigmas * sigma * plane.scale);
    // Hidden by the marker, or no knowledge at all: then the numbers say so.
    if (a < 3 || 3 * major > reach) return;
    ctx.beginPath();
    ctx.ellipse(u, v, a, b, -direction - this.frame.turn, 0, 2 * Math.PI);
    ctx.lineWidth = 1;
    ctx.stroke();
    ctx.globalAlpha = 0.15;
    ctx.fillStyle = color;
    ctx.fill();
    ctx.globalAlpha = 1;
  }

  #arc(arc, scan) {
    const { ctx, theme } = this;
    if (!isKnown([arc.center, arc.radius])) return;
    ctx.save();
    this.#pen(theme.arc, 0.8);
    ctx.setLineDash([3, 4]);
    this.#circle(arc, 0, 2 * Math.PI);
    ctx.setLineDash([]);
    ctx.lineWidth = 2.5;
    this.#circle(arc, ...seenOf(arc, scan));
    ctx.restore();
  }

  #circle({ center, radius }, first, last) {
    const { turn } = this.frame;
    this.ctx.beginPath();
    this.ctx.arc(...this.at(center), radius * this.plane.scale, -last - turn, -first - turn);
    this.ctx.stroke();
  }

  #breakpoint({ position }) {
    const { ctx, theme } = this;
    if (!isKnown(position)) return;
    ctx.fillStyle = theme.page;
    this.#pen(theme.break, 1.2);
    this.#round(position, 3.4);
    ctx.fill();
    ctx.stroke();
  }

  // A triangle at the origin that looks along the x axis.
  #sensor() {
    const [u, v] = this.at([0, 0]), { cos, sin } = this.frame;
    const shape = [[9, 0], [-6, 6], [-6, -6]].map(([x, y]) => [u + cos * x - sin * y, v - sin * x - cos * y]);
    this.#area(shape, this.theme.ink);
  }

  #round(point, radius) {
    this.ctx.beginPath();
    this.ctx.arc(...this.at(point), radius, 0, 7);
  }

  #ring(point, radius) {
    this.#round(point, radius);
    this.ctx.stroke();
  }

  #cross(point, half) {
    const [u, v] = this.at(point);
    this.#pen(this.theme.faint);
    this.#path([[u - half, v - half], [u + half, v + half]]);
    this.#path([[u - half, v + half], [u + half, v - half]]);
  }

  #stroke(points) {
    this.#path(points.map((p) => this.at(p)));
  }

  #path(pixels) {
    this.#trace(pixels);
    this.ctx.stroke();
  }

  #area(pixels, color) {
    this.#trace(pixels);
    this.ctx.fillStyle = color;
    this.ctx.fill();
  }

  #trace(pixels) {
    this.ctx.beginPath();
    pixels.forEach(([u, v], k) => (k ? this.ctx.lineTo(u, v) : this.ctx.moveTo(u, v)));
  }

  #pen(color, width = 1) {
    Object.assign(this.ctx, { strokeStyle: color, lineWidth: width });
  }
}

function metresText(metres) {
  if (metres >= 1) return `${metres} m`;
  return metres >= 0.01 ? `${Math.round(metres * 100)} cm` : `${+(metres * 1000).toPrecision(1)} mm`;
}
