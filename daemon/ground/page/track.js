// The dead-reckoned track, coloured by the drawbar margin. Forward at the start is up.
import { content, el } from "./dom.js";
import { number } from "./format.js";

const COLOURS = ["#440154", "#3b528b", "#21918c", "#5ec962", "#fde725"]; // viridis: lightness alone tells the order
const PAD = 28;
const USUAL_MARGIN = 0.5; // upper end of the colour scale, unless a margin is larger: colours of two days are comparable

function colour(share) {
  return COLOURS[Math.max(0, Math.min(COLOURS.length - 1, Math.floor(share * COLOURS.length)))];
}

// Margin of each point of the track: that of the newest posterior not later than it.
function margins(track, posterior) {
  const medians = posterior.values.drawbar_margin_median;
  let k = -1;
  return track.time.map((time) => {
    while (k + 1 < posterior.time.length && posterior.time[k + 1] <= time + 0.3) k++;
    return k >= 0 && time - posterior.time[k] < Math.max(30, 2 * posterior.spacing_s) ? medians[k] : null;
  });
}

export class Track {
  constructor() {
    this.canvas = el("canvas", { role: "img" });
    this.caption = el("p", { class: "legend" });
    this.scale = el("div", { class: "scale", "aria-hidden": "true" }, el("span", {}), ...COLOURS.map((each) => {
      const box = el("i", {});
      box.style.background = each;
      return box;
    }), el("span", {}));
    content("track").append(this.canvas, this.scale, this.caption);
  }

  show(track, posterior) {
    const session = track.session.at(-1);
    const points = track.time.map((_, k) => k).filter((k) => track.session[k] === session && track.values.x_m[k] !== null);
    const context = this.#clear();
    if (!points.length) return this.#tell("No movement in this range.");
    const margin = margins(track, posterior);
    const known = points.map((k) => margin[k]).filter((value) => value !== null);
    const low = Math.min(...known, 0);
    const high = Math.max(...known, USUAL_MARGIN);
    const [first, last] = this.scale.querySelectorAll("span");
    first.textContent = `margin ${number(low, 2)}`;
    last.textContent = number(high, 2);
    this.#draw(context, points, track.values, margin, low, high);
    const end = points.at(-1);
    const { x_m, y_m, distance_m } = track.values;
    this.#tell(`${number(distance_m[end], 2)} m driven; ${number(x_m[end], 2)} m ahead and ${number(Math.abs(y_m[end]), 2)} m ` +
      `${y_m[end] < 0 ? "right" : "left"} of the start of this session. The error grows with the distance.`);
  }

  #tell(text) {
    if (this.caption.textContent === text) return;
    this.caption.textContent = text;
    this.canvas.setAttribute("aria-label", `Track by dead reckoning. ${text}`);
  }

  #clear() {
    const ratio = devicePixelRatio || 1;
    const width = this.canvas.parentElement.clientWidth;
    this.canvas.style.height = "260px";
    this.canvas.width = width * ratio;
    this.canvas.height = 260 * ratio;
    const context = this.canvas.getContext("2d");
    context.setTransform(ratio, 0, 0, ratio, 0, 0);
    return context;
  }

  #draw(context, points, values, margin, low, high) {
    const width = this.canvas.parentElement.clientWidth;
    const x = points.map((k) => -values.y_m[k]); // left is positive in ISO 8855
    const y = points.map((k) => values.x_m[k]);
    const range = (numbers) => [Math.min(...numbers, 0), Math.max(...numbers, 0)];
    const [[left, right], [bottom, top]] = [range(x), range(y)];
    const scale = Math.min((width - 2 * PAD) / Math.max(right - left, 0.5), (260 - 2 * PAD) / Math.max(top - bottom, 0.5));
    const at = (k) => [width / 2 + (x[k] - (left + right) / 2) * scale, 130 - (y[k] - (bottom + top) / 2) * scale];
    this.#grid(context, width, scale, left, right, bottom, top);
    context.lineWidth = 5;
    context.lineCap = "round";
    for (let k = 1; k < points.length; k++) {
      const value = margin[points[k]];
      context.strokeStyle = value === null ? "#888" : colour((value - low) / (high - low));
      context.beginPath();
      context.moveTo(...at(k - 1));
      context.lineTo(...at(k));
      context.stroke();
    }
    const text = getComputedStyle(document.documentElement).getPropertyValue("--text");
    const [endX, endY] = at(points.length - 1);
    context.translate(endX, endY);
    context.rotate(-values.heading_rad[points.at(-1)]);
    context.fillStyle = text;
    context.beginPath();
    context.moveTo(0, -11);
    context.lineTo(7, 8);
    context.lineTo(-7, 8);
    context.fill();
  }

  #grid(context, width, scale, left, right, bottom, top) {
    const style = getComputedStyle(document.documentElement);
    const step = [0.1, 0.25, 0.5, 1, 2, 5, 10, 25, 50, 100, 250, 500].find((each) => each * scale >= 45) ?? 1000;
    context.strokeStyle = style.getPropertyValue("--grid");
    context.fillStyle = style.getPropertyValue("--text");
    context.font = "11px system-ui";
    const row = (y) => 130 - (y - (bottom + top) / 2) * scale;
    for (let y = Math.ceil((bottom - PAD / scale) / step) * step; row(y) > 4; y += step) {
      context.beginPath();
      context.moveTo(0, row(y));
      context.lineTo(width, row(y));
      context.stroke();
      context.fillText(`${Number(y.toFixed(2))} m`, 3, row(y) - 3);
    }
    const column = (x) => width / 2 + (x - (left + right) / 2) * scale;
    const first = Math.ceil(((left + right) / 2 - width / 2 / scale) / step) * step;
    for (let x = first; column(x) < width; x += step) {
      context.beginPath();
      context.moveTo(column(x), 0);
      context.lineTo(column(x), 260);
      context.stroke();
    }
  }
}
