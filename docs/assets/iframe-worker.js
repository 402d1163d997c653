// A page opened from a folder may start no Worker: its script runs in a hidden frame instead, with the same messages.
if (location.protocol === "file:")
  window.Worker = class extends EventTarget {
    constructor(url) {
      super();
      this.frame = document.createElement("iframe");
      this.frame.hidden = true;
      this.frame.srcdoc = `<script>
        postMessage = (data) => parent.postMessage(data, "*");
        importScripts = async (...urls) => {
          for (const url of urls)
            await new Promise((done, failed) => {
              const script = Object.assign(document.createElement("script"), {src: url, onload: done, onerror: failed});
              document.head.append(script);
            });
        };
      <\/script><script src="${url}"><\/script>`;
      this.ready = new Promise((done) => (this.frame.onload = done));
      addEventListener("message", (event) => {
        if (event.source !== this.frame.contentWindow) return;
        const message = new MessageEvent("message", {data: event.data});
        this.dispatchEvent(message);
        this.onmessage?.(message);
      });
      document.body ? this.attach() : addEventListener("DOMContentLoaded", () => this.attach());
    }
    attach() {
      document.body.append(this.frame);
    }
    postMessage(data) {
      this.ready.then(() => this.frame.contentWindow.dispatchEvent(new MessageEvent("message", {data})));
    }
    terminate() {
      this.frame.remove();
    }
  };
