// Numbers and times as people read them. A missing value is an en dash.
export const DEGREES = 180 / Math.PI;
export const WHEELS = [1, 2, 3, 4, 5, 6];
export const PLACES = ["front left", "front right", "middle left", "middle right", "rear left", "rear right"];

export function number(value, digits, factor = 1) {
  return value === null || value === undefined ? "–" : (value * factor).toFixed(digits).replace("-", "−");
}

export function clock(time) {
  return new Date(time).toISOString().slice(11, 19);
}

export function moment(time) {
  return `${new Date(time).toISOString().slice(0, 19).replace("T", " ")} UTC`;
}

export function duration(ms) {
  const seconds = ms / 1000;
  if (seconds < 10) return `${seconds.toFixed(1)} s`;
  if (seconds < 120) return `${Math.round(seconds)} s`;
  if (seconds < 7200) return `${Math.round(seconds / 60)} min`;
  return seconds < 172800 ? `${(seconds / 3600).toFixed(1)} h` : `${Math.round(seconds / 86400)} days`;
}

export function percent(value) {
  return value === null || value === undefined ? "–" : `${Math.round(100 * value)} %`;
}

// Keeps a number and its unit on one line.
export function unbroken(text) {
  return text.replace(/(\d) (?=(%|s|m|N|kPa|°|rad)(?![a-z]))/g, "$1\u00a0");
}
