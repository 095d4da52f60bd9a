// What is drawn on the maps: a field each, and the same routes, measurements, robots and intents on all of them.
const FONT = { family: getComputedStyle(document.body).fontFamily, size: 12, color: "#1a1a1a" };
const coarse = window.matchMedia("(pointer: coarse)").matches;
const CONFIG = {
  displaylogo: false,
  displayModeBar: coarse ? false : "hover",
  modeBarButtonsToRemove: ["select2d", "lasso2d", "autoScale2d"],
  doubleClick: "reset",
};
const PREDICTED = "#9cc3e5";
const OUTLINE = { color: "#1a1a1a", width: 1.5 };
const TRUE_OUTLINE = { color: "#b3001b", width: 2.5, dash: "dash" };

const pictures = {
  mean: unpack(data.frames.mean),
  std: unpack(data.frames.std),
  surplus: unpack(data.frames.surplus),
  truth: data.truth && unpack(data.truth),
  true_surplus: data.true_surplus && unpack(data.true_surplus),
  foreseen: data.foreseen && unpack(data.foreseen.mean),
  foreseen_surplus: data.foreseen && unpack(data.foreseen.surplus),
  foreseen_std: data.foreseen && unpack(data.foreseen.std),
};

const [west, south, east, north] = data.axes.shown;
const ratio = ((north - south) * data.axes.aspect) / (east - west);

// Room for the longest number beside a map.
const tickDecimals = Math.max(0, Math.ceil(-Math.log10((north - south) / 8)));
const longest = Math.max(...[south, north].map((value) => value.toFixed(tickDecimals).length));
const MARGIN = { l: Math.max(56, Math.round(34 + 7.5 * longest)), r: 8, t: 6, b: 42 };
document.documentElement.style.setProperty("--left", `${MARGIN.l}px`);
const GRID = { x0: data.grid.x[0], dx: data.grid.x[1], y0: data.grid.y[0], dy: data.grid.y[1] };

function scale(colours) {
  return colours.map((colour, index) => [index / (colours.length - 1), colour]);
}

function heat(picture, limits, colours, name) {
  const position = `%{x:.${data.axes.decimals + 1}f}, %{y:.${data.axes.decimals + 1}f}`;
  return {
    type: "heatmap", ...GRID, z: picture, zmin: limits[0], zmax: limits[1], colorscale: scale(colours), showscale: false,
    zsmooth: "fast", hovertemplate: `${name} %{z:.4~g}${valueUnit && ` ${valueUnit}`}<br>${position}<extra></extra>`,
  };
}

// The line at which a surplus is 0.
function outline(picture, line) {
  return {
    type: "contour", ...GRID, z: picture, autocontour: false, showscale: false, hoverinfo: "skip", line,
    contours: { start: 0, end: 0, size: 1, coloring: "none", showlabels: false },
  };
}

// The region where a surplus is not negative.
function region(picture) {
  return {
    ...outline(picture, { ...OUTLINE }), colorscale: [[0, "#ffffff"], [0.5, "#ffffff"], [0.5, PREDICTED], [1, PREDICTED]],
    contours: { start: 0, end: 0, size: 1, coloring: "fill", showlabels: false },
  };
}

// Rings in one trace, each closed.
function closed(rings) {
  const x = [], y = [];
  for (const ring of rings) {
    x.push(...ring.x, ring.x[0], null);
    y.push(...ring.y, ring.y[0], null);
  }
  return { x, y };
}

// All but the area, as one polygon: around everything, over a bridge into the ring, and back.
function outsideOf(ring) {
  const [left, bottom, right, top] = data.axes.whole;
  const x0 = Math.min(left, west) - (right - left), x1 = Math.max(right, east) + (right - left);
  const y0 = Math.min(bottom, south) - (top - bottom), y1 = Math.max(top, north) + (top - bottom);
  let twice = 0;
  for (let i = 0; i < ring.x.length; i++) {
    const j = (i + 1) % ring.x.length;
    twice += ring.x[i] * ring.y[j] - ring.x[j] * ring.y[i];
  }
  const x = [...ring.x], y = [...ring.y];
  if (twice > 0) {
    x.reverse();
    y.reverse();
  }
  return { x: [x0, x1, x1, x0, x0, ...x, x[0], x0], y: [y0, y0, y1, y1, y0, ...y, y[0], y0] };
}

function still() {
  const quiet = { type: "scatter", mode: "lines", hoverinfo: "skip" };
  const traces = [
    { ...quiet, ...outsideOf(data.area), fill: "toself", fillcolor: "#ffffff", line: { width: 0 } },
    { ...quiet, ...closed([data.area]), line: { color: "#333333", width: 1.5 } },
  ];
  if (data.no_go.length)
    traces.push({
      ...quiet, ...closed(data.no_go), fill: "toself", fillcolor: "#dddddd", line: { color: "#6e6e6e", width: 1 },
      fillpattern: { shape: "/", bgcolor: "#dddddd", fgcolor: "#8a8a8a", size: 7, solidity: 0.2 },
    });
  return traces;
}
const STILL = still();

