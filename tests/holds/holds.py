"""`make holds SEED=1 DAY=86400`: SIGKILL at 300 points, 10 000 flipped bits, nodes that babble, a day that is replayed.

Writes build/figures/holds.json; exit status 1 where something was lost, altered, late or fatal.
"""

from __future__ import annotations

import argparse
import json
import platform
import sys
import tempfile
import time
from dataclasses import asdict
from pathlib import Path

from babble import BUS_SPEED, run_babble
from flipped_bits import flip_all
from kill_points import kill_points
from replayed_day import replay_day

ROOT = Path(__file__).resolve().parents[2]
SHARE_IN_TIME = 0.99
STOP_TIMEOUT_S = 5.0


def main() -> None:
    """Measure, and write the figures."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--kills", type=int, default=300)
    parser.add_argument("--bits", type=int, default=10_000)
    parser.add_argument("--babble-seconds", type=float, default=30.0)
    parser.add_argument("--day-seconds", type=float, default=86_400.0)
    parser.add_argument("--figures", type=Path, default=ROOT / "build/figures/holds.json")
    chosen = parser.parse_args()
    figures: dict[str, object] = {
        "command": f"make holds SEED={chosen.seed} DAY={chosen.day_seconds:g}",
        "measured": f"{time.strftime('%Y-%m-%d')}, Python {platform.python_version()}",
    }
    failures: list[str] = []
    for part in (killed, flipped, babbling, replayed):
        with tempfile.TemporaryDirectory() as folder:
            figures |= part(Path(folder), chosen, failures)
        sys.stdout.write(json.dumps(figures, indent=1) + "\n")
        sys.stdout.flush()
    chosen.figures.parent.mkdir(parents=True, exist_ok=True)
    chosen.figures.write_text(json.dumps(figures, indent=1) + "\n")
    for failure in failures:
        sys.stdout.write(f"DOES NOT HOLD: {failure}\n")
    sys.exit(bool(failures))


def killed(folder: Path, chosen: argparse.Namespace, failures: list[str]) -> dict[str, object]:
    """Kill a process that stores."""
    found = kill_points(folder, chosen.kills, chosen.seed)
    if found.lost or found.altered:
        failures.append(f"kills: {found}")
    return {
        "SIGKILL points": found.points,
        "records stored meanwhile": found.stored,
        "records lost": found.lost,
        "records altered": found.altered,
    }


def flipped(folder: Path, chosen: argparse.Namespace, failures: list[str]) -> dict[str, object]:
    """Flip bits in files."""
    figures: dict[str, object] = {}
    for name, found in flip_all(folder, chosen.bits, chosen.seed).items():
        if found.silent or found.fatal:
            failures.append(f"flipped bits in {name}: {found}")
        titles = ("flipped bits", "without effect", "noticed", "silently different", "fatal")
        figures |= {f"{name} / {title}": value for title, value in zip(titles, asdict(found).values(), strict=True)}
    return figures


def babbling(folder: Path, chosen: argparse.Namespace, failures: list[str]) -> dict[str, object]:
    """Let a node babble, and drives flip their statusword."""
    figures: dict[str, object] = {}
    cases = {"EMCY at bus speed": (10.0, BUS_SPEED, False), "statusword flips at 200 Hz": (200.0, 0, True)}
    for name, (rate_Hz, emcy_Hz, flips) in cases.items():
        place = folder / name.split()[0]
        place.mkdir()
        found = run_babble(place, chosen.babble_seconds, rate_Hz, emcy_Hz, flips=flips)
        share = found.in_time / max(found.syncs, 1)
        if share < SHARE_IN_TIME or found.alarms != 1 or found.stopped_after_s > STOP_TIMEOUT_S:
            failures.append(f"{name}: {found}")
        figures |= {
            f"{name}: SYNCs": found.syncs,
            f"{name}: snapshots in time": share,
            f"{name}: disturbances": found.disturbances,
            f"{name}: EMCY and event messages": found.events,
            f"{name}: alarms": found.alarms,
            f"{name}: share of a core, bus and broker's client included": found.cpu_share,
            f"{name}: stopped after, s": found.stopped_after_s,
        }
    return figures


def replayed(folder: Path, chosen: argparse.Namespace, failures: list[str]) -> dict[str, object]:
    """Replay a day."""
    found = replay_day(folder, chosen.day_seconds, 2.0, chosen.seed)
    if not found.equal:
        failures.append(f"replay: {found}")
    return {
        "replayed: hours at 2 Hz": chosen.day_seconds / 3600,
        "replayed: snapshots published": found.snapshots,
        "replayed: snapshots replayed": found.replayed,
        "replayed: MB of snapshot messages": found.published_MB,
        "replayed: MB of logs": found.logs_MB,
        "replayed: every byte equal": found.equal,
    }


if __name__ == "__main__":
    main()
