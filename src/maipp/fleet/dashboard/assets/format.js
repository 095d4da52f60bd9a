// Numbers and times as people read them.
export function length(value, unit) {
  if (unit !== "m") return `${value.toFixed(3)} ${unit === "domain units" ? "units" : unit}`;
  if (value < 2000) return `${value.toFixed(value < 10 ? 1 : 0)} m`;
  return `${(value / 1000).toFixed(value < 1e4 ? 2 : value < 1e5 ? 1 : 0)} km`;
}

// Seconds since the start of the survey.
export function time(seconds) {
  if (seconds < 60) return `${seconds.toFixed(seconds < 10 ? 2 : 0)} s`;
  const whole = Math.round(seconds);
  const parts = [Math.floor(whole / 60) % 60, whole % 60].map((part) => String(part).padStart(2, "0"));
  return `${Math.floor(whole / 3600)}:${parts.join(":")}`;
}

export function ago(seconds) {
  if (seconds < 1.5) return "just now";
  return seconds < 120 ? `${Math.round(seconds)} s ago` : `${Math.round(seconds / 60)} min ago`;
}

// With as many digits as tell values apart whose spread is given.
export function value(number, spread) {
  const digits = spread > 0 ? Math.max(0, Math.min(6, 2 - Math.floor(Math.log10(spread)))) : 3;
  return number.toFixed(digits);
}

export function withUnit(text, unit) {
  return unit ? `${text} ${unit}` : text;
}

// Round values, four or five of them, between two.
export function roundValues(low, high) {
  const power = 10 ** Math.floor(Math.log10((high - low) / 4));
  const step = [1, 2, 2.5, 5, 10].map((nice) => nice * power).find((size) => (high - low) / size <= 6);
  const decimals = Math.max(0, Math.min(9, -Math.floor(Math.log10(step) + 1e-9) + (step / power === 2.5 ? 1 : 0)));
  const values = [];
  for (let n = Math.ceil(low / step - 1e-9); n * step <= high + 1e-9 * step; n++) values.push(n * step);
  return values.map((number) => [number, number.toFixed(decimals)]);
}

// An element with attributes, and texts or elements in it. Names that somebody chose never become anything but text.
export function element(tag, attributes = {}, ...children) {
  const node = document.createElement(tag);
  for (const [name, told] of Object.entries(attributes)) node.setAttribute(name, told);
  node.append(...children);
  return node;
}
