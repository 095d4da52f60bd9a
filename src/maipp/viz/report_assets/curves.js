// The curves over time, with the slider's moment on them.
const BLUE = "#0b5c94";
const timeTitle = data.time.unit ? `time (${data.time.unit})` : "time (unit: one domain unit at speed 1)";

const curves = [
  {
    id: "trace", title: "Uncertainty left: Tr(P) over the predicted area of high interest", log: true, shape: "hv",
    label: "Tr(P), normalised units²", x: data.curve.time, y: data.curve.trace, moments: data.frames.trace,
    text: data.curve.distance.map((distance) => `team travelled ${written(distance)} ${data.length}`),
  },
];
if (data.truth)
  curves.push({
    id: "rmse", title: "Map error (RMSE over the survey area)", log: false, shape: "linear",
    label: data.value.unit ? `RMSE (${data.value.unit})` : `RMSE of ${data.value.name}`,
    x: data.frames.time, y: data.frames.rmse, moments: data.frames.rmse, text: data.frames.time.map(() => ""),
  });

for (const curve of curves) {
  curve.plot = element("div", { class: "plot", id: `curve-${curve.id}`, role: "img" });
  curve.panel = element("figure", { class: "panel" }, element("h3", {}, curve.title), curve.plot);
  document.getElementById("curves").append(curve.panel);
  const end = data.frames.time[last] || 1;
  curve.layout = {
    margin: { l: 66, r: 14, t: 8, b: 44 }, height: 240, font: FONT, showlegend: false, hovermode: "closest", autosize: false,
    dragmode: false, plot_bgcolor: "#ffffff", paper_bgcolor: "#ffffff",
    xaxis: { title: { text: plain(timeTitle), standoff: 6 }, range: [0, 1.02 * end], gridcolor: "#e3e3e3", fixedrange: true },
    yaxis: {
      title: { text: plain(curve.label), standoff: 6 }, type: curve.log ? "log" : "linear", gridcolor: "#e3e3e3",
      rangemode: "tozero", fixedrange: true, exponentformat: "power", dtick: curve.log ? undefined : null, nticks: 6,
    },
  };
}

function drawCurves(k) {
  const now = data.frames.time[k];
  return Promise.all(
    curves.map((curve) => {
      const value = curve.moments[k];
      curve.plot.setAttribute("aria-label", `${curve.title}: ${written(value)} at ${timeText(now)}`);
      const traces = [
        {
          type: "scatter", mode: "lines", x: [...curve.x, ...(curve.shape === "hv" ? [data.frames.time[last]] : [])],
          y: [...curve.y, ...(curve.shape === "hv" ? curve.y.slice(-1) : [])], text: curve.text, hoverinfo: "x+y+text",
          line: { color: BLUE, width: 2, shape: curve.shape },
        },
        {
          type: "scatter", mode: "markers", x: [now], y: [value], hoverinfo: "skip",
          marker: { size: 11, color: "#d55e00", line: { color: "#000000", width: 1.5 } },
        },
      ];
      const line = { type: "line", x0: now, x1: now, yref: "paper", y0: 0, y1: 1, line: { color: "#d55e00", width: 1.5, dash: "dot" } };
      return Plotly.react(curve.plot, traces, { ...curve.layout, shapes: [line] }, { displayModeBar: false });
    }),
  );
}
