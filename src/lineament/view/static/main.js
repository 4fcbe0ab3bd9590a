// The page: its state, and what happens when something changes.

import { Latest, ask } from "./api.js";
import { Pins, showWhy } from "./details.js";
import { placeBeams, readTheme } from "./drawing.js";
import { Panel } from "./panel.js";
import { Plane } from "./plane.js";
import { Timeline } from "./timeline.js";

const $ = (id) => document.getElementById(id);
const LAYERS = ["clusters", "segments", "corners", "edges", "arcs", "breakpoints"];
const NARROW = "(max-width: 60rem)"; // where the answers stand below the panels
const PATIENCE = 700; // milliseconds after which the page says what it waits for
const WAITING = "working …";

class App {
  plane = new Plane();
  panels = [];
  asked = null; // { panel, beam } that "why?" is about
  cursor = null; // { panel, point } of the pointer
  #loader = new Latest();
  #frame = 0;
  #fitted = false;

  async start() {
    this.theme = readTheme();
    const log = await ask("log");
    const hash = new URLSearchParams(location.hash.slice(1));
    this.methods = log.methods;
    document.title = `${log.name} – lineament`;
    $("name").textContent = log.name;
    $("facts").textContent = ` in ${log.format}`;
    this.timeline = new Timeline(
      { slider: $("slider"), position: $("position"), play: $("play"), speed: $("speed") },
      (index) => this.load(index),
    );
    this.pins = new Pins($("pins"), $("unpin"), $("pins-hint"));
    const known = (name) => (this.methods.includes(name) ? name : null);
    this.addPanel(known(hash.get("method")) ?? this.methods[0]);
    if (known(hash.get("with"))) this.addPanel(hash.get("with"));
    this.#listen();
    await this.follow(Number(hash.get("scan")) || 0);
  }

  /** Follow how far the log is read; show the first scan, or that of the address, once it is. */
  async follow(wanted) {
    for (let shown = false; ;) {
      const log = await ask("log");
      this.timeline.grow(log.scans);
      if (!shown && log.scans > 0 && (wanted < log.scans || log.complete)) {
        shown = true;
        this.timeline.go(wanted).catch(fail);
      }
      $("reading").hidden = log.complete;
      $("progress").max = log.total || 1;
      $("progress").value = log.scans;
      $("read").textContent = `reading: ${log.scans} of ${log.total ?? "…"} scans`;
      if (log.complete) return this.#complete(log);
      await new Promise((next) => setTimeout(next, 300));
    }
  }

