// What the page's address says after the #, so that a link shows the same.

const numbers = (text) => (text ?? "").split(",").map(Number);

/** What a link asks for; undefined where it says nothing that makes sense. */
export function readAddress() {
  const said = new URLSearchParams(location.hash.slice(1)), view = numbers(said.get("view"));
  const whole = (name) => (/^\d{1,9}$/.test(said.get(name) ?? "") ? Number(said.get(name)) : undefined);
  return {
    log: said.get("log") ?? undefined,
    topics: said.get("topics")?.split(","),
    scan: whole("scan"),
    methods: [said.get("method"), said.get("with")].filter(Boolean),
    hidden: (said.get("hide") ?? "").split(","),
    sigmas: said.get("sigmas") ?? undefined,
    world: said.get("frame") === "world",
    view: view.length === 3 && view.every(Number.isFinite) && view[2] > 0 ? view : undefined,
    beam: whole("beam"),
  };
}

/** The address of what is seen, without what is so by default. */
export function addressOf({ log, topics, scan, methods, hidden, sigmas, world, view, beam }) {
  const [x, y, span] = view, said = {
    ...(log === undefined ? {} : { log }),
    ...(topics === undefined ? {} : { topics: topics.join(",") }),
    scan,
    method: methods[0],
    ...(methods[1] ? { with: methods[1] } : {}),
    ...(hidden.length ? { hide: hidden.join(",") } : {}),
    ...(sigmas === "3" ? {} : { sigmas }),
    ...(world ? { frame: "world" } : {}),
    view: [+x.toFixed(4), +y.toFixed(4), +span.toPrecision(6)].join(","),
    ...(beam === undefined ? {} : { beam }),
  };
  // Commas, colons and slashes may stand there as they are, and are easier to read.
  const text = new URLSearchParams(said).toString().replace(/%2C/g, ",").replace(/%3A/g, ":").replace(/%2F/g, "/");
  return `${location.origin}${location.pathname}#${text}`;
}
