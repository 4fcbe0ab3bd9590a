// The page: its state, and what happens when something changes.

import { addressOf, readAddress } from "./address.js";
import { Latest, ask } from "./api.js";
import { Pins, element, showWhy } from "./details.js";
import { readTheme } from "./drawing.js";
import { Drive } from "./drive.js";
import { placeBeams } from "./geometry.js";
import { listenToKeys } from "./keys.js";
import { Layers } from "./layers.js";
import { Panel } from "./panel.js";
import { Plane } from "./plane.js";
import { Share } from "./share.js";
import { Timeline } from "./timeline.js";
import { Topics } from "./topics.js";

const $ = (id) => document.getElementById(id);
const PATIENCE = 700; // milliseconds after which the page says what it waits for
const WAITING = "working …";
const POLL = 300; // milliseconds between two looks at how far the log is read
const REST = 300; // milliseconds without a change after which the address is written

class App {
  plane = new Plane();
  panels = [];
  number = 0; // of the log
  drive = null; // of the log
  plan = null; // walls [x1, y1, x2, y2], where there is one
  world = false; // the frame that is shown
  asked = null; // { panel, beam, index } that "why?" is about
  cursor = null; // { panel, point } of the pointer
  #loader = new Latest();
  #frame = 0;
  #writing = 0;
  #opening = null; // the log that is opened
  #wanted = {}; // of a link, until it is shown
  #fits = true; // nobody has moved the view since it was fitted

  async start() {
    this.theme = readTheme();
    Object.assign(this, await ask("logs"));
    const wanted = readAddress();
    $("log").append(...this.logs.map((name, k) => new Option(name, k)));
    $("log").hidden = this.logs.length < 2;
    $("name").hidden = !$("log").hidden;
    this.timeline = new Timeline(
      { slider: $("slider"), position: $("position"), play: $("play"), speed: $("speed") },
      (index) => this.load(index),
    );
    this.pins = new Pins($("pins"), $("unpin"), $("pins-hint"));
    this.layers = new Layers($("layers"), () => this.redraw());
    this.layers.hide(wanted.hidden);
    const { walls } = await ask("plan");
    if (walls.length) this.plan = walls;
    this.layers.offer(walls.length > 0, "plan", "pose");
    this.topics = new Topics($("topics"), (names) => this.chooseTopics(names).catch(fail));
    wanted.world ||= walls.length > 0 && !location.hash;
    $("sigmas").value = wanted.sigmas ?? "3";
    if (!$("sigmas").value) $("sigmas").value = "3";
    const methods = wanted.methods.filter((name) => this.methods.includes(name));
    for (const name of methods.length ? methods : [this.methods[0]]) this.addPanel(name);
    this.share = new Share(this, $("sharing"), fail);
    this.#listen();
    const number = wanted.log === undefined ? 0 : this.logs.indexOf(wanted.log);
    await this.open(Math.max(number, 0), number < 0 ? {} : wanted);
    if (number < 0) fail(new Error(`There is no log ${wanted.log} here.`));
  }

  /** The parameters by which questions name the log, and its topics. */
  get log() {
    return { log: this.number, ...this.topics.parameters };
  }

  get logName() {
    return this.logs[this.number];
  }

