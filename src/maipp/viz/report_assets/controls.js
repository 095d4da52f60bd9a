// The slider, the buttons and the switches.
const slider = document.getElementById("moment");
const play = document.getElementById("play");
const FRAME_MS = 160;
let drawing = null; // the frame on its way to the screen
let wanted = last;
let timer = null;

function tell(k) {
  const { trace, area, rmse } = data.frames;
  const time = timeText(data.frames.time[k]);
  const parts = [`Tr(P) ${written(trace[k])}`];
  if (data.truth) parts.push(withUnit(`RMSE ${written(rmse[k])}`, data.value.unit));
  const bold = document.createElement("b");
  bold.textContent = data.time.unit ? time : `time ${time}`;
  const more = document.createElement("span");
  more.textContent = ` ${parts.join(", ")}`;
  document.getElementById("now").replaceChildren(bold, more);
  slider.setAttribute("aria-valuetext", `${time}, ${parts.join(", ")}, area ${written(100 * area[k])} %`);
}

// Draw a frame; of those asked for meanwhile, the latest comes next.
async function show(k) {
  wanted = k;
  slider.value = k;
  tell(k);
  if (drawing !== null) return;
  drawing = k;
  try {
    await Promise.all([drawMaps(k), drawCurves(k)]);
    document.body.dataset.frame = k;
  } finally {
    drawing = null;
  }
  if (wanted !== k) await show(wanted);
}

function setPlaying(on) {
  clearTimeout(timer);
  timer = null;
  play.setAttribute("aria-label", on ? "Pause" : "Play");
  play.querySelector("path").setAttribute("d", on ? "M3 2H7V14H3ZM9 2H13V14H9Z" : "M3 1.500L14 8L3 14.500Z");
  if (on) timer = setTimeout(advance, FRAME_MS);
}

async function advance() {
  const begun = performance.now();
  await show(Math.min(wanted + 1, last));
  if (timer === null) return; // paused meanwhile
  if (wanted >= last) setPlaying(false);
  else timer = setTimeout(advance, Math.max(20, FRAME_MS - (performance.now() - begun)));
}

function step(by) {
  setPlaying(false);
  show(Math.min(Math.max(wanted + by, 0), last));
}

slider.addEventListener("input", () => {
  setPlaying(false);
  show(Number(slider.value));
});
play.addEventListener("click", async () => {
  if (timer !== null) return setPlaying(false);
  setPlaying(true);
  if (wanted >= last) await show(0);
});
document.getElementById("back").addEventListener("click", () => step(-1));
document.getElementById("forward").addEventListener("click", () => step(1));
for (const box of document.querySelectorAll("#legend input")) {
  box.checked = true; // browsers keep the state of a page that is loaded again
  box.addEventListener("change", () => {
    if (box.dataset.robot !== undefined) shown.robots[Number(box.dataset.robot)] = box.checked;
    else shown[box.dataset.layer] = box.checked;
    show(wanted);
  });
}
if (last === 0) for (const control of [slider, play, ...document.querySelectorAll("#back, #forward")]) control.disabled = true;

function sizeAll(width) {
  if (width === undefined) arrangeMaps();
  const all = document.getElementById("maps");
  const columns = getComputedStyle(all).gridTemplateColumns.split(" ").length;
  const gap = parseFloat(getComputedStyle(all).columnGap) || 0;
  for (const map of maps) sizeMap(map, width ?? Math.floor((all.clientWidth - (columns - 1) * gap) / columns));
  for (const curve of curves) curve.layout.width = width ?? curve.panel.clientWidth;
}

// Phones hide and show their address bar while one scrolls: the height alone is no reason to draw anew.
let widths = "";
function resized() {
  const now = String(document.getElementById("maps").clientWidth);
  if (now === widths) return;
  widths = now;
  sizeAll();
  show(wanted);
}
const PRINTED = 330; // pixels a map on paper, two side by side
window.addEventListener("beforeprint", () => {
  setPlaying(false);
  sizeAll(PRINTED);
  show(wanted);
});
window.addEventListener("afterprint", () => {
  widths = "";
  resized();
});

setPlaying(false);
sizeAll();
widths = String(document.getElementById("maps").clientWidth);
show(last).then(() => {
  linkMaps();
  new ResizeObserver(resized).observe(document.getElementById("maps"));
  window.addEventListener("resize", resized);
  document.body.dataset.ready = "yes";
});
