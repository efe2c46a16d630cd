// Plots against time: intervals of the soil, and four quantities of six wheels. uPlot draws.
import { content, el } from "./dom.js";
import { DEGREES, number, PLACES, WHEELS } from "./format.js";

const LEVELS = ["low_90", "high_90", "low_50", "high_50", "median"]; // in the order of drawing: the median on top
const SOIL = [
  ["cohesion_Pa", "Cohesion c", "kPa", 1e-3, 2],
  ["friction_angle_rad", "Friction angle φ", "°", DEGREES, 1],
  ["drawbar_margin", "Drawbar margin", "", 1, 3],
];
const WHEEL = [
  ["load_N", "Load", "N", 1, 1],
  ["slip", "Slip", "%", 100, 1],
  ["smoothed_torque_Nm", "Torque", "N·m", 1, 2],
  ["motor_current_A", "Motor current", "mA", 1000, 0],
];
const HEIGHT = 190;
const DASHES = [[], [6, 3]]; // left wheels solid, right wheels dashed
const SYNC = "time";

function style(name) {
  return getComputedStyle(document.documentElement).getPropertyValue(name).trim();
}

// A hatching that is seen without colours as well.
function hatching(context) {
  const tile = document.createElement("canvas");
  tile.width = tile.height = 8;
  const pen = tile.getContext("2d");
  pen.strokeStyle = style("--hatch");
  pen.lineWidth = 1.5;
  pen.beginPath();
  pen.moveTo(-2, 10);
  pen.lineTo(10, -2);
  pen.stroke();
  return context.createPattern(tile, "repeat");
}

function drawBackfilled(plot, spans) {
  const { ctx, bbox } = plot;
  ctx.save();
  ctx.beginPath();
  ctx.rect(bbox.left, bbox.top, bbox.width, bbox.height);
  ctx.clip();
  ctx.fillStyle = hatching(ctx);
  for (const [from, to] of spans) {
    const left = plot.valToPos(from, "x", true);
    const width = Math.max(3, plot.valToPos(to, "x", true) - left);
    ctx.fillRect(left, bbox.top, width, bbox.height);
  }
  ctx.restore();
}

function axes(unit) {
  const line = { stroke: style("--text"), font: "12px system-ui", grid: { stroke: style("--grid") }, ticks: { stroke: style("--grid") } };
  const times = (_, ticks, __, ___, step) => ticks.map((tick, k) => timeLabel(tick, step, k === 0 || day(tick) !== day(ticks[k - 1])));
  const numbers = (_, ticks) => ticks.map((tick) => `${tick}`.replace("-", "−"));
  return [{ ...line, values: times, space: 70 }, { ...line, size: 58, space: 25, values: numbers, label: unit || " ", labelSize: 18, labelFont: "12px system-ui" }];
}

const day = (time) => Math.floor(time / 86400);

// UTC, with the date under the first tick of a day.
function timeLabel(time, step, dated) {
  const text = new Date(time * 1000).toISOString();
  const hours = step >= 86400 ? "" : text.slice(11, step < 60 ? 19 : 16);
  return dated ? `${hours}\n${text.slice(0, 10)}`.trim() : hours || text.slice(5, 10);
}

class Plot {
  constructor(place, title, unit, series, bands, spans, zoomed) {
    this.figure = el("figure", {}, el("figcaption", {}, title, " ", el("output", {})), el("div", { class: "canvas", role: "img", "aria-label": title }));
    place.append(this.figure);
    this.canvas = this.figure.querySelector(".canvas");
    this.unit = unit;
    this.title = title;
    this.options = () => ({
      width: this.canvas.clientWidth || 300, height: HEIGHT, legend: { show: false }, tzDate: (time) => uPlot.tzDate(new Date(time * 1e3), "Etc/UTC"),
      scales: { x: { time: true } }, axes: axes(unit), series: [{}, ...series()], bands: bands(),
      cursor: { sync: { key: SYNC }, drag: { x: true, y: false, setScale: false } },
      hooks: {
        drawAxes: [(plot) => drawBackfilled(plot, spans())],
        setSelect: [(plot) => plot.select.width > 5 && zoomed(plot.posToVal(plot.select.left, "x"), plot.posToVal(plot.select.left + plot.select.width, "x"))],
      },
    });
    this.build();
  }