  /** Show a log, as a link wants it. */
  async open(number, wanted = {}) {
    const isWorld = wanted.world ?? this.world, opening = (this.#opening = {});
    this.drive?.close();
    this.#setWorld(false);
    Object.assign(this, { number, drive: null, asked: null });
    this.#wanted = { ...wanted, view: wanted.view ?? null };
    this.#fits = true;
    delete document.body.dataset.scan;
    $("log").value = number;
    $("name").textContent = this.logName;
    document.title = `${this.logName} – lineament`;
    for (const id of ["topic", "facts"]) $(id).textContent = "";
    for (const id of ["problem", "reading"]) $(id).hidden = true;
    for (const panel of this.panels) panel.clear();
    this.#offerWorld({ posed: 0, complete: false });
    this.topics.offer({ topics: [], chosen: [] }, this.theme);
    this.redraw();
    const offered = await ask("topics", { log: number });
    if (opening !== this.#opening) return; // another log was opened meanwhile
    this.topics.offer(offered, this.theme, wanted.topics);
    this.layers.offer(this.topics.chosen.length > 1, "scanners");
    const drive = (this.drive = new Drive(this.log));
    this.timeline.open(this.log);
    try {
      await this.follow(wanted.scan ?? 0, isWorld);
    } catch (error) {
      if (drive === this.drive) throw error; // no other log was opened meanwhile
    }
  }

  /** Follow how far the log is read; show the first scan, or that of the address, once it is. */
  async follow(scan, isWorld) {
    const { drive } = this;
    for (let shown = false; ;) {
      const log = await ask("log", drive.log);
      if (drive !== this.drive) return; // another log was opened
      this.timeline.grow(log.scans);
      this.#offerWorld(log);
      if (!shown && log.scans > 0 && (scan < log.scans || log.complete)) {
        shown = true;
        if (isWorld && log.posed) this.#setWorld(true);
        this.timeline.go(scan).catch(fail);
      }
      $("reading").hidden = log.complete;
      $("progress").max = log.total || 1;
      $("progress").value = log.scans;
      $("read").textContent = `reading: ${log.scans} of ${log.total ?? "…"} scans`;
      if (log.complete) return this.#complete(log);
      await new Promise((next) => setTimeout(next, POLL));
    }
  }

  #complete(log) {
    const skipped = log.skipped ? `; ${log.skipped} faults left out, the first: ${log.faults[0]}` : "";
    $("facts").textContent = `${log.format}, ${log.scans} scans${skipped}`;
    if (log.error) fail(new Error(`The log was read up to scan ${log.scans - 1}: ${log.error}`));
  }

  /** Show other topics of the log, at the same time as before. */
  chooseTopics(names) {
    const { scan, size } = this.panels[0], { plane, world } = this;
    const part = scan?.parts?.find(({ topic }) => topic === names[0]);
    const view = this.#fits ? undefined : [plane.x, plane.y, plane.span(size)];
    return this.open(this.number, { topics: names, scan: part?.index ?? this.timeline.index, world, view });
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
      const panels = [...this.panels], { log, drive } = this;
      let loaded = false;
      const waiting = setInterval(async () => {
        const { compiling } = await ask("log", log).catch(() => ({}));
        if (loaded) return;
        for (const panel of panels) panel.caption.textContent = compiling || WAITING;
      }, PATIENCE);
      try {
        const scans = await Promise.all(
          panels.map((panel) => ask("scan", { ...log, i: index, method: panel.method })));
        if (drive !== this.drive) return;
        scans.forEach((scan, k) => {
          for (const part of scan.parts ?? []) {
            placeBeams(part);
            part.number = this.topics.names.indexOf(part.topic);
          }
          placeBeams(scan);
          panels[k].show(scan);
          panels[k].place(this.world);
        });
        this.#loaded(index);
      } finally {
        loaded = true;
        clearInterval(waiting);
      }
    });
  }

  #loaded(index) {
    const { scan, frame, size } = this.panels[0], { view, beam } = this.#wanted;
    $("problem").hidden = true;
    const { where } = scan, percent = (share) => `${Math.round(100 * share)} %`;
    const verdict = where && `${where.verdict}: ${percent(where.explained)} explained, ${percent(where.contradicted)} contradicted; `;
    const alone = scan.missing?.length ? ` (none of ${scan.missing.join(", ")} at this time)` : "";
    $("topic").textContent = `${verdict ?? ""}${scan.topic}${alone} in `;
    if (this.asked && this.asked.index !== index) this.asked = null;
    document.body.dataset.scan = index;
    if (view) this.look(() => this.plane.look(view, size));
    else if (view === null) this.fit();
    else if (frame && !this.#fits && this.world && !this.panels[0].isSensorInside) {
      Object.assign(this.plane, { x: frame.x, y: frame.y }); // the view moves on with the sensor
    }
    this.#wanted = {};
    if (beam < scan.beams) this.explain(this.panels[0], beam);
    this.redraw();
  }

  /** Show the whole scan; in the world, the whole drive. */
  fit() {
    const [{ scan, outline, size }] = this.panels;
    if (!scan || !size.width) return;
    this.#fits = true;
    const points = [...outline, ...(this.world ? [...this.drive.outline, ...(this.plan ?? [])] : [])];
    this.plane.fit(points.length ? points : [[0, 0]], size);
    this.redraw();
  }

  /** Change what the panels show of the plane. */
  look(change) {
    change();
    this.#fits = false;
    this.redraw();
  }

  zoom(factor) {
    const { size } = this.panels[0];
    this.look(() => this.plane.zoom(factor, [size.width / 2, size.height / 2], size));
  }

  move(du, dv) {
    this.look(() => this.plane.move(du, dv));
  }

  resized() {
    if (this.#fits) this.fit();
    else this.redraw();
  }

  #offerWorld({ posed, complete }) {
    const button = $("world");
    button.disabled = !posed;
    button.title = posed ? "The scan in the world frame, with the drive behind it (w)"
      : complete ? "This log has no poses (those of a ROS log may be in a topic: --poses TOPIC)"
        : "No poses have been read so far";
    $("no-poses").hidden = !complete || posed > 0;
  }

  #setWorld(isWorld) {
    this.world = isWorld;
    $("world").setAttribute("aria-pressed", isWorld);
    this.layers.allowDrive(isWorld);
    for (const panel of this.panels) panel.place(isWorld);
    const { drive } = this;
    if (isWorld) drive.load(() => this.resized()).catch((error) => drive === this.drive && fail(error));
  }

  redraw() {
    this.#frame ||= requestAnimationFrame(() => {
      this.#frame = 0;
      for (const panel of this.panels) panel.draw();
    });
    // Browsers refuse to change the address many times a second.
    clearTimeout(this.#writing);
    this.#writing = setTimeout(() => {
      if (document.body.dataset.scan) history.replaceState(null, "", this.address);
    }, REST);
  }

  /** The address of what is seen. */
  get address() {
    const { asked, plane, panels, logs } = this;
    return addressOf({
      log: logs.length > 1 ? this.logName : undefined,
      topics: this.topics.names.length ? this.topics.chosenNames : undefined,
      scan: this.timeline.index,
      methods: panels.map((panel) => panel.method),
      hidden: this.layers.hidden,
      sigmas: $("sigmas").value,
      world: this.world,
      view: [plane.x, plane.y, plane.span(panels[0].size)],
      beam: asked?.panel === panels[0] ? asked.beam : undefined,
    });
  }

  /** What is seen, in words. */
  get title() {
    return `${this.logName} · ${$("position").textContent}${this.world ? " · world frame" : ""}`;
  }

  get sigmas() {
    return Number($("sigmas").value);
  }

  async explain(panel, beam) {
    const { index, method, parts } = panel.scan, { log, drive } = this;
    // What is merged is not explained, but what a scanner has measured.
    const own = parts?.find(({ numbers }) => numbers.includes(beam));
    const which = own ? { topics: own.number, i: own.index, beam: own.numbers.indexOf(beam) } : { i: index, beam };
    try {
      const answer = await ask("trace", { ...log, method, ...which });
      if (own) answer.summary = `${own.topic}, its beam ${which.beam}: ${answer.summary}`;
      if (drive !== this.drive || panel.scan?.index !== index || panel.scan.method !== method) return;
      this.asked = { panel, beam, index };
      this.redraw();
      $("problem").hidden = true;
      showWhy($("why"), answer);
      panel.card.querySelector(".why")?.remove();
      panel.card.append(element("p", answer.summary, "why"));
    } catch (error) {
      fail(error);
    }
  }

  #listen() {
    $("sigmas").addEventListener("change", () => this.redraw());
    $("log").addEventListener("change", () => this.open(Number($("log").value)).catch(fail));
    $("ask").addEventListener("submit", (event) => {
      event.preventDefault();
      if (this.panels[0].scan) this.explain(this.panels[0], $("beam").valueAsNumber);
      $("beam").blur();
    });
    const clicks = {
      compare: () => this.compare(),
      world: () => {
        this.#setWorld(!this.world);
        this.fit();
      },
      fit: () => this.fit(),
      "zoom-in": () => this.zoom(1.3),
      "zoom-out": () => this.zoom(1 / 1.3),
      share: () => this.panels[0].scan && this.share.open(),
      help: () => $("keys").showModal(),
    };
    for (const [id, click] of Object.entries(clicks)) $(id).addEventListener("click", click);
    for (const dialog of document.querySelectorAll("dialog")) {
      dialog.querySelector(".close").addEventListener("click", () => dialog.close());
      // A click beside it closes it, too.
      dialog.addEventListener("click", (event) => event.target === dialog && dialog.close());
    }
    matchMedia("(prefers-color-scheme: dark)").addEventListener("change", () => {
      this.theme = readTheme();
      this.topics.paint(this.theme);
      this.redraw();
    });
    addEventListener("hashchange", () => location.reload());
    listenToKeys(this, $("key-list"));
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
