// The panels of the maps: what each shows, its colour bar or key, its size, and the zoom that all share.
const limits = data.limits;
const maps = [
  {
    id: "mean", title: `Predicted ${data.value.name}`, colours: data.colours.value, limits: limits.value, mark: true,
    about: "line: border of the predicted area of high interest",
    fields: (k) => [
      heat(pictures.mean(k), limits.value, data.colours.value, "predicted"), outline(pictures.surplus(k), OUTLINE),
    ],
  },
  {
    id: "std", title: "Standard deviation", colours: data.colours.std, limits: limits.std,
    fields: (k) => [heat(pictures.std(k), limits.std, data.colours.std, "standard deviation")],
  },
  {
    id: "area", title: "Area of high interest",
    fields: (k) => [
      region(pictures.surplus(k)), ...(data.truth ? [outline(pictures.true_surplus(0), TRUE_OUTLINE)] : []),
    ],
  },
];
if (data.truth)
  maps.push({
    id: "truth", title: `True ${data.value.name}`, colours: data.colours.value, limits: limits.value, mark: true,
    fields: () => [
      heat(pictures.truth(0), limits.value, data.colours.value, "true"), outline(pictures.true_surplus(0), TRUE_OUTLINE),
    ],
  });
if (data.foreseen)
  maps.push(
    {
      id: "foreseen", title: `Foreseen ${data.value.name} (${data.foreseen.name}), at the end`, colours: data.colours.value,
      limits: limits.value, mark: true, about: "line: the threshold",
      fields: () => [
        heat(pictures.foreseen(0), limits.value, data.colours.value, "foreseen"), outline(pictures.foreseen_surplus(0), OUTLINE),
      ],
    },
    {
      id: "foreseen-std", title: `Standard deviation (${data.foreseen.name}), at the end`, colours: data.colours.std,
      limits: data.foreseen.std_limits,
      fields: () => [heat(pictures.foreseen_std(0), data.foreseen.std_limits, data.colours.std, "standard deviation")],
    },
  );

function axis(title, low, high) {
  return {
    title: { text: plain(title), standoff: 6 }, range: [low, high], showgrid: false, zeroline: false, ticks: "outside",
    ticklen: 4, nticks: 6, showline: true, mirror: true, linecolor: "#555555", constrain: "domain", tickangle: 0,
    hoverformat: `.${data.axes.decimals + 1}f`, tickformat: `.${data.axes.decimals + 2}~f`, automargin: false,
  };
}

function mapLayout() {
  return {
    margin: { ...MARGIN }, font: FONT, showlegend: false, hovermode: "closest", uirevision: "same", autosize: false,
    dragmode: coarse ? false : "zoom", plot_bgcolor: "#ffffff", paper_bgcolor: "#ffffff",
    xaxis: { ...axis(data.axes.x, west, east), fixedrange: coarse },
    yaxis: {
      ...axis(data.axes.y, south, north), scaleanchor: "x", scaleratio: data.axes.aspect, fixedrange: coarse,
    },
  };
}

function element(tag, attributes, ...children) {
  const node = document.createElement(tag);
  for (const [name, value] of Object.entries(attributes)) node.setAttribute(name, value);
  node.append(...children);
  return node;
}

// Ticks at round values, four or five of them.
function roundValues(low, high) {
  const power = 10 ** Math.floor(Math.log10((high - low) / 4));
  const step = [1, 2, 2.5, 5, 10].map((nice) => nice * power).find((size) => (high - low) / size <= 6);
  const values = [];
  for (let n = Math.ceil(low / step - 1e-9); n * step <= high + 1e-9 * step; n++) values.push(n * step);
  const decimals = Math.max(0, Math.min(9, -Math.floor(Math.log10(step) + 1e-9) + (String(step / power).includes(".") ? 1 : 0)));
  return values.map((value) => [value, value.toFixed(decimals)]);
}

