// Questions to the server.

/** The server's response; an Error with the server's own message where that fails. */
export async function fetched(path, parameters = {}) {
  const query = new URLSearchParams(parameters).toString();
  let response;
  try {
    response = await fetch(`/api/${path}${query ? `?${query}` : ""}`);
  } catch {
    throw new Error("The server has ended: start `lineament view` again.");
  }
  if (!response.ok) throw new Error((await response.json()).error);
  return response;
}

/** Ask for `path` with parameters. */
export const ask = async (path, parameters) => (await fetched(path, parameters)).json();

/** Runs one job at a time; of those that wait, only the last is run. */
export class Latest {
  #job = null;
  #running = null;

  run(job) {
    this.#job = job;
    this.#running ??= this.#work();
    return this.#running;
  }

  async #work() {
    try {
      while (this.#job) {
        const job = this.#job;
        this.#job = null;
        await job();
      }
    } finally {
      this.#running = null;
    }
  }
}
