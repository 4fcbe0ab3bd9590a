// Views of the plane: metres to pixels.

const LEAST_SCALE = 0.2, MOST_SCALE = 50000; // pixels a metre

const within = (scale) => Math.min(Math.max(scale, LEAST_SCALE), MOST_SCALE);

/** What all panels show of the plane. */
export class Plane {
  x = 0; // metres in the middle of a panel
  y = 0;
  scale = 50; // pixels a metre

  toPixels([x, y], { width, height }) {
    return [width / 2 + (x - this.x) * this.scale, height / 2 - (y - this.y) * this.scale];
  }

  toMetres([u, v], { width, height }) {
    return [this.x + (u - width / 2) / this.scale, this.y - (v - height / 2) / this.scale];
  }

  move(du, dv) {
    this.x -= du / this.scale;
    this.y += dv / this.scale;
  }

  /** Zoom by a factor; what lies under the pixel stays there. */
  zoom(factor, pixel, size) {
    const before = this.toMetres(pixel, size);
    this.scale = within(this.scale * factor);
    const after = this.toMetres(pixel, size);
    this.x += before[0] - after[0];
    this.y += before[1] - after[1];
  }

  /** Show all of these points. */
  fit(points, { width, height }) {
    const [left, right] = extent(points.map((p) => p[0])), [bottom, top] = extent(points.map((p) => p[1]));
    this.x = (left + right) / 2;
    this.y = (bottom + top) / 2;
    this.scale = within(0.9 * Math.min(width / (right - left || 1), height / (top - bottom || 1)));
  }

  /** Metres across the shorter side of a panel: what a link keeps, whatever the window's size. */
  span({ width, height }) {
    return Math.min(width, height) / this.scale;
  }

  look([x, y, span], size) {
    Object.assign(this, { x, y, scale: within(Math.min(size.width, size.height) / span) });
  }
}

/** The frame of a scan at a pose in the plane. */
export class Frame {
  constructor(plane, [x, y, turn] = [0, 0, 0]) {
    Object.assign(this, { plane, x, y, turn, cos: Math.cos(turn), sin: Math.sin(turn) });
  }

  /** The frame of what is mounted in this one. */
  within([x, y, turn]) {
    return new Frame(this.plane, [...this.toPlane([x, y]), this.turn + turn]);
  }

  toPlane([x, y]) {
    return [this.x + this.cos * x - this.sin * y, this.y + this.sin * x + this.cos * y];
  }

  toPixels(point, size) {
    return this.plane.toPixels(this.toPlane(point), size);
  }

  toMetres(pixel, size) {
    const [x, y] = this.plane.toMetres(pixel, size), [dx, dy] = [x - this.x, y - this.y];
    return [this.cos * dx + this.sin * dy, this.cos * dy - this.sin * dx];
  }
}

function extent(values) {
  return values.reduce(([low, high], v) => [Math.min(low, v), Math.max(high, v)], [Infinity, -Infinity]);
}

/** The smallest of 1, 2, 5, 10, ... (and 0.5, ...) metres that takes at least so many pixels. */
export function roundLength(scale, pixels) {
  const least = pixels / scale;
  const power = 10 ** Math.floor(Math.log10(least));
  return power * [1, 2, 5, 10].find((m) => m * power >= least * (1 - 1e-9));
}
