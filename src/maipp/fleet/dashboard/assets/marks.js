// What lies on the maps: borders, zones, trails, plans, intents, measurements, robots, and who hears whom.
export const LAYERS = [
  ["trails", "trails", true], ["plans", "plans", true], ["intents", "intents", true],
  ["measured", "measurements", true], ["homes", "ways home", false], ["radio", "who hears whom", false], ["names", "names", true],
];
const DASHES = [[], [8, 3], [2, 3]]; // of robots that share a colour with one before them

// Trails and measurements of each robot in the order of time, from rows that are only ever added.
export class Trails {
  constructor() {
    this.clear();
  }

  clear() {
    this.count = 0;
    this.robots = [];
    this.measured = []; // robot, place, number of the row
  }

  take(rows) {
    for (; this.count < rows.length; this.count++) {
      const [robot, time, x, y, value] = rows[this.count];
      const trail = (this.robots[robot] ??= []);
      let at = trail.length;
      while (at > 0 && trail[at - 1][0] > time) at--;
      trail.splice(at, 0, [time, [x, y]]);
      if (value !== null) this.measured.push([robot, [x, y], this.count]);
    }
  }
}

export function colourOf(look, robot) {
  return look.robots[robot % look.robots.length];
}

export function draw(context, pixels, { place, changes, robots, look }, trails, out, shown, colours) {
  const line = (points, close = false) => {
    context.beginPath();
    points.forEach((point, i) => context[i ? "lineTo" : "moveTo"](...pixels(point)));
    if (close) context.closePath();
  };
  const stroke = (colour, width, dash = []) => {
    context.setLineDash(dash);
    context.strokeStyle = colour;
    context.lineWidth = width;
    context.stroke();
    context.setLineDash([]);
  };
  const halo = (colour, width, dash = []) => {
    stroke("rgba(255,255,255,0.85)", width + 2.4);
    stroke(colour, width, dash);
  };
  context.lineJoin = context.lineCap = "round";
  for (const ring of place.no_go) zone(context, line, ring, pixels);
  for (const { ring, name: title } of changes.zones) {
    zone(context, line, ring, pixels);
    label(context, title, pixels(middle(ring)), colours);
  }
  context.lineCap = "butt";
  if (place.area) {
    line(place.area, true);
    stroke(colours.ink, 1.4);
  }
  for (const end of place.ends) square(context, pixels(end));
  for (const start of place.starts) dot(context, pixels(start), 5, "#ffffff", "#000000", 2);
  if (shown.has("radio")) radio(context, pixels, robots, colours);
  robots.forEach((robot, i) => {
    const colour = colourOf(look, i);
    const dash = DASHES[Math.floor(i / look.robots.length) % DASHES.length];
    if (shown.has("trails") && trails.robots[i]) {
      line([place.starts[i] ?? trails.robots[i][0][1], ...trails.robots[i].map(([, at]) => at), robot.at]);
      halo(colour, 2.2, dash);
    }
    if (shown.has("homes") && robot.home) {
      line([robot.at, ...robot.home.way]);
      halo(colour, 2, [10, 3, 2, 3]);
    }
    if (shown.has("intents") && robot.intent) intent(context, line, stroke, pixels, robot, colour, look.radius);
    if (shown.has("plans") && robot.plan.length) {
      line(robot.plan);
      halo(colour, 2, [7, 5]);
      dot(context, pixels(robot.plan.at(-1)), 3.5, "#ffffff", colour, 2);
    }
  });
  if (shown.has("measured"))
    for (const [robot, at, row] of trails.measured)
      if (out.has(row)) cross(context, pixels(at));
      else dot(context, pixels(at), 2.6, colourOf(look, robot), "#ffffff", 0.8);
  robots.forEach((robot, i) => vessel(context, pixels, robot, trails.robots[i], colourOf(look, i)));
  if (shown.has("names"))
    robots.forEach((robot) => {
      const [x, y] = pixels(robot.at);
      label(context, robot.silent ? `${robot.name} (silent)` : robot.name, [x, y - 17], colours);
    });
}

function zone(context, line, ring, pixels) {
  line(ring, true);
  context.save();
  context.clip();
  context.fillStyle = "rgba(222,222,222,0.92)";
  context.fill();
  const points = ring.map(pixels);
  const [xs, ys] = [points.map(([x]) => x), points.map(([, y]) => y)];
  // No more lines than can be seen: a zone may reach far beyond the canvas.
  const [west, east] = [Math.max(Math.min(...xs), -10), Math.min(Math.max(...xs), context.canvas.clientWidth + 10)];
  const [top, bottom] = [Math.max(Math.min(...ys), -10), Math.min(Math.max(...ys), context.canvas.clientHeight + 10)];
  context.beginPath();
  for (let x = west - (bottom - top); x < east; x += 8) {
    context.moveTo(x, bottom);
    context.lineTo(x + (bottom - top), top);
  }
  context.strokeStyle = "#777777";
  context.lineWidth = 1.2;
  context.stroke();
  context.restore();
  line(ring, true);
  context.strokeStyle = "#555555";
  context.lineWidth = 1.2;
  context.stroke();
}

