"""A season of recordings of five virtual rovers, compared on a local Dask cluster, a worker killed half way.

    python -m regolithd.calibration.validation.fleet_study --drives 20 --check 10 --figures build/figures/fleet.json

Prints what was found beside what is concealed, and the largest relative difference between the results of single
recordings on the cluster and in this process. Beside the recordings, `report.html` is the report of the season.
"""

from __future__ import annotations

import argparse
import json
import os
import signal
import time
from dataclasses import dataclass, field
from functools import partial
from hashlib import sha256
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from distributed import LocalCluster

from regolithd.calibration.mismatch.data.recording import read_recording
from regolithd.calibration.mismatch.fleet.comparison import FleetComparison, Member, compare_fleet
from regolithd.calibration.mismatch.fleet.member import date_in
from regolithd.calibration.mismatch.fleet.report.page import FleetProvenance, fleet_report
from regolithd.calibration.mismatch.fleet.work.store import Store
from regolithd.calibration.mismatch.fleet.work.workers import DaskCluster, ThisProcess
from regolithd.calibration.mismatch.simulation.load import load_simulation
from regolithd.calibration.validation.blind_trials.figures.report_screenshot import screenshot
from regolithd.calibration.validation.fleet_study.season import DAYS, ROVERS, START, drives, write_season

if TYPE_CHECKING:
    from collections.abc import Sequence

FOLDER = Path("build/fleet")


@dataclass
class Killer:
    """Kills one worker process of a cluster when half of the recordings are compared.

    Attributes
    ----------
    cluster: whose workers are processes of this computer
    killed: process ids
    """

    cluster: LocalCluster
    killed: list[int] = field(default_factory=list)

    def __call__(self, step: str, done: int, of: int) -> None:
        """Print the progress, and kill at half of the first step."""
        print(f"{step}: {done} of {of}", flush=True)  # noqa: T201  # a command line
        if step == "comparing" and not self.killed and 2 * done >= of > done:
            pid = next(iter(self.cluster.workers.values())).pid
            os.kill(pid, signal.SIGKILL)
            self.killed.append(pid)
            print(f"killed the worker with process id {pid}", flush=True)  # noqa: T201


def members_of(paths: Sequence[Path]) -> list[Member]:
    """Return the recordings; the folder names the rover, the file the time."""
    return [
        Member(
            name=f"{path.parent.name}/{path.name}",
            rover=path.parent.name,
            begins=date_in(path.name),
            read=partial(read_recording, path.resolve()),
            digest=sha256(path.read_bytes()).hexdigest(),
        )
        for path in paths
    ]


def on_a_cluster(paths: Sequence[Path], folder: Path, workers: int) -> tuple[FleetComparison, int]:
    """Compare on a cluster of this computer, kill a worker half way, and return how many were killed."""
    load = partial(load_simulation, (folder / "SIM.toml").resolve())
    local = LocalCluster(n_workers=workers, threads_per_worker=1, dashboard_address=None)
    with local as cluster, DaskCluster(cluster.scheduler_address) as remote:
        killer = Killer(cluster)
        found = compare_fleet(
            members_of(paths),
            load,
            workers=remote,
            store=Store(folder / "parts"),
            progress=killer,
        )
    return found, len(killer.killed)


def largest_difference(one: object, other: object) -> float:
    """Return the largest relative difference of the numbers of two answers; infinite where they differ otherwise."""
    if isinstance(one, dict) and isinstance(other, dict) and one.keys() == other.keys():
        return max((largest_difference(one[key], other[key]) for key in one), default=0.0)
    if isinstance(one, list) and isinstance(other, list) and len(one) == len(other):
        return max((largest_difference(*pair) for pair in zip(one, other, strict=True)), default=0.0)
    if isinstance(one, int | float) and isinstance(other, int | float) and not isinstance(one, bool):
        return abs(one - other) / max(abs(one), abs(other), 1e-300)
    return 0.0 if one == other else float("inf")


