// Browsers start no workers for pages that are opened from the disk: the search runs in a frame.
if (location.protocol === "file:") {
  window.Worker = class {
    constructor(url) {
      this.frame = document.createElement("iframe");
      this.frame.hidden = true;
      document.body.append(this.frame);
      this.inner = this.frame.contentWindow;
      this.inner.postMessage = (data) =>
        this.onmessage?.({ data: structuredClone(data) });
      const script = this.frame.contentDocument.createElement("script");
      script.src = url;
      this.loaded = new Promise((resolve) => (script.onload = resolve));
      this.frame.contentDocument.body.append(script);
    }
    async postMessage(data) {
      await this.loaded;
      this.inner.onmessage({ data: structuredClone(data) });
    }
    terminate() {
      this.frame.remove();
    }
  };
}
