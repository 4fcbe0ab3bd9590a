// The view of the plane that all panels share: metres to pixels.

const LEAST_SCALE = 0.2, MOST_SCALE = 50000; // pixels a metre

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
    this.scale = Math.min(Math.max(this.scale * factor, LEAST_SCALE), MOST_SCALE);
    const after = this.toMetres(pixel, size);
    this.x += before[0] - after[0];
    this.y += before[1] - after[1];
  }

  /** Show all of these points, and the sensor. */
  fit(points, { width, height }) {
    const xs = [0, ...points.map((p) => p[0])], ys = [0, ...points.map((p) => p[1])];
    const [left, right] = extent(xs), [bottom, top] = extent(ys);
    this.x = (left + right) / 2;
    this.y = (bottom + top) / 2;
    const scale = 0.9 * Math.min(width / (right - left || 1), height / (top - bottom || 1));
    this.scale = Math.min(Math.max(scale, LEAST_SCALE), MOST_SCALE);
  }
}

function extent(values) {
  return values.reduce(([low, high], v) => [Math.min(low, v), Math.max(high, v)], [0, 0]);
}

/** The smallest of 1, 2, 5, 10, ... (and 0.5, ...) metres that takes at least so many pixels. */
export function roundLength(scale, pixels) {
  const least = pixels / scale;
  const power = 10 ** Math.floor(Math.log10(least));
  return power * [1, 2, 5, 10].find((m) => m * power >= least * (1 - 1e-9));
}