function colourBar(map) {
  const [low, high] = map.limits;
  const ramp = element("div", { class: "ramp" });
  ramp.style.background = `linear-gradient(to right, ${map.colours.join(", ")})`;
  const ticks = element("div", { class: "ticks" });
  const at = (value) => `${(100 * (value - low)) / (high - low)}%`;
  for (const [value, text] of roundValues(low, high)) {
    const tick = element("span", {}, text);
    tick.style.left = at(value);
    ticks.append(tick);
  }
  const threshold = data.value.threshold;
  const marked = map.mark && threshold > low && threshold < high;
  if (marked) {
    const mark = element("i", { title: "threshold" });
    mark.style.left = at(threshold);
    ramp.append(mark);
  }
  const name = map.id.endsWith("std") ? `standard deviation of ${data.value.name}` : data.value.name;
  const label = withUnit(name, data.value.unit && `(${data.value.unit})`);
  const mark = marked ? `; black mark: threshold ${withUnit(setting(threshold), data.value.unit)}` : "";
  const about = map.about ? `; ${map.about}` : "";
  return element("div", { class: "bar" }, ramp, ticks, element("div", {}, `${label}${mark}${about}`));
}

function areaKey() {
  const entries = [element("span", {}, element("i", { class: "predicted" }), "predicted")];
  if (data.truth) entries.push(element("span", {}, element("i", { class: "true" }), "border of the true one"));
  if (data.no_go.length) entries.push(element("span", {}, element("i", { class: "nogo" }), "no-go zone"));
  if (data.told.some((told) => told.ellipse)) entries.push(element("span", {}, "dotted ellipses: 90 % of a robot's intent"));
  if (data.told.some((told) => told.places.x.length))
    entries.push(element("span", {}, "dotted lines: where a robot means to measure next"));
  return element("div", { class: "key" }, ...entries);
}

for (const map of maps) {
  map.plot = element("div", { class: "plot", id: `map-${map.id}`, role: "img" });
  map.panel = element("figure", { class: "panel" }, element("h3", {}, map.title), map.plot);
  map.panel.append(map.id === "area" ? areaKey() : colourBar(map));
  map.layout = mapLayout();
  document.getElementById("maps").append(map.panel);
}

// As many maps in a row as there is room for, with no row left half empty.
const LEAST_WIDTH = ratio > 2 ? 230 : ratio < 0.45 ? 480 : 320;
function arrangeMaps() {
  const room = document.getElementById("maps").clientWidth;
  const columns = [maps.length, maps.length / 2, 1].find((n) => Number.isInteger(n) && room / n >= LEAST_WIDTH) ?? 1;
  document.documentElement.style.setProperty("--columns", columns);
}

// A map is as high as its proportions ask, but never higher than the window leaves room for.
function sizeMap(map, room) {
  const most = Math.max(260, 0.74 * window.innerHeight);
  const width = Math.min(room, Math.max(LEAST_WIDTH, Math.round(most / ratio) + MARGIN.l + MARGIN.r));
  const inner = width - MARGIN.l - MARGIN.r;
  map.layout.width = width;
  map.layout.height = Math.round(Math.min(inner * ratio, most) + MARGIN.t + MARGIN.b);
  map.panel.style.maxWidth = `${width}px`;
}

function drawMaps(k) {
  const common = { true: moving(k, true), false: moving(k, false) };
  return Promise.all(
    maps.map((map) => {
      map.plot.setAttribute("aria-label", `${map.title} on a map, at ${timeText(data.frames.time[k])}`);
      return Plotly.react(map.plot, [...map.fields(k), ...STILL, ...common[map.id === "area"]], map.layout, CONFIG);
    }),
  );
}

// Whoever zooms into one map sees the same part on all.
let linking = false;
function linkMaps() {
  for (const map of maps)
    map.plot.on("plotly_relayout", (change) => {
      if (linking || !Object.keys(change).some((key) => /^[xy]axis/.test(key))) return;
      linking = true;
      const { xaxis, yaxis } = map.plot.layout;
      const ranges = { "xaxis.range": [...xaxis.range], "yaxis.range": [...yaxis.range] };
      Promise.all(maps.filter((other) => other !== map).map((other) => Plotly.relayout(other.plot, ranges))).finally(() => {
        linking = false;
      });
    });
}
