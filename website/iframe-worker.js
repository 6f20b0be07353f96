/* A browser starts no worker for a page that was opened from a folder: there the search works in a frame. */
if (location.protocol === "file:") {
  window.Worker = class {
    constructor(address) {
      this.frame = Object.assign(document.createElement("iframe"), { hidden: true, srcdoc: "<!doctype html>" });
      this.ready = new Promise((ready) => this.frame.addEventListener("load", ready, { once: true })).then(
        () =>
          new Promise((ready, failed) => {
            const inside = this.frame.contentWindow;
            inside.postMessage = (data) => this.onmessage?.({ data: structuredClone(data) });
            const script = inside.document.createElement("script");
            Object.assign(script, { src: new URL(address, location), onload: ready, onerror: failed });
            inside.document.head.append(script);
          }),
      );
      this.ready.catch((event) => this.onerror?.(event));
      document.body.append(this.frame);
    }

    postMessage(message) {
      const data = structuredClone(message); // as a worker gets it: the search changes what it is given
      this.ready.then(() => this.frame.contentWindow?.onmessage({ data }), () => {});
    }

    terminate() {
      this.frame.remove();
    }
  };
}