// What moves, the same on every map but for filled intents; `now` is the time of frame `k`.
function moving(k, filled) {
  const now = data.frames.time[k];
  const traces = [];
  const robots = data.robots.map((robot, index) => ({ ...robot, index, here: place(robot, now) }));
  const visible = robots.filter((robot) => shown.robots[robot.index]);
  if (data.prior)
    traces.push({
      type: "scatter", mode: "markers", x: shown.prior ? data.prior.x : [], y: shown.prior ? data.prior.y : [],
      text: data.prior.value.map((value) => `earlier sample: ${withUnit(written(value, 4), valueUnit)}`), hoverinfo: "text",
      marker: { symbol: "x-thin", size: 7, line: { color: "#333333", width: 1.5 } },
    });
  const told = shown.told && data.standing ? data.standing[k] : [];
  for (const robot of robots) {
    const entry = shown.robots[robot.index] && told[robot.index] >= 0 ? data.told[told[robot.index]] : null;
    const ellipse = (entry && entry.ellipse) || { x: [], y: [] };
    const future = entry ? by(entry.places.time, now) : 0;
    const ahead = entry && future < entry.places.x.length;
    if (data.standing)
      traces.push(
        {
          type: "scatter", mode: "lines", ...ellipse, fill: "toself", fillcolor: filled ? `${robot.colour}33` : "#ffffff00", hoverinfo: "skip",
          line: { color: robot.colour, width: 1.5, dash: "dot" },
        },
        {
          type: "scatter", mode: "lines+markers", hoverinfo: "skip",
          x: ahead ? [robot.here[0], ...entry.places.x.slice(future)] : [],
          y: ahead ? [robot.here[1], ...entry.places.y.slice(future)] : [],
          line: { color: robot.colour, width: 1.5, dash: "dot" },
          marker: { symbol: "circle-open", size: 8, color: robot.colour, line: { width: 1.5 } },
        },
      );
  }
  const trails = robots.map((robot) => {
    if (!shown.routes || !shown.robots[robot.index]) return { x: [], y: [] };
    const count = by(robot.route.time, now);
    return {
      x: [...robot.route.x.slice(0, count), robot.here[0]],
      y: [...robot.route.y.slice(0, count), robot.here[1]],
    };
  });
  const halo = { x: [], y: [] };
  for (const trail of trails) {
    halo.x.push(...trail.x, null);
    halo.y.push(...trail.y, null);
  }
  traces.push({ type: "scatter", mode: "lines", ...halo, hoverinfo: "skip", line: { color: "#ffffff", width: 4.5 } });
  for (const robot of robots)
    traces.push({
      type: "scatter", mode: "lines", ...trails[robot.index], hoverinfo: "skip",
      line: { color: robot.colour, width: 2.5, dash: robot.dash },
    });
  const spots = { x: [], y: [], text: [], colour: [] };
  if (shown.measured)
    for (const robot of visible) {
      const measured = robot.measured;
      for (let i = 0; i < by(measured.time, now); i++) {
        spots.x.push(measured.x[i]);
        spots.y.push(measured.y[i]);
        spots.colour.push(robot.colour);
        const value = withUnit(written(measured.value[i], 4), valueUnit);
        spots.text.push(`${plain(robot.name)}, ${timeText(measured.time[i])}: ${value}`);
      }
    }
  traces.push({
    type: "scatter", mode: "markers", x: spots.x, y: spots.y, text: spots.text, hoverinfo: "text",
    marker: { size: 6.5, color: spots.colour, line: { color: "#ffffff", width: 1 } },
  });
  const starts = shown.starts ? visible.map((robot) => [robot.route.x[0], robot.route.y[0]]) : [];
  traces.push({
    type: "scatter", mode: "markers", x: starts.map((p) => p[0]), y: starts.map((p) => p[1]), hoverinfo: "skip",
    marker: { size: 10, color: "#ffffff", line: { color: "#000000", width: 2 } },
  });
  const labels = names(visible);
  traces.push({
    type: "scatter", mode: "markers+text", x: visible.map((robot) => robot.here[0]), y: visible.map((robot) => robot.here[1]),
    marker: { size: 12, symbol: "square", color: visible.map((robot) => robot.colour), line: { color: "#000000", width: 1.5 } },
    text: labels.map((label) => label.text), textposition: labels.map((label) => label.position),
    textfont: { size: 12, color: "#000000", weight: 700, shadow: "auto" },
    hovertext: visible.map((robot) => plain(robot.name)), hoverinfo: "text",
  });
  return traces;
}

// A name beside every robot, one for those that are together; on the side where there is room.
function names(robots) {
  const near = 0.02 * Math.max(east - west, (north - south) * data.axes.aspect);
  const groups = [];
  return robots.map((robot) => {
    const [x, y] = robot.here;
    const side = x > west + 0.8 * (east - west) ? "left" : x < west + 0.2 * (east - west) ? "right" : "center";
    const position = `${y > south + 0.85 * (north - south) ? "bottom" : "top"} ${side}`;
    const group = groups.find((other) => Math.hypot(x - other.x, (y - other.y) * data.axes.aspect) < near);
    if (!shown.names || group) return { text: "", position };
    groups.push({ x, y });
    const together = robots.filter((o) => Math.hypot(x - o.here[0], (y - o.here[1]) * data.axes.aspect) < near);
    const text = together.length > 3 ? `${together.length} robots` : together.map((o) => short(o.name)).join(", ");
    return { text: plain(text), position };
  });
}

function short(name) {
  const signs = [...name];
  return signs.length > 16 ? `${signs.slice(0, 15).join("")}…` : name;
}
