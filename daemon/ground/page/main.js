// The page: reads the present state, then follows the server-sent events. One rover is shown at a time.
import { announcement, showAlarms } from "./alarms.js";
import { el, setText } from "./dom.js";
import { clock, duration, moment } from "./format.js";
import { Series } from "./history.js";
import { showComparison, showDownloads, showLog, showNodes } from "./lists.js";
import { Plots } from "./plots.js";
import { Track } from "./track.js";
import { showWheels } from "./wheels.js";

const LEVELS = ["low_90", "low_50", "median", "high_50", "high_90"];
const names = (quantities, parts) => quantities.flatMap((quantity) => parts.map((part) => `${quantity}_${part}`));
const series = {
  snapshot: new Series(names(["load_N", "slip", "smoothed_torque_Nm", "motor_current_A"], [1, 2, 3, 4, 5, 6]), 1000),
  posterior: new Series(names(["cohesion_Pa", "friction_angle_rad", "drawbar_margin"], LEVELS)),
  odometry: new Series(["x_m", "y_m", "heading_rad", "distance_m", "speed_m_s"]),
};
const SILENT_MS = 10_000;
const REREAD_MS = 60_000;
const REDRAW_MS = 200;
const byId = (id) => document.getElementById(id);

const rovers = {}; // name → {latest, alarms, received_ms, data_ms}
let selected = null;
let wanted = decodeURIComponent(location.hash.slice(1)); // the rover in the address; it may publish only later
let span_s = 240;
let end_s = null; // end of the range that is shown; null: now
let offset_ms = 0; // the server's clock minus this computer's
let brokerProblem = "";
let connected = true; // to the server
let user = null;
let lastRead = 0;
let reading = 0; // requests of the present state under way
let meanwhile = []; // updates that came during one: they may be newer than its answer
let asked = 0; // requests of a history so far
let dirty = false;

const plots = new Plots(series.posterior, series.snapshot, (from, to) => {
  end_s = to;
  setSpan(Math.max(10, to - from));
});
const track = new Track();

const now_ms = () => Date.now() + offset_ms;
const range = () => {
  const to = end_s ?? now_ms() / 1000;
  return [to - span_s, to];
};

async function read(path) {
  const answer = await fetch(path);
  if (answer.status === 401) location.replace("/login");
  if (!answer.ok) throw new Error(`${path}: ${answer.status}`);
  return answer.json();
}

async function act(name, action) {
  const who = byId("who").value;
  const rover = selected;
  const answer = await fetch(`/api/alarms/${encodeURIComponent(rover)}/${encodeURIComponent(name)}`, {
    method: "POST", body: JSON.stringify({ ...action, who }),
  });
  const content = await answer.json();
  if (answer.ok) rovers[rover].alarms = content;
  showProblem(answer.ok ? "" : content.error);
  if (!answer.ok && !user && !who) byId("who").focus();
  show();
}

let refusal = "";
function showProblem(text) {
  refusal = text;
  const problem = refusal || (connected ? brokerProblem : "No connection to the ground's server. The page shows what it last received.");
  byId("problem").hidden = !problem;
  setText(byId("problem"), problem);
}

function presence(rover) {
  const state = rover.latest.state;
  const age = rover.data_ms ? now_ms() - rover.data_ms : null;
  const old = age === null ? "no data yet" : age < -2000 ? `its clock is ${duration(-age)} ahead` : `data ${duration(Math.max(0, age))} old`;
  if (!state) return ["unknown", `unknown · ${old}`];
  if (!connected || brokerProblem) return ["unknown", `unknown: no connection · last known: ${state.state} · ${old}`];
  if (state.state === "offline") return ["offline", `offline since ${clock(state.reason === "connection-lost" ? rover.received_ms ?? state.time : state.time)} (${state.reason}) · ${old}`];
  if (rover.received_ms && now_ms() - rover.received_ms > SILENT_MS) return ["silent", `online, but silent · ${old}`];
  return ["online", `online · ${old}`];
}

function showRovers() {
  const place = byId("rovers");
  for (const name of Object.keys(rovers).sort()) {
    let button = place.querySelector(`[data-rover="${name}"]`);
    if (!button) {
      button = el("button", { type: "button", "data-rover": name, onclick: () => choose(name) }, el("i", { "aria-hidden": "true" }), el("b", {}, name), " ", el("span", {}));
      place.append(button);
    }
    const [kind, text] = presence(rovers[name]);
    const alarms = rovers[name].alarms.filter((alarm) => alarm.state.includes("unacknowledged")).length;
    button.setAttribute("aria-pressed", name === selected);
    button.className = kind;
    setText(button.querySelector("span"), alarms ? `${kind} · ${alarms} to acknowledge` : kind);
    if (name === selected) {
      setText(byId("presence"), `${name}: ${text}`);
      byId("rover").className = kind;
    }
  }
  byId("nothing").hidden = selected !== null;
  byId("rover").hidden = selected === null;
}

function showPlots() {
  const [from, to] = range();
  plots.show(from, to);
  track.show(series.odometry, series.posterior);
  setText(byId("shown"), `${moment(from * 1000)} to ${end_s === null ? "now" : clock(to * 1000)}`);
}

function show() {
  showProblem(refusal);
  showRovers();
  if (selected === null) return;
  const rover = rovers[selected];
  showAlarms(rover.alarms, act);
  showWheels(rover.latest.snapshot);
  showNodes(rover.latest);
  showComparison(selected, rover.latest.mismatch);
}

