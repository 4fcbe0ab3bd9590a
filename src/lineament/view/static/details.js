// Features in numbers: the card at the pointer, the pinned table, the answer to "why?".

import { ellipseOf, isKnown } from "./geometry.js";

const degrees = (radians) => (radians * 180) / Math.PI;
const fixed = (value, digits) => (Number.isFinite(value) ? value.toFixed(digits) : "–");
const millimetres = (metres) => fixed(metres === null ? NaN : 1000 * metres, 1);
const place = ([x, y]) => `${fixed(x, 3)}, ${fixed(y, 3)}`;
const root = (variance) => (variance === null ? NaN : Math.sqrt(Math.max(variance, 0)));

/** Deviations along the axes of an ellipse [mm], and the direction of the longer one [°]. */
function spreadOf(covariance) {
  const unknown = { major: NaN, minor: NaN, direction: NaN };
  const { major, minor, direction } = isKnown(covariance) ? ellipseOf(covariance) : unknown;
  return { axes: `${millimetres(major)} ×\u00a0${millimetres(minor)}`, longer: fixed(degrees(direction), 0) };
}

/** Numbers of a feature: title, rows for the card, and cells for the table. */
export function describe({ kind, index, feature }, scan) {
  const title = kind === "measurement" ? `beam ${index}` : `${kind} ${index}`;
  return { title, ...WORDS[kind](feature, scan) };
}

const WORDS = {
  segment(s) {
    const offset = root(s.covariance[0][0]), turn = degrees(root(s.covariance[1][1]));
    return {
      rows: [
        ["start", `${place(s.start)} m`],
        ["end", `${place(s.end)} m`],
        ["length", `${fixed(s.length, 3)} m`],
        ["angle", `${fixed(degrees(s.angle), 2)}° ± ${fixed(turn, 2)}°`],
        ["offset", `± ${millimetres(offset)} mm at ${place(s.centroid)} m`],
        ["beams", `${s.first_beam} to ${s.last_beam}, ${s.n_points} measurements`],
        ["rms", `${millimetres(s.rms)} mm`],
        ["misfit", `${millimetres(s.misfit)} mm`],
        ["cluster", s.cluster],
      ],
      cells: [
        place(s.centroid), fixed(s.length, 3), `${fixed(degrees(s.angle), 2)} ±\u00a0${fixed(turn, 2)}`,
        millimetres(offset), millimetres(s.rms),
      ],
    };
  },
  corner(c) {
    const { axes, longer } = spreadOf(c.covariance), opening = fixed(degrees(c.opening), 1);
    return {
      rows: [
        ["kind", c.kind],
        ["quality", fixed(c.quality, 2)],
        ["position", `${place(c.position)} m`],
        ["1 σ", `${axes} mm, longer at ${longer}°`],
        ["opening", `${opening}°, ${c.convex ? "convex" : "concave"}`],
        ["beam", c.beam],
        ["response", c.response === null ? "–" : Number(c.response.toPrecision(4))],
        ["segments", c.segments.map((k) => (k < 0 ? "none" : k)).join(" and ")],
      ],
      cells: [place(c.position), "", opening, axes, ""],
    };
  },
  edge(e) {
    const { axes, longer } = spreadOf(e.covariance);
    return {
      rows: [
        ["quality", fixed(e.quality, 2)],
        ["position", `${place(e.position)} m`],
        ["1 σ", `${axes} mm, longer at ${longer}°`],
        ["beam", e.beam],
        ["segment", `${e.segment}, its ${e.side}`],
      ],
      cells: [place(e.position), "", "", axes, ""],
    };
  },
  arc(a) {
    const sigma = root(a.covariance[2][2]);
    return {
      rows: [
        ["centre", `${place(a.center)} m`],
        ["radius", `${fixed(a.radius, 3)} m ± ${millimetres(sigma)} mm`],
        ["beams", `${a.first_beam} to ${a.last_beam}, ${a.n_points} measurements`],
        ["rms", `${millimetres(a.rms)} mm`],
      ],
      cells: [place(a.center), fixed(a.radius, 3), "", millimetres(sigma), millimetres(a.rms)],
    };
  },
  breakpoint(b) {
    return {
      rows: [
        ["kind", b.kind.replace("_", " ")],
        ["position", `${place(b.position)} m`],
        ["beams", b.beam.map((i) => (i < 0 ? "end" : i)).join(" and ")],
        ["nearer side", b.occluder < 0 ? "none" : `beam ${b.occluder}`],
      ],
      cells: [place(b.position), "", "", "", ""],
    };
  },
  measurement({ beam }, scan) {
    const cluster = scan.clusters[beam];
    return {
      rows: [
        ["range", `${fixed(scan.ranges[beam], 3)} m`],
        ["bearing", `${fixed(degrees(scan.bearings[beam]), 2)}°`],
        ["position", `${place(scan.points[beam])} m`],
        ["cluster", cluster < 0 ? "none" : cluster],
      ],
    };
  },
};

export function element(tag, text = "", className = "") {
  return Object.assign(document.createElement(tag), { textContent: text, className });
}

/** A list of names and values. */
export function listOf(rows) {
  const list = element("dl");
  for (const [name, value] of rows) list.append(element("dt", name), element("dd", value));
  return list;
}

/** Show what became of a beam. */
export function showWhy(box, { index, method, beam, summary, steps }) {
  const title = element("h3", `beam ${beam}, scan ${index}, ${method}`);
  box.replaceChildren(title, element("p", summary, "summary"), listOf(steps));
}

/** Features that were clicked on, in a table. */
export class Pins {
  constructor(table, clear, hint) {
    Object.assign(this, { table, clear, hint, body: table.tBodies[0] });
    clear.addEventListener("click", () => {
      this.body.replaceChildren();
      this.#update();
    });
  }

  add(picked, scan) {
    const { title, cells } = describe(picked, scan);
    const row = element("tr"), name = element("td", title);
    row.dataset.key = `${title} ${scan.index} ${scan.method}`;
    if ([...this.body.rows].some((other) => other.dataset.key === row.dataset.key)) return;
    name.append(element("small", `scan ${scan.index}, ${scan.method}`));
    const remove = element("button", "×"), last = element("td");
    remove.setAttribute("aria-label", `Remove ${title} of scan ${scan.index}`);
    remove.addEventListener("click", () => {
      row.remove();
      this.#update();
    });
    last.append(remove);
    row.append(name, ...cells.map((cell) => element("td", cell)), last);
    this.body.prepend(row);
    this.#update();
  }

  #update() {
    const empty = this.body.rows.length === 0;
    this.table.hidden = this.clear.hidden = empty;
    this.hint.hidden = !empty;
  }
}
