// The maps themselves: colours of mean and standard deviation, and the area of high interest.
import { element, roundValues, withUnit } from "./format.js";

const FINE = 6; // pixels to a cell of the area's picture
const AREA = [156, 195, 229];

function rgb(colour) {
  return [1, 3, 5].map((at) => parseInt(colour.slice(at, at + 2), 16));
}

function picture(side, paint) {
  const canvas = document.createElement("canvas");
  canvas.width = canvas.height = side;
  const context = canvas.getContext("2d");
  const image = context.createImageData(side, side);
  for (let row = 0; row < side; row++)
    for (let column = 0; column < side; column++) {
      const colour = paint(column, row);
      if (colour) image.data.set([...colour, 255], 4 * ((side - 1 - row) * side + column)); // north is up
    }
  context.putImageData(image, 0, 0);
  return canvas;
}

export class Pictures {
  constructor() {
    this.limits = {};
  }

  // Limits of the colours: all that has been seen, so that beliefs can be held against each other.
  widen(field, prior) {
    const [low, high] = extremes(field.mean);
    const seen = this.limits.mean;
    let limits = [Math.min(low, seen?.[0] ?? low), Math.max(high, seen?.[1] ?? high)];
    if (limits[1] - limits[0] < 1e-3 * prior.std) limits = [limits[0] - prior.std, limits[1] + prior.std];
    this.limits = { mean: limits, std: [0, Math.max(prior.std, extremes(field.std)[1])] };
  }

  make(field, scales) {
    this.field = field;
    this.made = {};
    for (const name of ["mean", "std"]) {
      const stops = scales[name].map(rgb);
      const [low, high] = this.limits[name];
      this.made[name] = picture(field.side, (column, row) => {
        return between(stops, (field[name][row * field.side + column] - low) / (high - low));
      });
    }
    this.made.area = areaPicture(field);
    this.outline = outline(field);
  }

  // Values at a place between the points of the grid, and whether it is in the area; null outside of the grid.
  at([x, y], [width, height]) {
    const { field } = this;
    if (!field || x < 0 || y < 0 || x > width || y > height) return null;
    const column = (x / width) * (field.side - 1);
    const row = (y / height) * (field.side - 1);
    const told = { mean: bilinear(field.mean, field.side, column, row), std: bilinear(field.std, field.side, column, row) };
    const inside = field.inside[Math.round(row) * field.side + Math.round(column)] === 1;
    return { ...told, inside, high: inside && bilinear(field.surplus, field.side, column, row) >= 0 };
  }

  // Draw one of the maps; the points of the grid lie in the middle of its cells, the outer ones on the border.
  draw(context, name, pixels, { size: [width, height], area }, colours) {
    const side = this.field.side;
    const [x, y] = pixels([0, height]);
    const [right, bottom] = pixels([width, 0]);
    const cells = name === "area" ? (side - 1) * FINE + 1 : side;
    const [dx, dy] = [(right - x) / (cells - 1) / 2, (bottom - y) / (cells - 1) / 2];
    context.save();
    context.beginPath();
    context.rect(x, y, right - x, bottom - y);
    context.clip();
    if (area) {
      context.beginPath();
      for (const point of area) context.lineTo(...pixels(point));
      context.clip();
    }
    context.imageSmoothingEnabled = true;
    context.imageSmoothingQuality = "high";
    context.drawImage(this.made[name], x - dx, y - dy, right - x + 2 * dx, bottom - y + 2 * dy);
    if (name !== "std") {
      context.beginPath();
      for (const [a, b] of this.outline) {
        context.moveTo(...pixels([(a[0] * width) / (side - 1), (a[1] * height) / (side - 1)]));
        context.lineTo(...pixels([(b[0] * width) / (side - 1), (b[1] * height) / (side - 1)]));
      }
      context.lineCap = "round";
      if (name === "mean") stroke(context, "#ffffff", 4);
      stroke(context, name === "mean" ? "#1a1a1a" : colours.ink, 1.8);
    }
    context.restore();
  }

  bar(name, place, look) {
    const [low, high] = this.limits[name];
    const ramp = element("div", { class: "ramp" });
    ramp.style.background = `linear-gradient(to right, ${look.scales[name].join(", ")})`;
    const ticks = element("div", { class: "ticks" });
    const at = (number) => `${(100 * (number - low)) / (high - low)}%`;
    for (const [number, text] of roundValues(low, high)) {
      const tick = element("span", {}, text);
      tick.style.left = at(number);
      ticks.append(tick);
    }
    const unit = place.units.value ? `(${place.units.value})` : "";
    const label = withUnit(name === "mean" ? place.quantity : `standard deviation of ${place.quantity}`, unit);
    const threshold = place.everything ? null : place.threshold;
    const marked = name === "mean" && threshold !== null && threshold > low && threshold < high;
    if (marked) {
      const mark = element("i", { title: "threshold" });
      mark.style.left = at(threshold);
      ramp.append(mark);
    }
    const more = name === "mean" ? "; line: border of the area of interest" : "; dark: little is known there";
    return element("div", { class: "bar" }, ramp, ticks, `${label}${marked ? "; black mark: threshold" : ""}${more}`);
  }
}

function stroke(context, colour, width) {
  context.strokeStyle = colour;
  context.lineWidth = width;
  context.stroke();
}

function extremes(numbers) {
  let [low, high] = [Infinity, -Infinity];
  for (const number of numbers) {
    if (number < low) low = number;
    if (number > high) high = number;
  }
  return [low, high];
}

function between(stops, share) {
  const at = Math.min(Math.max(share, 0), 1) * (stops.length - 1);
  const first = Math.min(Math.floor(at), stops.length - 2);
  return stops[first].map((part, i) => Math.round(part + (stops[first + 1][i] - part) * (at - first)));
}

function bilinear(numbers, side, column, row) {
  const c = Math.min(Math.floor(column), side - 2);
  const r = Math.min(Math.floor(row), side - 2);
  const [u, v] = [column - c, row - r];
  const at = (i, j) => numbers[j * side + i];
  return (
    (at(c, r) * (1 - u) + at(c + 1, r) * u) * (1 - v) + (at(c, r + 1) * (1 - u) + at(c + 1, r + 1) * u) * v
  );
}

function areaPicture({ side, surplus }) {
  return picture((side - 1) * FINE + 1, (column, row) => {
    return bilinear(surplus, side, column / FINE, row / FINE) >= 0 ? AREA : null;
  });
}

// Pieces of the line on which the surplus is 0, in cells of the grid.
function outline({ side, surplus }) {
  const pieces = [];
  const at = (i, j) => surplus[j * side + i];
  for (let j = 0; j < side - 1; j++)
    for (let i = 0; i < side - 1; i++) {
      const corners = [[i, j], [i + 1, j], [i + 1, j + 1], [i, j + 1]];
      const crossings = [];
      for (let k = 0; k < 4; k++) {
        const [a, b] = [corners[k], corners[(k + 1) % 4]];
        const [p, q] = [at(...a), at(...b)];
        if (p >= 0 === q >= 0) continue;
        const share = p / (p - q);
        crossings.push([a[0] + (b[0] - a[0]) * share, a[1] + (b[1] - a[1]) * share]);
      }
      for (let k = 0; k + 1 < crossings.length; k += 2) pieces.push([crossings[k], crossings[k + 1]]);
    }
  return pieces;
}
