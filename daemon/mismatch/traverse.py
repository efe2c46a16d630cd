"""The recording of the last traverse, and a simulation made from `rover.toml`: what `regolithd compare` compares."""

from __future__ import annotations

import csv
from dataclasses import dataclass
from typing import TYPE_CHECKING

from regolithd.calibration.mismatch.errors import RecordingError
from regolithd.calibration.parameters import SOILS, Soil
from regolithd.daemon.control.traversed import NAME, Traversed
from regolithd.daemon.messages.header import iso_time
from regolithd.daemon.recording.export import HEADER, recorded_snapshots, rows

if TYPE_CHECKING:
    from collections.abc import Iterator
    from pathlib import Path

    from regolithd.daemon.config.configuration import Configuration
    from regolithd.daemon.pipeline.snapshot import Snapshot

UNKNOWN_SOIL = "sandy-loam"
UNKNOWN_SOIL_STD, KNOWN_SOIL_STD = 0.5, 0.05
"""Relative standard deviations of cohesion and friction angle: of any soil about the middle one, and of a named one."""
SENSORS = {"load_relative_std": 0.07, "ground_speed_relative_std": 0.005, "pitch_std_rad": 0.002, "roll_std_rad": 0.002}
"""Standard errors of a reading, as usual for Kapvik's sensors; SIM.toml may state others."""
_SECOND_NS = 1_000_000_000


@dataclass(frozen=True, slots=True)
class TraverseFiles:
    """The files of one comparison."""

    recording: Path
    report: Path
    answer: Path
    corrected: Path


def extract_last_traverse(recordings: Path) -> TraverseFiles:
    """Write the rows of the last traverse to a CSV file in `comparisons`, beside the recordings.

    Raises
    ------
    RecordingError
        No traverse has been driven, or its recording is not there.
    """
    try:
        traversed = Traversed.read(recordings)
    except (OSError, ValueError) as error:
        told = f"no traverse has ended since recordings are written here: there is no {NAME}"
        raise RecordingError(f"{recordings}: {told}. Drive one: `regolithd traverse`") from error
    stamp = iso_time(traversed.from_ns)[:19].replace("-", "").replace(":", "")
    folder = recordings / "comparisons"
    folder.mkdir(exist_ok=True)
    stem = folder / f"traverse-{stamp}Z"
    files = TraverseFiles(*(stem.with_suffix(suffix) for suffix in (".csv", ".html", ".json", ".corrected.toml")))
    if not _write_rows(_snapshots(recordings, traversed), files.recording):
        raise RecordingError(
            f"{recordings}: no snapshot of the traverse of {stamp}Z is recorded. Look at the alarm recording"
        )
    return files


def _snapshots(recordings: Path, traversed: Traversed) -> Iterator[Snapshot]:
    """Yield the snapshots between begin and end, from the files that were written to since the begin."""
    files = sorted(recordings.glob("rover-*.mcap"))
    since = [path for path in files if path.stat().st_mtime_ns >= traversed.from_ns - _SECOND_NS]
    for snapshot in recorded_snapshots(since, on_gap=lambda _text: None):
        if traversed.from_ns <= snapshot.time_ns <= traversed.to_ns:
            yield snapshot


def _write_rows(snapshots: Iterator[Snapshot], path: Path) -> int:
    count = 0
    with path.open("w", newline="", encoding="ascii") as file:
        writer = csv.writer(file, lineterminator="\n")
        writer.writerow(HEADER)
        for row in rows(snapshots):
            writer.writerow(row)
            count += 1
    return count


def simulation_toml(configuration: Configuration) -> str:
    """Return a SIM.toml for the built-in simulation, with the tables that `rover.toml` shares with it.

    The soil is `[posterior] soil` where it is named there; otherwise a middle one, known to a half.
    """
    named = configuration.posterior.soil
    std = KNOWN_SOIL_STD if named else UNKNOWN_SOIL_STD
    stated = {"cohesion_relative_std": std, "friction_angle_relative_std": std / (1 if named else 2)}
    soil = Soil.model_validate(SOILS[named or UNKNOWN_SOIL].model_dump() | stated)
    tables = {
        "drivetrain": configuration.drivetrain.model_dump(),
        "wheel": configuration.wheel.model_dump(),
        "rover": configuration.rover.body.model_dump(),
        "soil": soil.model_dump(),
        "sensors": SENSORS,
    }
    lines = ["# Written by `regolithd compare` from rover.toml: the built-in simulation with this rover's parameters."]
    lines += ["# Put a SIM.toml of your own, or a corrected one, beside rover.toml; it is used instead.", ""]
    lines += ["[simulation]", 'model = "rover-wheel"', f"slip_without_ground_speed = {configuration.slip.constant}"]
    for name, table in tables.items():
        lines += ["", f"[{name}]", *(f"{key} = {_toml(value)}" for key, value in table.items())]
    return "\n".join(lines) + "\n"


def _toml(value: float | tuple[float, ...]) -> str:
    return str(list(value)) if isinstance(value, tuple) else str(value)
