// How long things are: a bar below a map.
export function scaleBar(context, width, height, scale, unit, colours) {
  const most = Math.min(120, width / 3) / scale;
  const power = 10 ** Math.floor(Math.log10(most));
  const size = [5, 2, 1].map((nice) => nice * power).find((each) => each <= most);
  const [x, y, long] = [12, height - 12, size * scale];
  context.beginPath();
  context.moveTo(x, y - 5);
  context.lineTo(x, y);
  context.lineTo(x + long, y);
  context.lineTo(x + long, y - 5);
  for (const [colour, thick] of [["rgba(255,255,255,0.9)", 5], ["#111111", 2]]) {
    context.strokeStyle = colour;
    context.lineWidth = thick;
    context.stroke();
  }
  context.font = colours.font;
  context.textAlign = "left";
  context.textBaseline = "alphabetic";
  context.lineWidth = 4;
  context.strokeStyle = "rgba(255,255,255,0.9)";
  const text = unit !== "m" ? `${size} units` : size < 1000 ? `${size} m` : `${size / 1000} km`;
  context.strokeText(text, x + 4, y - 7);
  context.fillStyle = "#111111";
  context.fillText(text, x + 4, y - 7);
}
