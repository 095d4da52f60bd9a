// What is told in words: facts, robots with budgets and ways home, events, and who hears whom.
import { ago, element, length, time, value, withUnit } from "./format.js";
import { colourOf } from "./marks.js";

const STATUS = {
  waiting: "has not reported yet", travelling: "on its way", stopped: "has stopped", gone: "lost or called back",
};

function fill(node, ...children) {
  node.replaceChildren(...children);
}

export function facts(node, { now, place, changes, kernel, robots }) {
  const rows = [
    ["time since the start", time(now.time)],
    ["measurements that count", String(now.measurements)],
    ["robots", `${robots.length}, ${robots.filter((robot) => robot.silent).length} silent`],
  ];
  if (!place.everything)
    rows.push([place.below ? "of interest up to" : "of interest from", withUnit(String(changes.threshold), place.units.value)]);
  if (kernel?.measurements)
    rows.push(["values change over about", length(kernel.length_scale, place.units.length)]);
  fill(node, ...rows.map(([name, told]) => element("div", {}, element("dt", {}, name), element("dd", {}, told))));
}

function budgetBar(robot, unit) {
  const whole = Math.max(robot.budget, robot.travelled, 1e-9);
  const home = Math.min(robot.home?.length ?? 0, robot.left);
  const bar = element("div", { class: "budget", role: "img" });
  const parts = [["gone", robot.travelled], ["spare", robot.left - home], ["home", home]];
  for (const [name, part] of parts) {
    const piece = element("i", { class: name });
    piece.style.width = `${(100 * Math.max(part, 0)) / whole}%`;
    bar.append(piece);
  }
  const text = [`${length(robot.travelled, unit)} of ${length(robot.budget, unit)} travelled`];
  if (robot.home?.length != null) text.push(`${length(robot.home.length, unit)} home (striped)`);
  const spare = robot.left - home;
  text.push(spare > 1e-3 * whole ? `${length(spare, unit)} to spare` : "nothing to spare");
  bar.setAttribute("aria-label", text.join(", "));
  return [bar, element("p", {}, text.join("; "))];
}

function warnings(robot) {
  const told = [];
  if (robot.silent) told.push("silent: not counted on until it is heard again");
  if (robot.forked) told.push("two different logs of this robot: look after it");
  if (robot.home && robot.home.length === null) told.push("no way home leads around the no-go zones");
  else if (robot.home && robot.status !== "stopped" && robot.home.length > robot.left * 1.001 + 1e-9)
    told.push("its way home is longer than its budget");
  return told.map((text) => element("p", { class: "warn" }, text));
}

// Cards stay the same elements from one word to the next, so that the focus stays where it is.
export class Robots {
  constructor(node, choose) {
    this.node = node;
    this.choose = choose;
    this.cards = [];
  }

  show({ robots, place, look }, who) {
    if (this.cards.length !== robots.length || this.cards.some((card, i) => card.name !== robots[i].name)) {
      this.cards = robots.map((robot, i) => this.card(robot, colourOf(look, i)));
      fill(this.node, ...this.cards.map(({ card }) => card));
    }
    robots.forEach((robot, i) => {
      const { card, body, button } = this.cards[i];
      card.toggleAttribute("data-silent", robot.silent);
      button.setAttribute("aria-pressed", String(who === robot.name));
      const doing = robot.homeward ? "on its way home" : STATUS[robot.status] ?? robot.status;
      const why = robot.why ? `: ${robot.why}` : "";
      const heard = robot.heard === null ? "not heard yet" : `heard ${ago(robot.heard)}`;
      const at = robot.position.map((number) => String(Number(number.toFixed(5)))).join(", ");
      fill(
        body,
        element("p", {}, `${doing}${why}; ${heard}`),
        ...warnings(robot),
        ...budgetBar(robot, place.units.length),
        element("p", { class: "soft" }, `at ${at}, after ${time(robot.time)}`),
        element("p", { class: "soft" }, `${robot.measurements} measurements; ${robot.lines} lines in its log`),
      );
    });
  }

  card(robot, colour) {
    const chip = element("span", { class: "chip", "aria-hidden": "true" });
    chip.style.background = colour;
    const button = element("button", { type: "button" }, "what it knows");
    button.addEventListener("click", () => this.choose(robot.name));
    button.setAttribute("aria-label", `Show what ${robot.name} knows`);
    const body = element("div");
    const head = element("header", {}, chip, element("h3", {}, robot.name), button);
    return { name: robot.name, body, button, card: element("article", { class: "card" }, head, body) };
  }
}

export function events(node, list) {
  const rows = [...list].reverse().map(({ time: when, robot, kind, text }) => {
    const told = element("span", {}, ...(robot ? [element("b", {}, robot), " "] : []), text);
    return element("li", { class: kind }, element("time", {}, time(when)), told);
  });
  if (!rows.length) rows.push(element("li", {}, element("span", {}, "nothing yet")));
  const { scrollTop } = node;
  fill(node, ...rows);
  node.scrollTop = scrollTop;
}

export function radioTable(node, robots) {
  const heads = robots.map((robot) => element("th", { scope: "col" }, robot.name));
  const rows = robots.map((one) => {
    const cells = robots.map((other) => {
      if (one === other) return element("td", { class: "no" }, "");
      if (one.hears === null || one.silent) return element("td", { class: "no" }, "?");
      return one.hears.includes(other.name)
        ? element("td", { class: "yes" }, "✓ hears")
        : element("td", { class: "no" }, "–");
    });
    return element("tr", {}, element("th", { scope: "row" }, one.name), ...cells);
  });
  fill(
    node,
    element(
      "table", {}, element("thead", {}, element("tr", {}, element("th", { scope: "col" }, ""), ...heads)),
      element("tbody", {}, ...rows),
    ),
  );
}

export function reading(told, at, { place }, prior) {
  const [x, y] = at;
  const [w, h] = place.size;
  const [u, v] = [x / w, y / h];
  const where = [0, 1].map((axis) => {
    const [a, b, c, d] = place.corners.map((corner) => corner[axis]);
    return ((a * (1 - u) + b * u) * (1 - v) + (c * (1 - u) + d * u) * v).toFixed(place.units.position === "m" ? 1 : 5);
  });
  const spread = prior.std;
  const values = told
    ? `${place.quantity} ${withUnit(value(told.mean, spread), place.units.value)} ± ` +
      `${withUnit(value(told.std, spread), place.units.value)}${told.high && !place.everything ? ", of interest" : ""}`
    : "beyond the maps";
  const beyond = told && !told.inside ? " (not in the area)" : "";
  return `${values}, at ${where.join(", ")}${beyond}`;
}
