// The scanners of a log: which are shown, one alone or several over each other.

import { element } from "./details.js";
import { colorOf } from "./drawing.js";

export class Topics {
  names = []; // none where there is no choice
  chosen = []; // their numbers
  #alone = []; // why a scanner cannot be shown over others, "" where it can
  #choose;

  /** `choose(names)` shows the scanners of these topics. */
  constructor(place, choose) {
    this.place = place;
    this.#choose = choose;
  }

  get parameters() {
    return this.names.length ? { topics: this.chosen.join(",") } : {};
  }

  get chosenNames() {
    return this.chosen.map((k) => this.names[k]);
  }

  /** Offer topics as the server names them; choose those that are wanted, if they are there. */
  offer({ topics, chosen }, theme, wanted = []) {
    this.names = topics.map(({ name }) => name);
    this.#alone = topics.map(({ alone }) => alone);
    const known = wanted.map((name) => this.names.indexOf(name)).filter((k) => k >= 0);
    this.chosen = known.length === 1 || this.#fit(known) ? known : chosen;
    this.place.hidden = !topics.length;
    this.place.replaceChildren(...topics.map(({ name, alone }, k) => {
      const box = Object.assign(element("input"), { type: "checkbox", checked: this.chosen.includes(k) });
      const chip = element("label");
      chip.title = alone || "Show this scanner, over the others (t)";
      chip.append(box, element("i", "", "key"), name);
      box.addEventListener("change", () => this.#switch(k));
      return chip;
    }));
    const why = this.chosen.length < 2 && this.#alone.find(Boolean);
    if (why) this.place.append(element("span", why, "hint"));
    this.paint(theme);
  }

  /** Give each the colour in which it is drawn. */
  paint(theme) {
    this.place.querySelectorAll(".key").forEach((key, k) => { key.style.background = colorOf(k, theme); });
  }

  /** Each scanner alone, one after the other; then all that can be shown together. */
  turn() {
    const every = this.names.map((_, k) => k), together = every.filter((k) => !this.#alone[k]);
    const ways = [...every.map((k) => [k]), ...(this.#fit(together) ? [together] : [])];
    const now = ways.findIndex((way) => way.join() === this.chosen.join());
    if (ways.length) this.#show(ways[(now + 1) % ways.length]);
  }

  // Whether several scanners can be shown over each other.
  #fit(numbers) {
    return numbers.length > 1 && numbers.every((k) => !this.#alone[k]);
  }

  #switch(k) {
    const others = this.chosen.filter((n) => n !== k);
    const wanted = this.chosen.includes(k) ? others : [...others, k].sort((a, b) => a - b);
    this.#show(wanted.length === 1 || this.#fit(wanted) ? wanted : [k]);
  }

  #show(numbers) {
    this.#choose(numbers.map((k) => this.names[k]));
  }
}
