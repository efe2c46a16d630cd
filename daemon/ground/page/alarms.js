// Alarms with the states and words of ISA-18.2, and what an operator can do with each.
import { content, el, replace } from "./dom.js";
import { clock, moment, number, percent, unbroken } from "./format.js";

const WORDS = {
  "unacknowledged": "active, unacknowledged",
  "acknowledged": "active, acknowledged",
  "returned-unacknowledged": "cleared, unacknowledged",
  "latched-unacknowledged": "latched, unacknowledged",
  "latched-acknowledged": "latched, acknowledged",
  "shelved": "shelved",
};
const SYMBOLS = { critical: "◆", error: "▲", warning: "●" };
const SHELVING = [[15, "15 min"], [60, "1 h"], [480, "8 h"]];
const ACKNOWLEDGEABLE = new Set(["unacknowledged", "returned-unacknowledged", "latched-unacknowledged"]);

function evidence(found) {
  if (!found) return null;
  const rows = [
    ["onset", clock(found.onset)],
    ["wheels", found.wheels.join(", ")],
    ["torque, of what is expected", percent(found.torque_ratio)],
    ["statistic, threshold", `${number(found.statistic, 1)}, ${number(found.threshold, 1)}`],
    ["probability that c fell", percent(found.cohesion_fell)],
    ["that φ fell", percent(found.friction_angle_fell)],
    ["that the drawbar margin fell", percent(found.drawbar_margin_fell)],
  ];
  return el("dl", { class: "evidence" },
    ...rows.map(([name, value]) => el("div", {}, el("dt", {}, name), el("dd", {}, value))));
}

function history(alarm) {
  const parts = [];
  if (alarm.raised) parts.push(`raised ${moment(alarm.raised)}`);
  if (alarm.cleared) parts.push(`cleared ${moment(alarm.cleared)}`);
  if (alarm.acknowledged) parts.push(`acknowledged ${moment(alarm.acknowledged)} by ${alarm.acknowledged_by}`);
  if (alarm.shelved_until) parts.push(`shelved until ${moment(alarm.shelved_until)} by ${alarm.shelved_by}`);
  return parts.join(" · ");
}

function buttons(alarm, act) {
  const button = (label, action, focus) =>
    el("button", {
      type: "button", "data-focus": `${alarm.name}-${focus}`, "aria-label": `${label}: ${alarm.name}`,
      onclick: () => act(alarm.name, action),
    }, label);
  const made = [];
  if (alarm.state === "shelved") return [button("Unshelve", { action: "unshelved" }, "unshelve")];
  if (ACKNOWLEDGEABLE.has(alarm.state)) made.push(button("Acknowledge", { action: "acknowledged" }, "acknowledge"));
  if (alarm.state === "latched-acknowledged") made.push(button("Reset", { action: "reset" }, "reset"));
  // A button of its own: arrow keys move through the times without doing anything.
  const choice = el("select", { "aria-label": `Shelve ${alarm.name} for`, "data-focus": `${alarm.name}-minutes` },
    ...SHELVING.map(([minutes, label]) => el("option", { value: minutes }, label)));
  const shelve = el("button", {
    type: "button", "data-focus": `${alarm.name}-shelve`, "aria-label": `Shelve: ${alarm.name}`,
    onclick: () => act(alarm.name, { action: "shelved", minutes: Number(choice.value) }),
  }, "Shelve for");
  return [...made, el("span", { class: "shelve" }, shelve, choice)];
}

function article(alarm, act) {
  return el("article", { class: `alarm ${alarm.severity} ${alarm.state}`, "data-alarm": alarm.name },
    el("h3", {}, el("span", { class: "symbol", "aria-hidden": "true" }, SYMBOLS[alarm.severity]),
      ` ${alarm.name} `, el("span", { class: "severity" }, alarm.severity), " ",
      el("span", { class: "state" }, WORDS[alarm.state])),
    el("p", {}, unbroken(alarm.text)),
    el("p", { class: "remedy" }, alarm.remedy ? `${alarm.remedy} ` : "",
      el("a", { href: `/alarms/${alarm.name}`, target: "_blank", "aria-label": `About the alarm ${alarm.name}` },
        "What it means, and what to do")),
    el("p", { class: "actions" }, ...buttons(alarm, act)),
    evidence(alarm.evidence),
    el("p", { class: "history" }, history(alarm)));
}

export function showAlarms(alarms, act) {
  replace(content("alarms"), JSON.stringify(alarms), () =>
    alarms.length ? alarms.map((alarm) => article(alarm, act)) : [el("p", { class: "none" }, "No alarm.")]);
}

// The text that a screen reader speaks: alarms that are unacknowledged and active now and were not before.
export function announcement(before, now) {
  const known = new Set(before.filter((alarm) => alarm.state === "unacknowledged").map((alarm) => alarm.name));
  const fresh = now.filter((alarm) => alarm.state === "unacknowledged" && !known.has(alarm.name));
  return fresh.map((alarm) => `Alarm ${alarm.name}, ${alarm.severity}: ${alarm.text}`).join(". ");
}
