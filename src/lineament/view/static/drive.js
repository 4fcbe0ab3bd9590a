// The drive in the world frame: the path of the poses, and points of some scans on the way.

import { ask } from "./api.js";

const SCANS = 400; // of about so many scans, evenly over the log, the points are shown
const POSES = 4096, CHUNK = 32; // most poses and scans of one answer
const PAUSE = 300; // milliseconds between two looks at how far the log is read

export class Drive {
  poses = []; // [x, y, direction] by scan; of nulls where a scan has none
  scans = []; // { index, pose, points: [x, y, x, y, ...] }, in their order
  #started = false;
  #closed = false;

  /** `log` are the parameters by which questions name it. */
  constructor(log) {
    this.log = log;
  }

  close() {
    this.#closed = true;
  }

  /** Load all that there is, once, as the log is read; `grown()` is called when something came. */
  async load(grown) {
    if (this.#started) return;
    this.#started = true;
    const { log } = this;
    for (let step = 0, first = 0; !this.#closed;) {
      const { scans, total, complete } = await ask("log", log);
      if (total !== null || complete) step ||= Math.max(1, Math.ceil((total ?? scans) / SCANS));
      while (this.poses.length < scans && !this.#closed) {
        const { poses } = await ask("poses", { ...log, first: this.poses.length, count: POSES });
        if (!poses.length) break;
        this.poses.push(...poses);
      }
      while (step && first < scans && !this.#closed) {
        const count = Math.min(CHUNK, Math.ceil((scans - first) / step));
        const more = await ask("drive", { ...log, first, step, count });
        this.scans.push(...more.scans);
        first += step * count;
        if (!this.#closed) grown();
      }
      if (complete) return;
      await new Promise((next) => setTimeout(next, PAUSE));
    }
  }

  /** Points about which the whole drive lies, without the few that lie far from all others. */
  get outline() {
    const points = this.poses.filter(([x]) => x !== null), xs = [], ys = [];
    for (const { points: all } of this.scans) {
      for (let k = 0; k < all.length; k += 8) {
        xs.push(all[k]);
        ys.push(all[k + 1]);
      }
    }
    if (!xs.length) return points;
    for (const values of [xs, ys]) values.sort((a, b) => a - b);
    const at = (values, share) => values[Math.round(share * (values.length - 1))];
    return [...points, ...[0.002, 0.998].map((share) => [at(xs, share), at(ys, share)])];
  }
}

/** The points of a drive as a picture, which grows as the drive goes on. */
export class Backdrop {
  #canvas = document.createElement("canvas");
  #key = "";
  #drive = null;
  #painted = 0; // scans that are in the picture

  /** Draw the points of the scans up to one, in a colour such as #a0b0c0. */
  draw(ctx, drive, plane, size, color, last) {
    const ratio = window.devicePixelRatio || 1, canvas = this.#canvas;
    const [width, height] = [size.width, size.height].map((pixels) => Math.round(pixels * ratio));
    const key = [plane.x, plane.y, plane.scale, width, height, color].join();
    const after = drive.scans.findIndex(({ index }) => index > last);
    const count = after < 0 ? drive.scans.length : after;
    if (key !== this.#key || drive !== this.#drive || count < this.#painted) {
      Object.assign(canvas, { width, height });
      this.image = new ImageData(width, height);
      this.#key = key;
      this.#drive = drive;
      this.#painted = 0;
    }
    if (this.#painted < count) {
      const dot = Math.max(1, Math.round(ratio * (plane.scale > 40 ? 2 : 1)));
      for (const { points } of drive.scans.slice(this.#painted, count)) {
        this.#paint(points, plane, ratio, dot, color);
      }
      this.#painted = count;
      canvas.getContext("2d").putImageData(this.image, 0, 0);
    }
    ctx.drawImage(canvas, 0, 0, size.width, size.height);
  }

  // What is seen again is darker.
  #paint(points, plane, ratio, dot, color) {
    const { width, height, data } = this.image, pixels = new Uint32Array(data.buffer);
    const [red, green, blue] = [1, 3, 5].map((k) => parseInt(color.slice(k, k + 2), 16));
    const paint = (blue << 16) | (green << 8) | red, scale = plane.scale * ratio;
    const left = width / 2 - plane.x * scale - dot / 2, top = height / 2 + plane.y * scale - dot / 2;
    for (let k = 0; k < points.length; k += 2) {
      const u = Math.round(left + points[k] * scale), v = Math.round(top - points[k + 1] * scale);
      if (u < 0 || v < 0 || u + dot > width || v + dot > height) continue;
      for (let row = v; row < v + dot; row++) {
        for (let i = row * width + u; i < row * width + u + dot; i++) {
          const alpha = pixels[i] >>> 24;
          pixels[i] = ((alpha ? Math.min(alpha + 20, 210) : 130) << 24) | paint;
        }
      }
    }
  }
}
