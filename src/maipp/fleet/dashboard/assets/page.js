// The page: puts together what comes from the server, the maps, and what is told in words.
import { element, time } from "./format.js";
import { Link } from "./link.js";
import { Pictures } from "./maps.js";
import { LAYERS, Trails, draw } from "./marks.js";
import { scaleBar } from "./scale.js";
import { Robots, events, facts, radioTable, reading } from "./tables.js";
import { FOOT, View } from "./view.js";

const TITLES = { mean: "Map", std: "Uncertainty", area: "Area of interest" };
const QUIET = 15; // s without anything new after which that is said
const find = (id) => document.getElementById(id);
const narrow = matchMedia("(max-width: 640px)");
const shown = new Set(LAYERS.filter(([, , on]) => on).map(([key]) => key));
let chosen = new Set(narrow.matches ? ["mean"] : Object.keys(TITLES));
let pointed = null;
let due = false;

const trails = new Trails();
const pictures = new Pictures();
const view = new View(later, (at) => {
  pointed = at;
  read();
});
const link = new Link(changed);
const robots = new Robots(find("robots"), (name) => choose(link.who === name ? "" : name));

const maps = Object.entries(TITLES).map(([name, title]) => {
  const canvas = element("canvas", { id: `map-${name}`, role: "img", tabindex: "0" });
  const tools = element("span", { class: "tools" });
  tools.append(...view.buttons());
  const bar = element("div", { class: "key" });
  const figure = element(
    "figure", {}, element("figcaption", {}, element("h3", {}, title), tools), canvas, bar,
  );
  view.attach(canvas);
  find("maps").append(figure);
  return { name, title, canvas, figure, bar };
});

for (const [key, name, on] of LAYERS) {
  const box = element("input", { type: "checkbox", "data-layer": key });
  box.checked = on;
  box.addEventListener("change", () => {
    shown[box.checked ? "add" : "delete"](key);
    later();
  });
  find("layers").append(element("label", {}, box, name));
}

for (const button of document.querySelectorAll("#choice button"))
  button.addEventListener("click", () => {
    const { map } = button.dataset;
    if (narrow.matches) chosen = new Set([map]);
    else if (!chosen.has(map)) chosen.add(map);
    else if (chosen.size > 1) chosen.delete(map);
    arrange();
  });

find("who").addEventListener("change", () => choose(find("who").value));
narrow.addEventListener("change", () => {
  chosen = new Set(narrow.matches ? ["mean"] : Object.keys(TITLES));
  arrange();
});
new ResizeObserver(arrange).observe(find("maps"));
matchMedia("(prefers-color-scheme: dark)").addEventListener("change", later);
setInterval(status, 1000);

function choose(who) {
  link.choose(who);
  find("who").value = who;
  if (ready()) robots.show(link.parts, link.who);
  known();
}

function ready() {
  return link.parts.place !== undefined && link.parts.robots !== undefined;
}

function changed(news) {
  if (news.has("all")) {
    pictures.limits = {};
    pictures.field = null;
    trails.clear();
    link.choose(link.who);
  }
  if (news.has("rows") && link.rows.length < trails.count) trails.clear();
  trails.take(link.rows);
  if (ready()) {
    const { parts } = link;
    if (news.has("place") && news.has("all")) {
      document.title = `${parts.place.title} – fleet`;
      find("title").textContent = parts.place.title;
      view.fit(parts.place.size);
      arrange();
    }
    if (news.has("robots")) {
      options();
      robots.show(parts, link.who);
      radioTable(find("radio"), parts.robots);
    }
    if (["now", "changes", "kernel", "robots"].some((part) => news.has(part))) facts(find("facts"), parts);
    if (news.has("events")) events(find("events"), parts.events);
    if (news.has("field") || news.has("changes")) fields();
    known();
  }
  document.body.dataset.rows = link.rows.length;
  if (news.has("link")) status();
  later();
}

function fields() {
  if (!link.field) return;
  const { place, look, changes } = link.parts;
  pictures.widen(link.field, place.prior);
  pictures.make(link.field, look.scales);
  for (const { name, bar } of maps)
    if (name === "area") bar.replaceChildren(key());
    else bar.replaceChildren(pictures.bar(name, { ...place, threshold: changes.threshold }, look));
  document.body.dataset.field = link.field.measurements;
  document.body.dataset.who = link.field.robot ?? "";
  read();
}

