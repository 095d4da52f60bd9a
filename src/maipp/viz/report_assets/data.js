// The page's data, unpacked.
const data = JSON.parse(document.getElementById("data").textContent);
const last = data.frames.time.length - 1;

// 16-bit numbers in base64, one picture after the other (viz/report_data.py, packed).
function unpack(packed) {
  const bytes = Uint8Array.from(atob(packed.numbers), (sign) => sign.charCodeAt(0));
  const view = new DataView(bytes.buffer);
  const { rows, columns } = data.grid;
  return (picture) => {
    const lines = [];
    for (let row = 0; row < rows; row++) {
      const line = new Array(columns);
      for (let column = 0; column < columns; column++) {
        const number = view.getUint16(2 * ((picture * rows + row) * columns + column), true);
        line[column] = number === 65535 ? null : packed.base + packed.step * number;
      }
      lines.push(line);
    }
    return lines;
  };
}

// Plotly reads some HTML and %{...} in texts: none of it may come from a name.
function plain(text) {
  const signs = { "&": "&amp;", "<": "&lt;", ">": "&gt;", "%": "&#37;" };
  return text.replace(/[&<>%]/g, (sign) => signs[sign]);
}

// A number with some significant digits, never fewer than its whole ones.
function written(value, digits = 3) {
  if (value === null || !Number.isFinite(value)) return "unknown";
  const size = Math.abs(value);
  if (size !== 0 && (size < 1e-5 || size >= 1e9)) return value.toExponential(digits - 1);
  const decimals = size === 0 ? 0 : Math.max(0, digits - 1 - Math.floor(Math.log10(size)));
  return value.toFixed(Math.min(decimals, 9));
}

// A number that a person chose: no zeros at the end.
function setting(value) {
  return String(Number(value.toPrecision(4)));
}

function withUnit(text, unit) {
  return unit ? `${text} ${unit}` : text;
}

function timeText(value) {
  return withUnit(value.toFixed(data.time.step), data.time.unit);
}

// "depth (m)"; as Plotly may read it.
const valueLabel = plain(data.value.unit ? `${data.value.name} (${data.value.unit})` : data.value.name);
const valueUnit = plain(data.value.unit);

// What happened by the time of a frame, the instant itself included.
const instant = data.frames.time.length > 1 ? 1e-3 * data.frames.time[1] : 1e-9;
function by(times, now) {
  let count = 0;
  while (count < times.length && times[count] <= now + instant) count++;
  return count;
}

// Where a robot is: between the vertices of its route before and after.
function place(robot, now) {
  const { x, y, time } = robot.route;
  const next = by(time, now);
  if (next >= time.length || next === 0) {
    const index = Math.max(next - 1, 0);
    return [x[index], y[index]];
  }
  const share = (now - time[next - 1]) / (time[next] - time[next - 1]);
  return [x[next - 1] + share * (x[next] - x[next - 1]), y[next - 1] + share * (y[next] - y[next - 1])];
}

const shown = { robots: data.robots.map(() => true), routes: true, names: true, measured: true, starts: true, told: true,
  prior: true };