async function readHistory() {
  if (selected === null) return;
  lastRead = Date.now();
  const [from, to] = range().map((time) => Math.round(time * 1000));
  const question = ++asked;
  const columns = await read(`/api/history/${encodeURIComponent(selected)}?from=${from}&to=${to}`);
  if (question !== asked) return; // another rover or range was chosen meanwhile
  for (const name of Object.keys(series)) series[name].load(columns[name]);
  showDownloads(selected, from, to);
  showPlots();
}

async function readLog() {
  const rover = selected;
  if (rover === null) return;
  const log = await read(`/api/log/${encodeURIComponent(rover)}`);
  if (rover === selected) showLog(log); // another rover may have been chosen meanwhile
}

let due = {};
function soon(name, job, wait) {
  due[name] ??= setTimeout(() => {
    delete due[name];
    job().catch(() => {}); // the next update tries again
  }, wait);
}

function select(name) {
  selected = name;
  refusal = "";
  for (const each of Object.values(series)) each.clear();
  show();
  readHistory().catch(() => {});
  readLog().catch(() => {});
}

function choose(name) {
  wanted = name;
  location.hash = name;
  select(name);
}

function setSpan(seconds) {
  span_s = seconds;
  byId("span").value = [...byId("span").options].some((option) => Number(option.value) === seconds) ? String(seconds) : "";
  readHistory().catch(() => {});
}

async function readState() {
  reading++;
  const state = await read("/api/state").finally(() => reading--);
  offset_ms = state.now_ms - Date.now();
  brokerProblem = state.broker;
  user = state.user;
  byId("logout").hidden = !user;
  byId("who").parentElement.hidden = Boolean(user);
  setText(byId("user"), user ?? "");
  Object.assign(rovers, state.rovers);
  meanwhile.forEach(take);
  if (!reading) meanwhile = [];
  const first = rovers[wanted] ? wanted : selected ?? Object.keys(rovers).sort()[0];
  if (first && first !== selected) return select(first);
  if (selected !== null) await Promise.all([readHistory(), readLog()]);
  show();
}

function take(update) {
  offset_ms = update.now_ms - Date.now();
  if (update.broker !== undefined) brokerProblem = update.broker;
  for (const [name, changed] of Object.entries(update.rovers)) {
    const rover = (rovers[name] ??= { latest: {}, alarms: [], received_ms: null, data_ms: null });
    Object.assign(rover.latest, changed.latest);
    rover.received_ms = changed.received_ms;
    rover.data_ms = changed.data_ms;
    if (changed.alarms) {
      const text = announcement(rover.alarms, changed.alarms);
      if (text) setText(byId("announcement"), `${name}: ${text}`);
      rover.alarms = changed.alarms;
    }
    if (selected === null || (name === wanted && selected !== name)) select(name);
    else if (name === selected) takeSelected(changed);
  }
  show();
}

function takeSelected(changed) {
  if (changed.log || changed.alarms) soon("log", readLog, 300);
  if (changed.backfilled) soon("history", readHistory, 1000);
  if (end_s !== null) return;
  const from = now_ms() / 1000 - span_s;
  for (const [name, rows] of Object.entries(changed.points)) {
    series[name].append(rows);
    series[name].trim(from);
    dirty = true;
  }
}

function follow() {
  const events = new EventSource("/api/updates");
  events.onopen = () => {
    connected = true;
    readState().catch(() => {});
  };
  events.onmessage = (event) => {
    const update = JSON.parse(event.data);
    if (reading) meanwhile.push(update);
    take(update);
  };
  events.addEventListener("reload", () => readState().catch(() => {}));
  events.onerror = () => {
    connected = false;
    show();
  };
}

function setTheme(theme) {
  document.documentElement.dataset.theme = theme;
  localStorage.setItem("theme", theme);
  setText(byId("theme"), theme === "dark" ? "Light" : "Dark");
  plots.restyle();
  showPlots();
}

byId("span").addEventListener("change", (event) => setSpan(Number(event.target.value)));
for (const button of document.querySelectorAll("[data-move]")) {
  button.addEventListener("click", () => {
    const way = Number(button.dataset.move);
    const to = (end_s ?? now_ms() / 1000) + way * span_s;
    end_s = way === 0 || to >= now_ms() / 1000 ? null : to;
    readHistory().catch(() => {});
  });
}
byId("who").value = localStorage.getItem("who") ?? "";
byId("who").addEventListener("change", (event) => localStorage.setItem("who", event.target.value));
byId("logout").addEventListener("click", async () => {
  await fetch("/logout", { method: "POST" });
  location.replace("/login");
});
byId("theme").addEventListener("click", () => setTheme(document.documentElement.dataset.theme === "dark" ? "light" : "dark"));
setTheme(localStorage.getItem("theme") ?? (matchMedia("(prefers-color-scheme: dark)").matches ? "dark" : "light"));

setInterval(() => {
  showRovers();
  if (end_s === null && span_s > 240 && Date.now() - lastRead > REREAD_MS) readHistory().catch(() => {});
}, 1000);
// Redraws when something came, and takes at most a fifth of the computer's time for it.
function redraw() {
  const begun = performance.now();
  if (dirty && !document.hidden) {
    dirty = false;
    showPlots();
  }
  setTimeout(redraw, Math.max(REDRAW_MS, 5 * (performance.now() - begun)));
}
redraw();
follow();
