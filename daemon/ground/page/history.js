// The numbers behind the plots: columns read from the server, with live values appended.
const LONGEST_PAUSE_MS = 3000;

export class Series {
  // `mean_ms`: single messages are averaged over this time, so that six noisy lines can be told apart.
  constructor(names, mean_ms = 0) {
    this.names = names;
    this.mean_ms = mean_ms;
    this.clear();
  }

  clear() {
    this.time = []; // s, as uPlot wants them
    this.late = [];
    this.session = [];
    this.values = Object.fromEntries(this.names.map((name) => [name, []]));
    this.spacing_s = 0;
    this.waiting = []; // rows of the mean that is not complete yet
  }

  // Takes what /api/history returned. A pause becomes a point without values, which breaks the line.
  load(columns) {
    this.clear();
    this.spacing_s = columns.spacing_s;
    for (let k = 0; k < columns.time_ms.length; k++) {
      const values = this.names.map((name) => columns.values[name][k]);
      this.#add({ time_ms: columns.time_ms[k], late: columns.late[k], session: columns.session[k], values });
    }
  }

  // Appends live points: rows of time [ms] and the values in the order of `names`.
  append(rows) {
    const session = this.session.at(-1) ?? 0;
    for (const row of rows) {
      if (this.time.length && row[0] / 1000 <= this.time.at(-1)) continue;
      this.#add({ time_ms: row[0], late: 0, session, values: row.slice(1) });
    }
  }

  #add(row) {
    if (this.spacing_s || !this.mean_ms) return this.#push(row);
    const first = this.waiting[0];
    if (first && (row.time_ms - first.time_ms >= this.mean_ms || row.session !== first.session)) {
      this.#push(mean(this.waiting));
      this.waiting = [];
    }
    this.waiting.push(row);
  }

  // Removes points before a time [s].
  trim(from) {
    let count = 0;
    while (count < this.time.length && this.time[count] < from) count++;
    if (count < 200) return; // not for each point
    for (const column of [this.time, this.late, this.session, ...Object.values(this.values)]) column.splice(0, count);
  }

  #push(row) {
    const last = this.time.at(-1);
    if (last !== undefined) {
      const pause = row.time_ms - 1000 * last;
      const longest = Math.max(LONGEST_PAUSE_MS, 2500 * this.spacing_s);
      if (pause > longest || row.session !== this.session.at(-1)) this.#store({ ...row, time_ms: row.time_ms - pause / 2, late: 0, values: null });
    }
    this.#store(row);
  }

  #store({ time_ms, late, session, values }) {
    this.time.push(time_ms / 1000);
    this.late.push(late);
    this.session.push(session);
    this.names.forEach((name, k) => this.values[name].push(values ? values[k] : null));
  }

  // Spans of time [s] in which values were back-filled.
  backfilled() {
    const spans = [];
    const half = Math.max(this.spacing_s, 0.5) / 2;
    this.time.forEach((time, k) => {
      if (!this.late[k]) return;
      const last = spans.at(-1);
      if (last && time - last[1] <= 4 * half + 1) last[1] = time + half;
      else spans.push([time - half, time + half]);
    });
    return spans;
  }
}

function mean(rows) {
  const average = (numbers) => (numbers.length ? numbers.reduce((sum, value) => sum + value, 0) / numbers.length : null);
  const values = rows[0].values.map((_, k) => average(rows.map((row) => row.values[k]).filter((value) => value !== null)));
  return { ...rows[0], time_ms: average(rows.map((row) => row.time_ms)), late: Math.max(...rows.map((row) => row.late)), values };
}
