/* Tables that scroll can be reached by the keyboard, and the search has a name. */
new MutationObserver(() => {
  for (const table of document.querySelectorAll(".md-typeset__scrollwrap"))
    if (table.tabIndex < 0) table.tabIndex = 0;
  const search = document.querySelector('.md-search[role="dialog"]');
  if (search && !search.ariaLabel) search.ariaLabel = "Search";
}).observe(document.documentElement, { childList: true, subtree: true });

/* Browsers refuse workers of pages opened from disk: there a frame does its work. */
if (location.protocol === "file:")
  window.Worker = class extends EventTarget {
    constructor(url) {
      super();
      const frame = document.createElement("iframe");
      frame.hidden = true;
      frame.title = "search";
      document.body.append(frame);
      const inner = (this.inner = frame.contentWindow);
      inner.postMessage = (data) =>
        this.dispatchEvent(new MessageEvent("message", { data }));
      const script = inner.document.createElement("script");
      script.src = new URL(url, location.href).href;
      this.loaded = new Promise((done) => (script.onload = done));
      inner.document.body.append(script);
    }
    postMessage(data) {
      this.loaded.then(() =>
        this.inner.dispatchEvent(new this.inner.MessageEvent("message", { data }))
      );
    }
  };
