// Nodes, events, the last comparison with the simulation, and downloads.
import { content, el, replace } from "./dom.js";
import { moment, PLACES, unbroken } from "./format.js";

const KINDS = ["snapshot", "posterior", "odometry", "alarm", "event", "emcy", "node"];

// The broker retains the message of a node that is configured no longer: it is of an earlier session than the state.
export function nodesOf(latest) {
  const nodes = Object.entries(latest).filter(([topic]) => topic.startsWith("node/")).map(([, node]) => node);
  return nodes.filter((node) => !(node.session < latest.state?.session)).sort((a, b) => a.node_id - b.node_id);
}

export function showNodes(latest) {
  const nodes = nodesOf(latest);
  replace(content("nodes"), JSON.stringify(nodes.map((node) => [node.node_id, node.phase, node.drive_state, node.text])), () => {
    if (!nodes.length) return [el("p", { class: "none" }, "No node reported yet.")];
    const row = (node) => el("tr", { class: node.phase === "operational" ? "" : "bad" },
      el("th", { scope: "row" }, String(node.node_id)), el("td", {}, node.kind),
      el("td", {}, node.wheel ? `${node.wheel} ${PLACES[node.wheel - 1]}` : "body"),
      el("td", {}, node.phase), el("td", {}, node.drive_state ?? ""), el("td", {}, node.phase === "operational" ? "" : node.text));
    const names = ["node", "kind", "wheel", "phase", "drive", "fault"];
    return [el("div", { class: "scroll", tabindex: "0", role: "region", "aria-label": "Table of nodes" },
      el("table", {}, el("thead", {}, el("tr", {}, ...names.map((name) => el("th", { scope: "col" }, name)))),
        el("tbody", {}, ...nodes.map(row))))];
  });
}

export function showLog(lines) {
  replace(content("log"), JSON.stringify(lines.slice(0, 3)) + lines.length, () => {
    if (!lines.length) return [el("p", { class: "none" }, "No event yet.")];
    return [el("ol", { reversed: true }, ...lines.map((line) =>
      el("li", {}, el("time", { datetime: new Date(line.time_ms).toISOString() }, moment(line.time_ms).slice(5, 19)), " ",
        el("b", {}, line.kind), ` ${unbroken(line.text)}`, line.who ? el("em", {}, ` ${line.who}`) : null,
        line.late ? el("small", {}, " back-filled") : null)))];
  });
}

function figures(value) {
  return Number(value.toPrecision(3)).toString().replace("-", "−");
}

function effectRow(effect) {
  const interval = `${figures(effect.low)} to ${figures(effect.high)}`;
  return el("tr", {}, el("th", { scope: "row" }, effect.name), el("td", {}, effect.where || effect.statement),
    el("td", {}, `${figures(effect.size)} ${effect.unit}`), el("td", {}, interval));
}

export function showComparison(rover, message) {
  replace(content("comparison"), JSON.stringify([rover, message ?? null]), () => {
    if (!message) return [el("p", { class: "none" }, "None yet: it is made after each traverse.")];
    const names = ["effect", "where, or what it was", "size", "90 % interval"];
    const found = [...message.effects, ...message.changes];
    return [
      el("p", { class: `verdict ${message.verdict}` }, el("b", {}, message.verdict), ` ${message.text}`),
      found.length ? el("div", { class: "scroll", tabindex: "0", role: "region", "aria-label": "Table of effects" },
        el("table", {}, el("thead", {}, el("tr", {}, ...names.map((name) => el("th", { scope: "col" }, name)))),
          el("tbody", {}, ...found.map(effectRow)))) : null,
      el("p", { class: "history" }, `${message.recording} · ${moment(message.time)} · `,
        el("a", { href: `/report/${encodeURIComponent(rover)}`, target: "_blank" }, "report"), " · on the rover: ", el("span", { title: message.report }, message.report.split("/").at(-1))),
    ].filter(Boolean);
  });
}

export function showDownloads(rover, from, to) {
  const link = (kind, format) => el("a", { href: `/download/${encodeURIComponent(rover)}/${kind}.${format}?from=${from}&to=${to}`, download: true,
    "aria-label": `${kind} as ${format}` }, format === "csv" ? "CSV" : "Parquet");
  replace(content("downloads"), `${rover} ${from} ${to}`, () => [
    el("ul", {}, ...KINDS.map((kind) => el("li", {}, `${kind}: `, link(kind, "csv"), " ", link(kind, "parquet"))))]);
}
