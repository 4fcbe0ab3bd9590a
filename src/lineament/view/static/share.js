// Sharing: what is seen as a PNG, the scan as npz, the link.

import { fetched } from "./api.js";

const MARGIN = 12, LINE = 18; // of the words in a picture, pixels

export class Share {
  /** `app` knows what is seen; `report(error)` shows what went wrong. */
  constructor(app, dialog, report) {
    Object.assign(this, { app, dialog });
    this.link = dialog.querySelector("#link");
    this.status = dialog.querySelector("#shared");
    const jobs = {
      "save-png": () => this.#png(),
      "save-npz": () => this.#npz(),
      copy: () => this.#copy(),
    };
    for (const [id, job] of Object.entries(jobs)) {
      dialog.querySelector(`#${id}`).addEventListener("click", () => job().catch((error) => {
        dialog.close();
        report(error);
      }));
    }
  }

  open() {
    this.link.value = this.app.address;
    this.status.textContent = "";
    this.dialog.showModal();
  }

  get #name() {
    const { logName, panels } = this.app;
    return `${logName.split(/[/\\]/).at(-1).replace(/[^\w.-]+/g, "_")}-scan-${panels[0].scan.index}`;
  }

  async #png() {
    const picture = pictureOf(this.app);
    this.#save(await new Promise((done) => picture.toBlob(done)), `${this.#name}.png`);
  }

  async #npz() {
    const { log, panels } = this.app;
    const answer = await fetched("npz", { ...log, i: panels[0].scan.index });
    this.#save(await answer.blob(), `${this.#name}.npz`);
  }

  #save(blob, name) {
    const link = Object.assign(document.createElement("a"), { href: URL.createObjectURL(blob), download: name });
    link.click();
    setTimeout(() => URL.revokeObjectURL(link.href), 60000);
    this.status.textContent = `Saved ${name}`;
  }

  async #copy() {
    try {
      await navigator.clipboard.writeText(this.link.value);
    } catch {
      // Browsers give the clipboard to pages of this machine, and to those by https.
      this.link.select();
      document.execCommand("copy");
    }
    this.status.textContent = "Copied the link";
  }
}

/** The panels side by side (or one above another, as on the page) under what they show, in words. */
function pictureOf({ panels, theme, title }) {
  const ratio = window.devicePixelRatio || 1;
  const boxes = panels.map(({ canvas }) => canvas.getBoundingClientRect());
  const [left, top] = [Math.min(...boxes.map((box) => box.left)), Math.min(...boxes.map((box) => box.top))];
  const width = Math.max(...boxes.map((box) => box.right)) - left;
  const canvas = document.createElement("canvas"), ctx = canvas.getContext("2d");
  const font = (weight) => { ctx.font = `${weight} 13px system-ui, sans-serif`; };
  font("");
  const words = panels.flatMap(({ method, caption }) => wrapped(ctx, `${method}: ${caption.textContent}`, width - 2 * MARGIN));
  const head = LINE * (words.length + 1) + 1.5 * MARGIN;
  canvas.width = Math.round(width * ratio);
  canvas.height = Math.round((head + Math.max(...boxes.map((box) => box.bottom)) - top) * ratio);
  ctx.scale(ratio, ratio);
  ctx.fillStyle = theme.page;
  ctx.fillRect(0, 0, canvas.width, canvas.height);
  panels.forEach((panel, k) => ctx.drawImage(
    panel.canvas, boxes[k].left - left, head + boxes[k].top - top, boxes[k].width, boxes[k].height));
  ctx.fillStyle = theme.ink;
  font("bold");
  ctx.fillText(title, MARGIN, MARGIN + 0.6 * LINE, width - 2 * MARGIN);
  font("");
  ctx.fillStyle = theme.soft;
  words.forEach((line, k) => ctx.fillText(line, MARGIN, MARGIN + (k + 1.6) * LINE));
  return canvas;
}

function wrapped(ctx, text, width) {
  const lines = [""];
  for (const word of text.split(" ")) {
    const longer = `${lines.at(-1)} ${word}`.trim();
    if (ctx.measureText(longer).width <= width) lines[lines.length - 1] = longer;
    else lines.push(word);
  }
  return lines;
}
