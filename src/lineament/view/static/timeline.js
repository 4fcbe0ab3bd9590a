// The timeline: which scan, and playing at the speed of the stamps.

import { ask } from "./api.js";

const BLOCK = 4096; // stamps of one question, the most that the server gives
const LONGEST = 5; // seconds; a longer step, or one back, is played as a usual one
const USUAL = 0.1;

/** The stamps of the log, asked for when they are needed. */
class Stamps {
  #blocks = new Map();

  constructor(log) {
    this.log = log;
  }

  async at(index, count) {
    const first = Math.floor(index / BLOCK) * BLOCK;
    let block = this.#blocks.get(first);
    // A block that was asked for while the log was being read may have grown.
    if (!block || (index - first >= block.length && index < count)) {
      block = (await ask("stamps", { ...this.log, first, count: BLOCK })).stamps;
      if (this.#blocks.size > 64) this.#blocks.clear();
      this.#blocks.set(first, block);
    }
    return block[index - first];
  }

  /** Seconds from a scan to the next. */
  async step(index, count) {
    const step = (await this.at(index + 1, count)) - (await this.at(index, count));
    return step > 0 && step <= LONGEST ? step : USUAL;
  }
}

export class Timeline {
  index = 0;
  count = 1;
  playing = false;
  #stamps = null;

  /** `show(index)` shows a scan, and is done when it is there. */
  constructor({ slider, position, play, speed }, show) {
    Object.assign(this, { slider, position, button: play, speed, show });
    slider.addEventListener("input", () => this.go(slider.valueAsNumber));
    play.addEventListener("click", () => this.toggle());
  }

  /** Begin another log, which questions name by parameters. */
  open(log) {
    if (this.playing) this.toggle();
    this.#stamps = new Stamps(log);
    this.index = this.slider.value = 0;
    this.position.textContent = "";
    this.count = 1;
  }

  /** The log has so many scans, as far as it was read. */
  grow(count) {
    this.count = Math.max(count, 1);
    this.slider.max = this.count - 1;
    this.#label();
  }

  async go(index) {
    this.index = Math.min(Math.max(index, 0), this.count - 1);
    this.slider.value = this.index;
    this.#label();
    await this.show(this.index);
  }

  async #label() {
    const { index, count } = this, stamps = this.#stamps;
    let text = `scan ${index} / ${count - 1}`;
    try {
      const time = (await stamps.at(index, count)) - (await stamps.at(0, count));
      if (Number.isFinite(time)) text += `, ${time.toFixed(2)} s`;
    } catch {
      // Showing the scan reports what is wrong.
    }
    if (index !== this.index || stamps !== this.#stamps) return;
    this.position.textContent = text;
    this.slider.setAttribute("aria-valuetext", text);
  }

  toggle() {
    this.playing = !this.playing;
    this.button.textContent = this.playing ? "❚❚" : "▶";
    this.button.setAttribute("aria-label", this.playing ? "Pause" : "Play");
    if (this.playing) this.#play();
  }

  async #play() {
    if (this.index >= this.count - 1) await this.go(0);
    let before = performance.now(), ahead = 0;
    try {
      while (this.playing && this.index < this.count - 1) {
        const now = await new Promise((next) => requestAnimationFrame(next));
        ahead += Math.min(Math.max(now - before, 0) / 1000, 0.25) * this.speed.value;
        before = now;
        let index = this.index;
        // Of scans that come faster than they can be shown, some are left out.
        while (index < this.count - 1) {
          const step = await this.#stamps.step(index, this.count);
          if (step > ahead) break;
          ahead -= step;
          index++;
        }
        if (index !== this.index) await this.go(index);
      }
    } finally {
      if (this.playing) this.toggle();
    }
  }
}
