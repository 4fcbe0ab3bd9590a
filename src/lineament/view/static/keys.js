// The keyboard: all that can be clicked.

import { element } from "./details.js";

const click = (id) => () => document.getElementById(id).click();
const step = (by) => ({ timeline }, { shiftKey }) => timeline.go(timeline.index + by * (shiftKey ? 10 : 1));
const pan = (x, y) => (app) => app.move(80 * x, 80 * y);

/** Choose the next option of a list, or the one before; round at the ends. */
function turn(list, by) {
  if (!list || list.hidden) return;
  list.selectedIndex = (list.selectedIndex + by + list.length) % list.length;
  list.dispatchEvent(new Event("change"));
}
const next = (find, by = 1) => (app) => turn(find(app), by);
const list = (id) => () => document.getElementById(id);

/** Keys as events name them; what the help calls them, and what they do. */
const KEYS = [
  [[" "], "space", "play, pause", click("play")],
  [["ArrowLeft"], "←", "a scan back; with shift, ten", step(-1)],
  [["ArrowRight"], "→", "a scan on; with shift, ten", step(1)],
  [["Home"], "home", "first scan", ({ timeline }) => timeline.go(0)],
  [["End"], "end", "last scan", ({ timeline }) => timeline.go(timeline.count - 1)],
  [["."], ".", "play faster", next(list("speed"))],
  [[","], ",", "play slower", next(list("speed"), -1)],
  [["["], "[", "the log before", next(list("log"), -1)],
  [["]"], "]", "the next log", next(list("log"))],
  [["t"], "t", "one scanner of several after the other, then all", ({ topics }) => topics.turn()],
  [["m"], "m", "the next method", next((app) => app.panels[0].select)],
  [["M"], "M", "the method before", next((app) => app.panels[0].select, -1)],
  [["c"], "c", "compare two methods, or stop", click("compare")],
  [["n"], "n", "the next method of the second panel", next((app) => app.panels[1]?.select)],
  [["N"], "N", "the method before, there", next((app) => app.panels[1]?.select, -1)],
  [[..."123456789"], "1 … 9", "show or hide a layer, in the order of the boxes",
    (app, { key }) => app.layers.toggle(key - 1)],
  [["v"], "v", "size of the covariances", next(list("sigmas"))],
  [["w"], "w", "world frame, scan frame", click("world")],
  [["f"], "f", "fit: show all", click("fit")],
  [["+", "="], "+", "zoom in; also wheel or pinch", click("zoom-in")],
  [["-"], "−", "zoom out", click("zoom-out")],
  [["h"], "h", "move to the left; also drag", pan(1, 0)],
  [["j"], "j", "move down", pan(0, -1)],
  [["k"], "k", "move up", pan(0, 1)],
  [["l"], "l", "move to the right", pan(-1, 0)],
  [["b"], "b", "type a beam to ask about", () => document.getElementById("beam").focus()],
  [["u"], "u", "clear what is pinned", click("unpin")],
  [["s"], "s", "share", click("share")],
  [["?"], "?", "these keys", click("help")],
];

/** Listen for keys, and list them in a table of the page. */
export function listenToKeys(app, help) {
  help.append(...KEYS.flatMap(([, name, text]) => {
    const term = element("dt");
    term.append(element("kbd", name));
    return [term, element("dd", text)];
  }));
  document.addEventListener("keydown", (event) => {
    if (event.ctrlKey || event.metaKey || event.altKey || document.querySelector("dialog[open]")) return;
    // What takes keys itself keeps them; buttons and boxes take the space bar only.
    if (event.target.closest("select, input[type=number]")) return;
    if (event.key === " " && event.target.closest("button, input[type=checkbox]")) return;
    const row = KEYS.find(([keys]) => keys.includes(event.key));
    if (!row) return;
    event.preventDefault();
    row[3](app, event);
  });
}
