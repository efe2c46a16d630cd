"""Time and memory of a comparison against the rows of the recording, the candidates, and the workers.

    python -m regolithd.calibration.validation.blind_trials.figures.cost_scaling FIGURES.json PICTURE.svg [ROWS]

Each point is one run of the command line in a separate process, reading and writing included, on a generated recording
with one concealed effect. ROWS is the length of the longest recording, a million by default; with fewer than
`LONGEST_AT_ONCE` none is compared stretch by stretch, and workers are not measured.
"""

from __future__ import annotations

import json
import os
import subprocess
import sys
import tempfile
import time
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass
from multiprocessing import get_context
from pathlib import Path

import regolithd
from regolithd.calibration.mismatch.candidates.library import library
from regolithd.calibration.mismatch.data.stretches import LONGEST_AT_ONCE
from regolithd.calibration.mismatch.report.axes import Panel, axes, box, line, svg, text
from regolithd.calibration.validation.blind_trials.errors import ProofError
from regolithd.calibration.validation.blind_trials.figures.limited_libraries import LIMITED
from regolithd.calibration.validation.blind_trials.recordings.files import (
    COLUMNS,
    recording_columns,
    toml_text,
    write_trial,
)
from regolithd.calibration.validation.blind_trials.recordings.generator import Plan, make_trial

DURATIONS_S = (300.0, 600.0, 1200.0, 1800.0, 3600.0)
ALL = len(library())
"""Candidates of the whole library."""
FULL = 1800.0
ROWS_PER_S = 30.0
"""Rows of a generated recording in a second: six wheels at 5 Hz."""
MOST_ROWS = 1_000_000
GOAL_CPU_S, GOAL_MIB, GOAL_LONG_S = 5.0, 400.0, 60.0
GOALS = {
    GOAL_CPU_S: "goal at 54 000 rows: 5 s",
    GOAL_MIB: "goal at 54 000 rows: 400 MiB",
    GOAL_LONG_S: "goal at a million rows: 60 s",
}
"""Processor time is drawn because it depends less on other processes than the time that passes."""
STYLE = """<style>text{font:12px sans-serif;fill:#5c6570}.ground{fill:#f5f6f8}.axis{stroke:#d9dde2;fill:none}
.after{fill:none;stroke:#23679b;stroke-width:1.6}.dot{fill:#23679b}.zero{stroke:#b5482a;stroke-dasharray:3 3;fill:none}
.paper{fill:#fff}</style><rect class="paper" width="1130" height="220"/>"""


@dataclass(frozen=True)
class Cost:
    """Cost of one comparison: wall time, processor time of all processes, peak memory of the largest of them."""

    rows: int
    candidates: int
    workers: int
    wall_s: float
    cpu_s: float
    memory_MiB: float


def measure(folder: Path, recording: str, rows: int, candidates: int, workers: int = 1) -> Cost:
    """Run one comparison in the folder, on so many cores, and return its cost."""
    cores = os.sched_getaffinity(0)
    os.sched_setaffinity(0, sorted(cores)[:workers])  # a new process inherits it
    try:
        return _measured(folder, recording, rows, candidates, workers)
    finally:
        os.sched_setaffinity(0, cores)


def _measured(folder: Path, recording: str, rows: int, candidates: int, workers: int) -> Cost:
    command = [sys.executable, "-m", "regolithd", "mismatch", recording, "--simulation", "SIM.toml"]
    environment = {**os.environ, "PYTHONPATH": str(Path(regolithd.__file__).parent.parent)}
    started = time.perf_counter()
    child = subprocess.Popen(  # noqa: S603  # a command of this package; `os.wait4` below returns its resource usage
        [*command, "--json", "answer.json"], cwd=folder, env=environment, stdout=subprocess.DEVNULL
    )
    _, status, usage = os.wait4(child.pid, 0)
    child.returncode = os.waitstatus_to_exitcode(status)
    if child.returncode != 0:
        raise ProofError(f"the comparison of {rows} rows failed with status {child.returncode}")
    wall = time.perf_counter() - started
    return Cost(rows, candidates, workers, wall, usage.ru_utime + usage.ru_stime, usage.ru_maxrss / 1024)


def costs(scratch: Path, most_rows: int = MOST_ROWS) -> list[Cost]:
    """Return the costs: each length with all candidates, one of them with fewer, and the longest on fewer cores."""
    durations = [duration for duration in DURATIONS_S if duration * ROWS_PER_S <= most_rows]
    found = []
    for duration_s in durations:
        trial = make_trial(Plan(1, 3, "single", ("viscous-friction",)), duration_s=duration_s)
        write_trial(trial, scratch)
        for count, limited in LIMITED.items() if duration_s == FULL else ():
            model = f"{limited.__module__}:{limited.__name__}"
            tables = {**trial.tables, "simulation": {**trial.tables["simulation"], "model": model}}
            (scratch / "SIM.toml").write_text(toml_text(tables))
            found.append(measure(scratch, "recording.csv.gz", trial.load_N.size, count))
        (scratch / "SIM.toml").write_text(toml_text(trial.tables))
        found.append(measure(scratch, "recording.csv.gz", trial.load_N.size, ALL))
    return [*found, *_of_long_recordings(scratch, most_rows)]