function middle(ring) {
  return [0, 1].map((axis) => ring.reduce((sum, point) => sum + point[axis], 0) / ring.length);
}

function dot(context, [x, y], radius, fill, edge, width) {
  context.beginPath();
  context.arc(x, y, radius, 0, 2 * Math.PI);
  context.fillStyle = fill;
  context.fill();
  context.strokeStyle = edge;
  context.lineWidth = width;
  context.stroke();
}

function square(context, [x, y]) {
  context.beginPath();
  context.rect(x - 7, y - 7, 14, 14);
  for (const [colour, width] of [["#ffffff", 4], ["#000000", 1.8]]) {
    context.strokeStyle = colour;
    context.lineWidth = width;
    context.stroke();
  }
}

function cross(context, [x, y]) {
  context.beginPath();
  for (const side of [-1, 1]) {
    context.moveTo(x - 5, y - 5 * side);
    context.lineTo(x + 5, y + 5 * side);
  }
  for (const [colour, width] of [["#ffffff", 5], ["#b3001b", 2.4]]) {
    context.strokeStyle = colour;
    context.lineWidth = width;
    context.stroke();
  }
}

function intent(context, line, stroke, pixels, robot, colour, radius) {
  if (robot.intent.places) {
    line([robot.at, ...robot.intent.places]);
    stroke("rgba(255,255,255,0.8)", 3.6);
    stroke(colour, 1.8, [2, 3]);
    for (const at of robot.intent.places) dot(context, pixels(at), 2.8, "#ffffff", colour, 1.4);
    return;
  }
  const [[x, y], [xx, xy, yy]] = [robot.intent.mean, robot.intent.covariance];
  const a = Math.sqrt(Math.max(xx, 0));
  const [b, c] = a > 0 ? [xy / a, Math.sqrt(Math.max(yy - (xy / a) ** 2, 0))] : [0, Math.sqrt(Math.max(yy, 0))];
  const turns = Array.from({ length: 48 }, (_, i) => (i * Math.PI) / 24);
  line(turns.map((t) => [x + radius * a * Math.cos(t), y + radius * (b * Math.cos(t) + c * Math.sin(t))]), true);
  context.globalAlpha = 0.14;
  context.fillStyle = colour;
  context.fill();
  context.globalAlpha = 1;
  stroke("rgba(255,255,255,0.8)", 3.4);
  stroke(colour, 1.8, [2, 3]);
}

// A robot points to where it goes, else to where it went; one that is silent is hollow.
function vessel(context, pixels, robot, trail, colour) {
  const here = pixels(robot.at);
  const towards = robot.plan[1] ?? null;
  const from = trail?.map(([, at]) => at).findLast((at) => at[0] !== robot.at[0] || at[1] !== robot.at[1]);
  const [tip, tail] = towards ? [pixels(towards), here] : [here, from ? pixels(from) : [here[0], here[1] + 1]];
  context.save();
  context.translate(...here);
  context.rotate(Math.atan2(tip[1] - tail[1], tip[0] - tail[0]));
  context.beginPath();
  context.moveTo(13, 0);
  context.lineTo(-8, 8);
  context.lineTo(-4, 0);
  context.lineTo(-8, -8);
  context.closePath();
  context.strokeStyle = "#ffffff";
  context.lineWidth = 5;
  context.stroke();
  context.fillStyle = robot.silent ? "#ffffff" : colour;
  context.fill();
  context.strokeStyle = robot.silent ? colour : "#1a1a1a";
  context.lineWidth = robot.silent ? 2.4 : 1.2;
  if (robot.silent) context.setLineDash([3, 2]);
  context.stroke();
  context.restore();
}

function label(context, text, [x, y], colours) {
  context.font = colours.font;
  context.textAlign = "center";
  context.textBaseline = "middle";
  context.lineJoin = "round";
  context.strokeStyle = "rgba(255,255,255,0.92)";
  context.lineWidth = 4;
  const short = text.length > 24 ? `${text.slice(0, 23)}…` : text;
  const half = context.measureText(short).width / 2 + 4;
  const within = Math.min(Math.max(x, half), Math.max(context.canvas.clientWidth - half, half));
  context.strokeText(short, within, y);
  context.fillStyle = "#111111";
  context.fillText(short, within, y);
}

// A line between two that hear each other; dashed where only one hears the other.
function radio(context, pixels, robots, colours) {
  const hears = (one, other) => !one.silent && (one.hears?.includes(other.name) ?? false);
  robots.forEach((one, i) =>
    robots.slice(i + 1).forEach((other) => {
      const both = hears(one, other) && hears(other, one);
      if (!both && !hears(one, other) && !hears(other, one)) return;
      context.beginPath();
      context.moveTo(...pixels(one.at));
      context.lineTo(...pixels(other.at));
      for (const [colour, width] of [["rgba(255,255,255,0.8)", 4], ["#333333", 1.6]]) {
        context.setLineDash(both ? [] : [4, 5]);
        context.strokeStyle = colour;
        context.lineWidth = width;
        context.stroke();
      }
      context.setLineDash([]);
    }),
  );
}