def score(answer: Any) -> dict[str, float]:  # noqa: ANN401  # JSON
    """Return how many of the rovers' effects were found with name, rover, wheels and date, and what else was named."""
    effects = {effect["rovers"][0]: effect for effect in answer["effects"] if len(effect["recordings"]) > 1}
    right = dated = 0
    for place, (rover, concealed) in enumerate(ROVERS.items()):
        effect = effects.pop(rover, None)
        if concealed is None:
            right += effect is None
            continue
        if effect is None or effect["name"] != concealed.name or tuple(effect["wheels"]) != concealed.wheels:
            continue
        right += 1
        days = _days(effect["since"], place)
        if concealed.since == 0 or days is None:
            dated += (concealed.since == 0) == (days is None)
        else:
            dated += abs(days - DAYS * concealed.since) < DAYS / 10
    others = len(answer["effects"]) - (right - 1)
    return {"rovers": len(ROVERS), "right": right, "dates_within_a_tenth": dated, "other_names": max(others, 0)}


def _days(since: str | None, place: int) -> float | None:
    """Return days from the season's start."""
    if since is None:
        return None
    began = np.datetime64(since.removesuffix("Z")) - np.datetime64(START.replace(tzinfo=None).isoformat())
    return float(began / np.timedelta64(1, "D")) - place / 24


def main() -> None:
    """Write the season, compare it, check a part of it in this process, and write the figures."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--drives", type=int, default=20, help="recordings of each rover")
    parser.add_argument("--minutes", type=float, default=5.0, help="length of a recording")
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--workers", type=int, default=len(os.sched_getaffinity(0)))
    parser.add_argument("--check", type=int, default=0, help="compare only every n-th recording again in this process")
    parser.add_argument("--figures", type=Path, default=Path("build/figures/fleet.json"))
    parser.add_argument("--picture", type=Path, help="write a screenshot of the report's head here (needs chromium)")
    chosen = parser.parse_args()
    folder = FOLDER / f"{chosen.seed}-{chosen.drives}-{chosen.minutes:g}"
    paths = list(write_season(folder, chosen.seed, chosen.drives, 60 * chosen.minutes))
    started = time.perf_counter()
    found, killed = on_a_cluster(paths, folder, chosen.workers)
    wall_s = time.perf_counter() - started
    found.write_catalogue(folder / "season.parquet")
    answer = found.to_json()
    (folder / "answer.json").write_text(json.dumps(answer, indent=1))
    report = folder / "report.html"
    source = FleetProvenance(simulation="SIM.toml")
    report.write_text(fleet_report(found.answer, found.evidence, source), encoding="utf-8")
    if chosen.picture:
        screenshot(report, chosen.picture)
    figures = {"recordings": float(len(paths)), "wall_s": wall_s, "workers_killed": float(killed), **score(answer)}
    figures["largest_difference"] = _difference(paths, folder, chosen.check or 1, answer)
    chosen.figures.parent.mkdir(parents=True, exist_ok=True)
    chosen.figures.write_text(json.dumps(figures, indent=1) + "\n")
    for effect in answer["effects"]:
        print(f"{', '.join(effect['rovers'])}: {effect['name']}: {effect['statement']}")  # noqa: T201
    print(json.dumps(figures, indent=1))  # noqa: T201
    assert len(drives(chosen.drives)) == len(paths)  # noqa: S101


def _difference(paths: Sequence[Path], folder: Path, every: int, answer: Any) -> float:  # noqa: ANN401
    """Return the largest relative difference of an answer from that of this process alone, on every n-th recording."""
    load = partial(load_simulation, (folder / "SIM.toml").resolve())
    some = members_of(paths[::every])
    store = Store(folder / "parts")
    alone = compare_fleet(some, load, workers=ThisProcess()).to_json()
    stored = answer if every == 1 else compare_fleet(some, load, store=store).to_json()
    return largest_difference(stored, alone)


if __name__ == "__main__":
    main()
