"use strict";
(() => {
  const all = (selector, within = document) => [...within.querySelectorAll(selector)];
  const clamp = (value, low, high) => Math.min(high, Math.max(low, value));

  /* A map that can be zoomed and moved, by pointer, wheel, keys and buttons. */
  const MOST = 40;
  class Viewer {
    constructor(root) {
      this.stage = root.querySelector(".stage");
      this.sheet = root.querySelector(".sheet");
      this.bar = root.querySelector(".bar");
      this.said = root.querySelector(".place");
      this.pointers = new Map();
      const on = (name, act, options) => this.stage.addEventListener(name, act, options);
      on("wheel", (event) => this.wheel(event), { passive: false });
      on("keydown", (event) => this.key(event));
      on("pointerdown", (event) => this.down(event));
      on("pointermove", (event) => this.move(event));
      for (const name of ["pointerup", "pointercancel", "lostpointercapture"]) on(name, (event) => this.up(event));
      on("pointerleave", () => { this.said.textContent = ""; });
      for (const button of all("[data-zoom]", root)) button.addEventListener("click", () => this.press(button.dataset.zoom));
      new ResizeObserver(() => this.show()).observe(this.stage);
      this.reset();
    }
    reset() { this.scale = 1; this.x = 0; this.y = 0; this.show(); }
    press(what) {
      if (what === "reset") this.reset();
      else this.zoom(what === "in" ? 1.5 : 1 / 1.5, this.stage.clientWidth / 2, this.stage.clientHeight / 2);
    }
    zoom(factor, x, y) {
      const scale = clamp(this.scale * factor, 1, MOST);
      const by = scale / this.scale;
      this.x = x - (x - this.x) * by;
      this.y = y - (y - this.y) * by;
      this.scale = scale;
      this.show();
    }
    pan(x, y) { this.x += x; this.y += y; this.show(); }
    show() {
      const { clientWidth: width, clientHeight: height } = this.stage;
      this.x = clamp(this.x, width * (1 - this.scale), 0);
      this.y = clamp(this.y, height * (1 - this.scale), 0);
      this.sheet.style.transform = `translate(${this.x}px, ${this.y}px) scale(${this.scale})`;
      this.sheet.style.setProperty("--zoom", this.scale);
      this.stage.classList.toggle("zoomed", this.scale > 1);
      const cols = Number(getComputedStyle(this.stage).getPropertyValue("--cols"));
      this.stage.classList.toggle("close-up", width * this.scale > 1.5 * cols);
      const metres = Number(this.stage.dataset.width) / this.scale;
      if (!(metres > 0)) return;
      const power = 10 ** Math.floor(Math.log10(metres / 5));
      const length = [5, 2, 1].map((step) => step * power).find((each) => each <= metres / 5 * (1 + 1e-9));
      this.bar.querySelector(".length").textContent = `${Number(length.toPrecision(3))} m`;
      this.bar.querySelector(".line").style.width = `${length / metres * width}px`;
    }
    at(event) {
      const box = this.stage.getBoundingClientRect();
      return [event.clientX - box.left, event.clientY - box.top];
    }
    wheel(event) {
      const wanted = this.stage.dataset.wheel === "always" || event.ctrlKey || event.metaKey || document.activeElement === this.stage;
      if (!wanted) return;
      event.preventDefault();
      this.zoom(Math.exp(-clamp(event.deltaY, -120, 120) / 300), ...this.at(event));
    }
    key(event) {
      const step = 60;
      const acts = {
        "+": () => this.press("in"), "=": () => this.press("in"), "-": () => this.press("out"), "0": () => this.reset(),
        ArrowLeft: () => this.pan(step, 0), ArrowRight: () => this.pan(-step, 0),
        ArrowUp: () => this.pan(0, step), ArrowDown: () => this.pan(0, -step),
      };
      if (event.ctrlKey || event.metaKey || event.altKey || !(event.key in acts)) return;
      if (event.key.startsWith("Arrow") && this.scale === 1) return;
      event.preventDefault();
      acts[event.key]();
    }
    down(event) {
      this.pointers.set(event.pointerId, this.at(event));
      if (event.pointerType === "mouse" || this.scale > 1) this.stage.setPointerCapture(event.pointerId);
      this.stage.classList.add("moving");
    }
    move(event) {
      const now = this.at(event);
      this.tell(now);
      const before = this.pointers.get(event.pointerId);
      if (!before) return;
      if (this.pointers.size === 1) this.pan(now[0] - before[0], now[1] - before[1]);
      else if (this.pointers.size === 2) {
        const [, other] = [...this.pointers].find(([id]) => id !== event.pointerId);
        const far = (one) => Math.hypot(one[0] - other[0], one[1] - other[1]) || 1;
        this.zoom(far(now) / far(before), (now[0] + other[0]) / 2, (now[1] + other[1]) / 2);
      }
      this.pointers.set(event.pointerId, now);
    }
    up(event) {
      this.pointers.delete(event.pointerId);
      if (!this.pointers.size) this.stage.classList.remove("moving");
    }
    tell([x, y]) {
      const metres = Number(this.stage.dataset.width) / (this.stage.clientWidth * this.scale);
      if (!(metres > 0)) return;
      const east = Number(this.stage.dataset.left) + (x - this.x) * metres;
      const north = Number(this.stage.dataset.top) - (y - this.y) * metres;
      this.said.textContent = `x ${east.toFixed(2)} m, y ${north.toFixed(2)} m`;
    }
  }

  for (const root of all("main .viewer")) {
    new Viewer(root);
    for (const box of all("input[data-layer]", root)) {
      const layer = root.querySelector(`.sheet [data-layer="${box.dataset.layer}"]`);
      const follow = () => { layer.toggleAttribute("hidden", !box.checked); };
      box.addEventListener("change", follow);
      follow();
    }
  }

  /* A picture on its own, in a dialog. */
  const dialog = document.getElementById("zoom");
  const big = new Viewer(dialog);
  for (const thumb of all(".thumb")) thumb.addEventListener("click", () => {
    const image = thumb.querySelector("img").cloneNode();
    big.stage.style.cssText = thumb.style.cssText;
    for (const name of ["width", "left", "top"]) big.stage.dataset[name] = thumb.dataset[name];
    big.sheet.replaceChildren(image);
    document.getElementById("zoom-title").textContent = thumb.dataset.title;
    const legend = (thumb.closest(".pair, .refused") || thumb.parentElement).querySelector(".legend");
    dialog.querySelector(".dialog-legend").replaceChildren(...(legend ? [legend.cloneNode(true)] : []));
    dialog.showModal();
    big.reset();
  });
  dialog.querySelector(".close").addEventListener("click", () => dialog.close());
  dialog.addEventListener("click", (event) => { if (event.target === dialog) dialog.close(); });

  /* Values of all plots at one time. */
  const kept = document.getElementById("series");
  if (kept) {
    const series = JSON.parse(kept.textContent);
    const slider = document.getElementById("when");
    const [low, high] = series.span;
    const show = () => {
      const at = Number(slider.value);
      const share = (series.t[at] - low) / (high - low) * 100;
      const said = `+${series.t[at].toFixed(1)} s`;
      document.getElementById("when-said").textContent = said;
      slider.setAttribute("aria-valuetext", said);
      for (const cursor of all(".cursor")) { cursor.hidden = false; cursor.style.left = `${share}%`; }
      for (const plot of all(".plot")) {
        const key = plot.dataset.key;
        for (const item of all("[data-robot]", plot)) {
          const robot = Number(item.dataset.robot);
          const value = series.values[key][robot][at];
          const refused = value !== null && series.placed[robot][at] === "0" ? " refused" : "";
          item.querySelector(".value").textContent = value === null ? "–" : value.toFixed(series.digits[key]) + refused;
        }
      }
    };
    const nearest = (time) => {
      let from = 0, to = series.t.length - 1;
      while (from < to) { const middle = (from + to + 1) >> 1; if (series.t[middle] <= time) from = middle; else to = middle - 1; }
      return from;
    };
    for (const drawing of all(".drawing, .track")) drawing.addEventListener("pointermove", (event) => {
      const box = drawing.getBoundingClientRect();
      slider.value = nearest(low + (event.clientX - box.left) / box.width * (high - low));
      show();
    });
    slider.addEventListener("input", show);
    slider.closest(".when").hidden = false;
    show();
  }

  /* Light, dark, or what the system says. */
  const theme = document.getElementById("theme");
  const themes = ["automatic", "light", "dark"];
  theme.hidden = false;
  theme.addEventListener("click", () => {
    const next = themes[(themes.indexOf(document.documentElement.dataset.theme || "automatic") + 1) % themes.length];
    if (next === "automatic") delete document.documentElement.dataset.theme;
    else document.documentElement.dataset.theme = next;
    theme.textContent = `Theme: ${next}`;
  });

  for (const button of all(".copy")) {
    button.hidden = false;
    button.addEventListener("click", async () => {
      const text = button.parentElement.querySelector("pre");
      try {
        await navigator.clipboard.writeText(text.textContent.trim());
        button.textContent = "Copied";
      } catch {
        getSelection().selectAllChildren(text);
        button.textContent = "Selected";
      }
    });
  }
})();
