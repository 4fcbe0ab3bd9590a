// The view of the plane that all panels share: metres to pixels, and the grid.

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

export function drawGrid(ctx, plane, size, theme) {
  const step = roundLength(plane.scale, 56);
  const line = (isAxis, ...ends) => {
    ctx.strokeStyle = isAxis ? theme.axis : theme.grid;
    trace(ctx, ends);
    ctx.stroke();
  };
  const [left, top] = plane.toMetres([0, 0], size);
  const [right, bottom] = plane.toMetres([size.width, size.height], size);
  ctx.lineWidth = 1;
  for (let k = Math.ceil(left / step); k * step <= right; k++) {
    const u = Math.round(plane.toPixels([k * step, 0], size)[0]) + 0.5;
    line(k === 0, [u, 0], [u, size.height]);
  }
  for (let k = Math.ceil(bottom / step); k * step <= top; k++) {
    const v = Math.round(plane.toPixels([0, k * step], size)[1]) + 0.5;
    line(k === 0, [0, v], [size.width, v]);
  }
}

export function drawScaleBar(ctx, plane, size, theme) {
  const length = roundLength(plane.scale, 70);
  const u = 14.5, v = size.height - 14.5, w = length * plane.scale;
  ctx.lineWidth = 1.5;
  ctx.strokeStyle = ctx.fillStyle = theme.ink;
  trace(ctx, [[u, v - 5], [u, v], [u + w, v], [u + w, v - 5]]);
  ctx.stroke();
  ctx.font = "12px system-ui, sans-serif";
  ctx.textAlign = "left";
  ctx.fillText(metresText(length), u + 6, v - 6);
}

function metresText(metres) {
  if (metres >= 1) return `${metres} m`;
  return metres >= 0.01 ? `${Math.round(metres * 100)} cm` : `${+(metres * 1000).toPrecision(1)} mm`;
}

/** Begin a path through pixels. */
export function trace(ctx, pixels) {
  ctx.beginPath();
  pixels.forEach(([u, v], k) => (k ? ctx.lineTo(u, v) : ctx.moveTo(u, v)));
}