function key() {
  const blue = link.parts.place.everything ? "every place is of interest" : "blue: may be of interest";
  const text =
    `${blue}; hatched: no-go zone; ring: start; square: end; dashed: plan; dotted: intent; ` +
    "red cross: value that is not used";
  return element("div", { class: "bar" }, text);
}

function options() {
  const names = link.parts.robots.map((robot) => robot.name);
  const select = find("who");
  if ([...select.options].slice(1).map((option) => option.value).join("\n") !== names.join("\n")) {
    select.replaceChildren(element("option", { value: "" }, "all together"));
    for (const name of names) select.append(element("option", { value: name }, name));
    if (link.who && !names.includes(link.who)) link.choose("");
  }
  select.value = link.who;
}

function known() {
  if (!ready()) return;
  const { now } = link.parts;
  const count = link.field?.measurements;
  if (!link.who) find("known").textContent = "";
  else if (count === undefined) find("known").textContent = `Working out what ${link.who} knows …`;
  else
    find("known").textContent =
      `The maps show what ${link.who} knew when it was heard last: ${count} of the ${now.measurements} ` +
      `measurements that count. Marks show what is known to all together.`;
}

function status() {
  const [since, quiet] = [link.since, link.told].map((when) => Math.round((Date.now() - when) / 1000));
  document.body.dataset.link = link.state;
  const words = {
    live: () => (quiet > QUIET ? `connected, but nothing new for ${quiet} s: the server is busy` : "live"),
    connecting: () => "connecting …",
    saved: () => "saved: as it stood then",
    away: () =>
      link.refused
        ? "the token is not valid any more: open the address that was told at the start"
        : `no connection for ${since} s; trying again. What is shown was so then.`,
  };
  const text = words[link.state]();
  if (find("link").textContent !== text) find("link").textContent = text;
}

function read() {
  if (!ready() || !link.field || !pointed) return;
  find("readout").textContent = reading(pictures.at(pointed, link.parts.place.size), pointed, link.parts, link.parts.place.prior);
}

// As many maps in a row as were chosen, none wider than helps.
function arrange() {
  for (const button of document.querySelectorAll("#choice button"))
    button.setAttribute("aria-pressed", String(chosen.has(button.dataset.map)));
  const room = find("maps").clientWidth;
  const columns = Math.max(1, Math.min(chosen.size, Math.floor(room / 300)));
  document.documentElement.style.setProperty("--columns", columns);
  const [w, h] = view.size;
  for (const { name, figure, canvas } of maps) {
    figure.hidden = !chosen.has(name);
    const width = (room - 16 * (columns - 1)) / columns;
    const height = Math.min((width * h) / w, Math.max(260, 0.72 * innerHeight)) + FOOT;
    canvas.style.height = `${Math.round(Math.max(height, 180))}px`;
  }
  later();
}

function later() {
  if (due) return;
  due = true;
  requestAnimationFrame(() => {
    due = false;
    if (ready()) maps.forEach(paint);
  });
}

function paint({ name, title, canvas, figure }) {
  if (figure.hidden) return;
  const { parts } = link;
  const [width, height, ratio] = [canvas.clientWidth, canvas.clientHeight, devicePixelRatio || 1];
  const size = [Math.round(width * ratio), Math.round(height * ratio)];
  if (canvas.width !== size[0] || canvas.height !== size[1]) [canvas.width, canvas.height] = size;
  const style = getComputedStyle(document.body);
  const colours = { ink: style.getPropertyValue("--ink"), ground: style.getPropertyValue("--panel") };
  colours.font = `600 13px ${style.fontFamily}`;
  const context = canvas.getContext("2d");
  context.setTransform(ratio, 0, 0, ratio, 0, 0);
  context.clearRect(0, 0, width, height);
  const pixels = view.toPixels(width, height);
  if (pictures.field && link.field) pictures.draw(context, name, pixels, parts.place, colours);
  const out = new Set(parts.kept_out.map(([row]) => row));
  draw(context, pixels, parts, trails, out, shown, colours);
  scaleBar(context, width, height, view.scale(width, height), parts.place.units.length, colours);
  canvas.toggleAttribute("data-zoomed", view.zoom > 1);
  const whose = link.who ? `as ${link.who} knows it` : "as all together know it";
  const told = `${title} ${whose}, ${time(parts.now.time)} after the start, with ${parts.robots.length} robots`;
  canvas.setAttribute("aria-label", `${told}; arrow keys move it, plus and minus zoom, 0 shows all`);
  document.body.dataset.ready = "";
}

link.open();
