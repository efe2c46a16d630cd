// Six wheels where they are on the rover, front at the top, left wheels on the left.
import { content, el, setText } from "./dom.js";
import { number, PLACES, WHEELS } from "./format.js";

const ROWS = [
  ["load_N", "load", "N", 1, 1],
  ["slip", "slip", "%", 1, 100],
  ["smoothed_torque_Nm", "torque", "N·m", 2, 1],
  ["motor_current_A", "current", "mA", 0, 1000],
];

function make() {
  const cards = WHEELS.map((wheel) =>
    el("article", { class: "wheel", "data-wheel": wheel, "aria-label": `Wheel ${wheel}, ${PLACES[wheel - 1]}` },
      el("h3", {}, `${wheel} `, el("small", {}, PLACES[wheel - 1])),
      el("dl", {}, ...ROWS.map(([name, label, unit]) =>
        el("div", {}, el("dt", {}, label), el("dd", {}, el("b", { "data-value": name }, "–"), ` ${unit}`)))),
      el("p", { class: "note" }, "no data yet")));
  return [el("p", { class: "forward", "aria-hidden": "true" }, "▲ forward"), el("div", { class: "axles" }, ...cards)];
}

function note(snapshot, index) {
  if (!snapshot.measured[index]) return "not measured";
  if (snapshot.slip_source[index] === "none") return "standing still";
  return snapshot.slip_source[index] === "configured" ? "slip: configured constant" : "";
}

export function showWheels(snapshot) {
  const place = content("wheels");
  if (!place.children.length) place.append(...make());
  for (const wheel of WHEELS) {
    const card = place.querySelector(`[data-wheel="${wheel}"]`);
    for (const [name, , , digits, factor] of ROWS) {
      setText(card.querySelector(`[data-value="${name}"]`), number(snapshot?.[name]?.[wheel - 1], digits, factor));
    }
    const text = snapshot ? note(snapshot, wheel - 1) : "no data yet";
    setText(card.querySelector(".note"), text);
    card.classList.toggle("missing", text === "not measured");
  }
}