def _of_long_recordings(scratch: Path, most_rows: int) -> list[Cost]:
    """Return the costs of recordings that are compared stretch by stretch; of the first on one core as well."""
    found: list[Cost] = []
    most = len(os.sched_getaffinity(0))
    for rows in sorted({min(MOST_ROWS, most_rows), most_rows} if most_rows > LONGEST_AT_ONCE else ()):
        written = written_apart(rows, scratch)
        on = [most] if found else range(1, most + 1)
        found += [measure(scratch, "recording.parquet", written, ALL, workers) for workers in on]
    return found


def written_apart(rows: int, folder: Path) -> int:
    """Write a recording and its SIM.toml in a process of its own, and return the number of rows.

    Before `execve` a new process is a copy of the one that starts it, whose memory counts in its peak (`getrusage`).
    """
    with ProcessPoolExecutor(1, get_context("spawn")) as other:
        return other.submit(write_long, rows, folder).result()


def write_long(rows: int, folder: Path) -> int:
    """Write a recording as Parquet, and its SIM.toml; return the number of rows."""
    import pyarrow as pa  # noqa: PLC0415
    import pyarrow.parquet as pq  # noqa: PLC0415

    trial = make_trial(Plan(1, 3, "single", ("viscous-friction",)), duration_s=rows / ROWS_PER_S)
    table = pa.table(dict(zip(COLUMNS, recording_columns(trial), strict=True)))
    pq.write_table(table, folder / "recording.parquet")
    (folder / "SIM.toml").write_text(toml_text(trial.tables))
    return int(trial.load_N.size)


def counted(rows: int) -> str:
    """Return a number of rows to the thousand, in groups of three digits."""
    return f"{1000 * (rows // 1000):,}".replace(",", " ")


def picture(found: list[Cost]) -> str:
    """Draw seconds and MiB over rows, seconds over candidates, and over workers where these were measured."""
    most = max(cost.candidates for cost in found)
    all_cores = {cost.rows: cost for cost in found if cost.candidates == most}  # the last of each is on most cores
    by_rows = [(rows / 1000, cost.cpu_s, cost.memory_MiB) for rows, cost in all_cores.items()]
    full = max(cost.rows for cost in found if cost.candidates < most)
    by_count = sorted((float(cost.candidates), cost.cpu_s) for cost in found if cost.rows == full)
    several = {cost.rows for cost in found if cost.workers > 1}
    by_workers = [(float(cost.workers), cost.wall_s) for cost in found if cost.rows == min(several, default=0)]
    panels = [
        ("rows (thousands)", "processor time (s)", [(x, y) for x, y, _ in by_rows], GOAL_CPU_S),
        ("rows (thousands)", "memory of a process (MiB)", [(x, y) for x, _, y in by_rows], GOAL_MIB),
        (f"candidates, at {counted(full)} rows", "processor time (s)", by_count, GOAL_CPU_S),
    ]
    if by_workers:
        panels.append((f"workers, at {counted(min(several))} rows", "time (s)", by_workers, GOAL_LONG_S))
    parts = [STYLE]
    for at, (across, up, points, limit) in enumerate(panels):
        wide = 1.1 * max(x for x, _ in points)
        top = 1.15 * max(limit, *(y for _, y in points))
        panel = Panel(62 + 280 * at, 24, 200, 150, (0, wide), (0, top))
        parts += [box(panel), axes(panel, across, "", x_about=4), text(panel.left, 15, up)]
        parts.append(line([(panel.at_x(x), panel.at_y(limit)) for x in (0, wide)], "zero"))
        beside = 13 if limit > top / 4 else -4  # below its line, where there is room
        parts.append(text(panel.left + 196, panel.at_y(limit) + beside, GOALS[limit], anchor="end"))
        parts.append(line([(panel.at_x(x), panel.at_y(y)) for x, y in points], "after"))
        for x, y in points:
            parts.append(f'<circle class="dot" cx="{panel.at_x(x):.1f}" cy="{panel.at_y(y):.1f}" r="3"/>')
    return svg(1130, 220, parts, "Time and memory against rows, candidates and workers")


def main(figures: Path, drawing: Path, most_rows: int = MOST_ROWS) -> None:
    """Measure, write the flat figures and the picture."""
    with tempfile.TemporaryDirectory() as scratch:
        found = costs(Path(scratch), most_rows)
    flat: dict[str, float] = {}
    for cost in found:
        key = f"rows_{cost.rows}_candidates_{cost.candidates}_workers_{cost.workers}"
        flat |= {f"{key}_wall_s": cost.wall_s, f"{key}_cpu_s": cost.cpu_s, f"{key}_memory_MiB": cost.memory_MiB}
    for path, content in ((figures, json.dumps(flat, indent=1) + "\n"), (drawing, picture(found) + "\n")):
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(content)


if __name__ == "__main__":
    main(Path(sys.argv[1]), Path(sys.argv[2]), *map(int, sys.argv[3:]))
