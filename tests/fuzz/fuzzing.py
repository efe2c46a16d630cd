"""`make fuzz SECONDS=3600 SEED=1`: random damage to everything that the program reads from others.

Each input must be taken, or refused by the error that its reader documents; anything else is a defect: another
exception, no end within `HANG_S` or `WAIT_S`, another exit status than 78 for a configuration, or memory that grows.
The seed of a defective input is printed; `--only NAME --seed N --inputs 1` repeats it. The figures are in
build/figures/fuzz.json.
"""

from __future__ import annotations

import argparse
import gc
import json
import logging
import os
import platform
import resource
import signal
import sys
import tempfile
import time
import traceback
import warnings
from collections import Counter
from dataclasses import dataclass, field
from pathlib import Path
from random import Random
from typing import TYPE_CHECKING, NoReturn

from servers import SERVERS
from targets import TARGETS

if TYPE_CHECKING:
    from targets import Target

ROOT = Path(__file__).resolve().parents[2]
HANG_S = 20
"""Processor time for one input."""
WAIT_S = 180
"""Time for one input, waiting included: another program's load must not look like a hang."""
GROWTH_MB = 20.0
"""Memory that a kind of input may gain from the end of its first quarter to its end: caches and fragmentation."""
PAGE_MB = resource.getpagesize() / 1e6


class HangError(Exception):
    """An input was not read in time."""


@dataclass
class Result:
    """What came of one kind of input; `defects` maps the place of a defect to the seed of an input."""

    inputs: int = 0
    refused: int = 0
    hangs: int = 0
    defects: dict[str, str] = field(default_factory=dict)
    counts: Counter[str] = field(default_factory=Counter)
    growth_MB: float = 0.0


def main() -> None:
    """Fuzz for the given time, print the table, and write the figures."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--seconds", type=float, default=3600.0)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--inputs", type=int, help="inputs of each kind, instead of a time")
    parser.add_argument("--only", help="name of one kind of input")
    parser.add_argument("--figures", type=Path, default=ROOT / "build/figures/fuzz.json")
    chosen = parser.parse_args()
    logging.disable(logging.CRITICAL)
    warnings.simplefilter("ignore")
    results = fuzz(chosen.seconds, chosen.seed, chosen.inputs, chosen.only)
    figures = {
        "command": f"make fuzz SECONDS={chosen.seconds:g} SEED={chosen.seed}",
        "measured": f"{time.strftime('%Y-%m-%d')}, Python {platform.python_version()}",
        **table(results),
    }
    chosen.figures.parent.mkdir(parents=True, exist_ok=True)
    chosen.figures.write_text(json.dumps(figures, indent=1) + "\n")
    sys.exit(any(result.defects or result.hangs for result in results.values()))


def fuzz(seconds: float, seed: int, inputs: int | None = None, only: str | None = None) -> dict[str, Result]:
    """Return the result of each kind of input."""
    for number in (signal.SIGALRM, signal.SIGPROF):
        signal.signal(number, _hang)
    targets = [target for target in (*TARGETS, *SERVERS) if only in {None, target.name}]
    whole = sum(target.share for target in targets)
    results = {}
    for target in targets:
        with tempfile.TemporaryDirectory() as folder:
            results[target.name] = result = fuzz_one(target, seconds * target.share / whole, seed, inputs, Path(folder))
        sys.stdout.write(
            f"{target.name:20} {result.inputs:8} inputs {result.refused:8} refused {len(result.defects)} defects "
            f"{result.growth_MB:+.1f} MB\n"
        )
        for text, example in result.defects.items():
            sys.stdout.write(f"--- {result.counts[text]} times, first {example}\n{text}\n")
        sys.stdout.flush()
    return results


def fuzz_one(target: Target, seconds: float, seed: int, inputs: int | None, folder: Path) -> Result:
    """Feed one kind of input, each from a seed of its own."""
    result, begun, early_MB = Result(), time.monotonic(), None
    while result.inputs < inputs if inputs else time.monotonic() - begun < seconds:
        if early_MB is None and time.monotonic() - begun > seconds / 4:
            gc.collect()
            early_MB = resident_MB()
        read_one(target, f"{seed}-{result.inputs}", folder, result)
        result.inputs += 1
    gc.collect()
    if not inputs:  # a few inputs only fill the caches
        result.growth_MB = resident_MB() - (early_MB or resident_MB())
    if result.growth_MB > GROWTH_MB:
        result.defects[f"memory has grown by {result.growth_MB:.0f} MB"] = f"{seed}-0"
    return result


def read_one(target: Target, seed: str, folder: Path, result: Result) -> None:
    """Feed one input, and note what came of it."""
    signal.alarm(WAIT_S)
    signal.setitimer(signal.ITIMER_PROF, HANG_S)
    try:
        target.one(Random(f"{target.name} {seed}"), folder)
    except target.allowed:
        result.refused += 1
    except HangError:
        result.hangs += 1
        result.defects.setdefault("hang: " + traceback.format_exc()[-800:], seed)
    except Exception as error:  # noqa: BLE001  # this is what is looked for
        last = traceback.extract_tb(error.__traceback__)[-1]
        text = f"{type(error).__name__} at {Path(last.filename).name}:{last.lineno}"
        if text not in result.counts:
            result.defects[text + "\n" + traceback.format_exc()[-1500:]] = seed
        result.counts[text] += 1
    finally:
        signal.setitimer(signal.ITIMER_PROF, 0)
        signal.alarm(0)


def _hang(_number: int, _frame: object) -> NoReturn:
    raise HangError


def resident_MB() -> float:
    """Return the memory of this process."""
    return int(Path(f"/proc/{os.getpid()}/statm").read_text().split()[1]) * PAGE_MB


def table(results: dict[str, Result]) -> dict[str, object]:
    """Return the figures as `KIND / COLUMN`."""
    figures: dict[str, object] = {
        "inputs": sum(result.inputs for result in results.values()),
        "tracebacks": sum(sum(result.counts.values()) for result in results.values()),
        "hangs": sum(result.hangs for result in results.values()),
    }
    for name, result in results.items():
        figures[f"{name} / inputs"] = result.inputs
        figures[f"{name} / refused"] = result.refused
        figures[f"{name} / tracebacks"] = sum(result.counts.values())
        figures[f"{name} / hangs"] = result.hangs
        figures[f"{name} / memory gained, MB"] = round(result.growth_MB, 1)
    return figures


if __name__ == "__main__":
    main()