  #complete(log) {
    const skipped = log.skipped ? `; ${log.skipped} faults left out, the first: ${log.faults[0]}` : "";
    $("facts").textContent += `, ${log.scans} scans${skipped}`;
    if (log.error) fail(new Error(`The log was read up to scan ${log.scans - 1}: ${log.error}`));
  }

  addPanel(method) {
    this.panels.push(new Panel(this, method));
    $("panels").append(this.panels.at(-1).element);
    $("compare").setAttribute("aria-pressed", this.panels.length > 1);
  }

  compare() {
    if (this.panels.length > 1) {
      const removed = this.panels.pop();
      removed.remove();
      if (this.asked?.panel === removed) this.asked = null;
      $("compare").setAttribute("aria-pressed", false);
    } else {
      const first = this.panels[0].method;
      this.addPanel(this.methods.find((name) => name !== first) ?? first);
    }
    this.changeMethod();
  }

  changeMethod() {
    return this.load(this.timeline.index).catch(fail);
  }

  /** Load a scan into all panels; of several that are asked for at once, the last. */
  load(index) {
    return this.#loader.run(async () => {
      const panels = [...this.panels];
      let loaded = false;
      const waiting = setInterval(async () => {
        const { compiling } = await ask("log").catch(() => ({}));
        if (loaded) return;
        for (const panel of panels) panel.caption.textContent = compiling || WAITING;
      }, PATIENCE);
      try {
        const asked = panels.map((panel) => ask("scan", { i: index, method: panel.method }));
        (await Promise.all(asked)).forEach((scan, k) => {
          placeBeams(scan);
          panels[k].show(scan);
        });
        this.#loaded(index);
      } finally {
        loaded = true;
        clearInterval(waiting);
      }
    });
  }

  #loaded(index) {
    $("problem").hidden = true;
    $("topic").textContent = this.panels[0].scan.topic;
    if (this.asked && this.asked.index !== index) this.asked = null;
    if (!this.#fitted) this.fit();
    this.redraw();
    const names = this.panels.map((panel) => panel.method);
    const hash = new URLSearchParams({ scan: index, method: names[0] });
    if (names[1]) hash.set("with", names[1]);
    history.replaceState(null, "", `#${hash}`);
    document.body.dataset.scan = index;
  }

  fit() {
    const [panel] = this.panels;
    if (!panel.scan || !panel.size.width) return;
    this.#fitted = true;
    // Lone measurements may lie anywhere.
    const { points, clusters } = panel.scan;
    const clustered = points.filter((point, i) => point && clusters[i] >= 0);
    this.plane.fit(clustered.length ? clustered : points.filter(Boolean), panel.size);
    this.redraw();
  }

  zoom(factor) {
    const { width, height } = this.panels[0].size;
    this.plane.zoom(factor, [width / 2, height / 2], { width, height });
    this.redraw();
  }

  resized() {
    if (this.#fitted) this.redraw();
    else this.fit();
  }

  redraw() {
    this.#frame ||= requestAnimationFrame(() => {
      this.#frame = 0;
      for (const panel of this.panels) panel.draw();
    });
  }

  async explain(panel, beam) {
    const { index, method } = panel.scan;
    try {
      const answer = await ask("trace", { i: index, method, beam });
      if (panel.scan.index !== index || panel.scan.method !== method) return;
      this.asked = { panel, beam, index };
      this.redraw();
      $("problem").hidden = true;
      showWhy($("why"), answer);
      if (matchMedia(NARROW).matches) $("why").scrollIntoView({ block: "nearest" });
    } catch (error) {
      fail(error);
    }
  }

  #listen() {
    for (const id of [...LAYERS.map((name) => `show-${name}`), "sigmas"]) {
      $(id).addEventListener("change", () => this.redraw());
    }
    $("ask").addEventListener("submit", (event) => {
      event.preventDefault();
      if (this.panels[0].scan) this.explain(this.panels[0], $("beam").valueAsNumber);
    });
    const clicks = {
      compare: () => this.compare(),
      fit: () => this.fit(),
      "zoom-in": () => this.zoom(1.3),
      "zoom-out": () => this.zoom(1 / 1.3),
    };
    for (const [id, click] of Object.entries(clicks)) $(id).addEventListener("click", click);
    matchMedia("(prefers-color-scheme: dark)").addEventListener("change", () => {
      this.theme = readTheme();
      this.redraw();
    });
    document.addEventListener("keydown", (event) => this.#key(event));
  }

  get shown() {
    return Object.fromEntries(LAYERS.map((name) => [name, $(`show-${name}`).checked]));
  }

  get sigmas() {
    return Number($("sigmas").value);
  }

  #key(event) {
    if (event.ctrlKey || event.metaKey || event.altKey) return;
    // What takes keys itself keeps them; buttons and boxes take the space bar only.
    if (event.target.closest("select, input[type=number]")) return;
    if (event.key === " " && event.target.closest("button, summary, input[type=checkbox]")) return;
    const { timeline } = this, step = event.shiftKey ? 10 : 1;
    const keys = {
      " ": () => timeline.toggle(),
      ArrowLeft: () => timeline.go(timeline.index - step),
      ArrowRight: () => timeline.go(timeline.index + step),
      Home: () => timeline.go(0),
      End: () => timeline.go(timeline.count - 1),
      "+": () => this.zoom(1.3),
      "=": () => this.zoom(1.3),
      "-": () => this.zoom(1 / 1.3),
      f: () => this.fit(),
    };
    if (!keys[event.key]) return;
    event.preventDefault();
    keys[event.key]();
  }
}

function fail(error) {
  $("problem").textContent = error.message;
  $("problem").hidden = false;
}

// Whatever nobody else has caught.
addEventListener("unhandledrejection", (event) => {
  event.preventDefault();
  fail(event.reason);
});
export const app = new App();
app.start().catch(fail);
