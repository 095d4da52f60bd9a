// What part of the place all maps show, and how it is moved: by mouse, fingers, keys and buttons.
const MARGIN = 0.04; // of the place around it
export const FOOT = 30; // pixels below it, for the scale
const MOST = 60; // times that can be zoomed in
const STEP = 1.5;

export class View {
  constructor(changed, pointed) {
    this.changed = changed;
    this.pointed = pointed; // called with a place, or null
    this.size = [1, 1]; // of the place, lengths
    this.zoom = 1;
    this.centre = [0.5, 0.5];
  }

  fit(size) {
    this.size = size;
    this.reset();
  }

  reset() {
    this.zoom = 1;
    this.centre = this.size.map((length) => length / 2);
    this.changed();
  }

  // Pixels in a length on a canvas of this size.
  scale(width, height) {
    const [w, h] = this.size;
    return this.zoom * Math.min(width / w, (height - FOOT) / h) * (1 - 2 * MARGIN);
  }

  toPixels(width, height) {
    const scale = this.scale(width, height);
    const [cx, cy] = this.centre;
    return ([x, y]) => [width / 2 + (x - cx) * scale, (height - FOOT) / 2 - (y - cy) * scale];
  }

  toPlace(width, height, [px, py]) {
    const scale = this.scale(width, height);
    return [this.centre[0] + (px - width / 2) / scale, this.centre[1] - (py - (height - FOOT) / 2) / scale];
  }

  move(dx, dy) {
    const [w, h] = this.size;
    this.centre = [clamp(this.centre[0] + dx, 0, w), clamp(this.centre[1] + dy, 0, h)];
    if (this.zoom === 1) this.centre = [w / 2, h / 2];
    this.changed();
  }

  // Zoom so that a place stays where it is.
  by(factor, place = this.centre) {
    const zoom = clamp(this.zoom * factor, 1, MOST);
    const share = 1 - this.zoom / zoom;
    this.zoom = zoom;
    this.move((place[0] - this.centre[0]) * share, (place[1] - this.centre[1]) * share);
  }

  attach(canvas) {
    const at = (event) => {
      const box = canvas.getBoundingClientRect();
      return [event.clientX - box.left, event.clientY - box.top];
    };
    const place = (point) => this.toPlace(canvas.clientWidth, canvas.clientHeight, point);
    const fingers = new Map();
    canvas.addEventListener("pointerdown", (event) => {
      fingers.set(event.pointerId, at(event));
      canvas.setPointerCapture(event.pointerId);
      this.pointed(place(at(event)));
    });
    canvas.addEventListener("pointermove", (event) => {
      const now = at(event);
      const before = fingers.get(event.pointerId);
      if (before) {
        const scale = this.scale(canvas.clientWidth, canvas.clientHeight);
        const others = [...fingers.keys()].filter((id) => id !== event.pointerId);
        fingers.set(event.pointerId, now);
        if (others.length) {
          const other = fingers.get(others[0]);
          this.by(Math.max(gap(now, other), 1) / Math.max(gap(before, other), 1), place(other));
        } else if (this.zoom > 1) this.move((before[0] - now[0]) / scale, (now[1] - before[1]) / scale);
      }
      this.pointed(place(now));
    });
    for (const name of ["pointerup", "pointercancel"])
      canvas.addEventListener(name, (event) => fingers.delete(event.pointerId));
    canvas.addEventListener("pointerleave", () => this.pointed(null));
    canvas.addEventListener("dblclick", (event) => this.by(2, place(at(event))));
    canvas.addEventListener(
      "wheel",
      (event) => {
        // The wheel alone is for the page, until a map has been chosen.
        if (!event.ctrlKey && !event.metaKey && document.activeElement !== canvas) return;
        event.preventDefault();
        this.by(Math.exp(-event.deltaY / 400), place(at(event)));
      },
      { passive: false },
    );
    canvas.addEventListener("keydown", (event) => {
      const step = Math.min(...this.size) / 10 / this.zoom;
      const keys = {
        ArrowLeft: () => this.move(-step, 0), ArrowRight: () => this.move(step, 0),
        ArrowUp: () => this.move(0, step), ArrowDown: () => this.move(0, -step),
        "+": () => this.by(STEP), "=": () => this.by(STEP), "-": () => this.by(1 / STEP), 0: () => this.reset(),
      };
      if (!keys[event.key] || event.ctrlKey || event.metaKey || event.altKey) return;
      event.preventDefault();
      keys[event.key]();
      this.pointed(this.centre);
    });
  }

  buttons() {
    const named = [
      ["+", "Zoom in", () => this.by(STEP)], ["−", "Zoom out", () => this.by(1 / STEP)],
      ["all", "Show all", () => this.reset()],
    ];
    return named.map(([text, name, act]) => {
      const button = document.createElement("button");
      button.type = "button";
      button.textContent = text;
      button.setAttribute("aria-label", name);
      button.title = name;
      button.addEventListener("click", act);
      return button;
    });
  }
}

function clamp(value, low, high) {
  return Math.min(Math.max(value, low), high);
}

function gap([ax, ay], [bx, by]) {
  return Math.hypot(ax - bx, ay - by);
}