  build() {
    const data = this.plot?.data ?? [[]];
    this.plot?.destroy();
    this.plot = new uPlot(this.options(), data.length > 1 ? data : [[], ...this.options().series.slice(1).map(() => [])], this.canvas);
  }

  show(data, from, to, text) {
    this.plot.batch(() => {
      this.plot.setData(data, false);
      this.plot.setScale("x", { min: from, max: to });
    });
    const output = this.figure.querySelector("output");
    if (output.textContent !== text) {
      output.textContent = text;
      this.canvas.setAttribute("aria-label", `${this.title} against time, ${text || "no data"}`);
    }
  }

  resize() {
    const width = this.canvas.clientWidth;
    if (width && width !== this.plot.width) this.plot.setSize({ width, height: HEIGHT });
  }
}

function scaled(column, factor) {
  return factor === 1 ? column : column.map((value) => (value === null ? null : value * factor));
}

function newest(column) {
  for (let k = column.length - 1; k >= 0; k--) if (column[k] !== null) return column[k];
  return null;
}

export class Plots {
  constructor(posterior, snapshot, zoomed) {
    this.posterior = posterior;
    this.snapshot = snapshot;
    const place = content("plots");
    place.append(
      el("p", { class: "legend" }, el("span", { class: "key median" }), "median ", el("span", { class: "key half" }), "50 % ",
        el("span", { class: "key most" }), "90 % interval ", el("span", { class: "key hatch" }), "back-filled after an outage"));
    const soil = el("div", { class: "figures three" });
    place.append(soil, this.#wheelLegend());
    const wheels = el("div", { class: "figures" });
    place.append(wheels);
    this.soil = SOIL.map(([, title, unit]) => new Plot(soil, title, unit, this.#intervals, this.#bands, () => posterior.backfilled(), zoomed));
    this.wheels = WHEEL.map(([, title, unit]) => new Plot(wheels, title, unit, this.#lines, () => [], () => snapshot.backfilled(), zoomed));
    new ResizeObserver(() => this.all.forEach((plot) => plot.resize())).observe(place);
  }

  get all() {
    return [...this.soil, ...this.wheels];
  }

  #intervals = () => LEVELS.map((level) => ({ stroke: level === "median" ? style("--median") : "transparent", width: level === "median" ? 2 : 0, points: { show: false } }));

  #bands = () => [{ series: [2, 1], fill: style("--most") }, { series: [4, 3], fill: style("--half") }];

  #lines = () => WHEELS.map((wheel) => ({ stroke: style(`--axle-${Math.ceil(wheel / 2)}`), width: 1.5, dash: DASHES[(wheel - 1) % 2], points: { show: false } }));

  #wheelLegend() {
    const key = (wheel) => {
      const line = el("span", { class: `line axle-${Math.ceil(wheel / 2)} ${wheel % 2 ? "" : "dashed"}` });
      return el("span", { class: "wheel-key" }, line, `${wheel} ${PLACES[wheel - 1]} `);
    };
    return el("p", { class: "legend" }, ...WHEELS.map(key));
  }

  show(from, to) {
    this.soil.forEach((plot, k) => {
      const [name, , unit, factor, digits] = SOIL[k];
      const columns = LEVELS.map((level) => scaled(this.posterior.values[`${name}_${level}`], factor));
      const [low, high, , , median] = columns.map(newest);
      const text = median === null ? "" : `${number(median, digits)} ${unit} (90 %: ${number(low, digits)} to ${number(high, digits)})`;
      plot.show([this.posterior.time, ...columns], from, to, text);
    });
    this.wheels.forEach((plot, k) => {
      const [name, , , factor] = WHEEL[k];
      plot.show([this.snapshot.time, ...WHEELS.map((wheel) => scaled(this.snapshot.values[`${name}_${wheel}`], factor))], from, to, "");
    });
  }

  // Colours have changed.
  restyle() {
    this.all.forEach((plot) => plot.build());
  }
}
