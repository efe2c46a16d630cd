"""`make interop`: other CANopen stacks as slaves on SocketCAN; the table of scenarios × stacks in the documentation.

    make interop CANOPENLINUX=FOLDER LELY=FOLDER

CANOPENLINUX is a checkout of CANopenNode/CANopenLinux with its sub-module CANopenNode; LELY one of
lely-industries/lely-core. A stack without sources is left out of the run, and keeps its column.
"""

from __future__ import annotations

import argparse
import asyncio
import json
import sys
from pathlib import Path
from typing import TYPE_CHECKING

import scenarios
import stacks

if TYPE_CHECKING:
    from stacks import Stack

ROOT = Path(__file__).parents[2]
PAGE, RESULTS = ROOT / "docs/reference/interop.md", ROOT / "tests/interop/results.json"
BUILD = ROOT / "build/interop"
_NAMES = [*(each.__name__ for each in scenarios.SCENARIOS), "killed_daemon"]


def main() -> None:
    """Run every stack, and write the page; `drive CHANNEL` is the master that is killed."""
    if sys.argv[1:2] == ["drive"]:
        asyncio.run(scenarios.drive(sys.argv[2]))
        return
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--canopenlinux", type=Path)
    parser.add_argument("--lely", type=Path)
    parser.add_argument("--channel", default="vcan0")
    chosen = parser.parse_args()
    results = json.loads(RESULTS.read_text()) if RESULTS.exists() else {}
    for stack in available(chosen.canopenlinux, chosen.lely):
        results[stack.name] = asyncio.run(outcomes(stack, chosen.channel))
    RESULTS.write_text(json.dumps(results, indent=2) + "\n")
    PAGE.write_text(page(results), encoding="utf-8")
    sys.exit(int(any(said != "passed" for result in results.values() for said in result.values())))


def available(canopenlinux: Path | None, lely: Path | None) -> list[Stack]:
    """Return the stacks whose sources are given, built, with the versions of the sources."""
    found = [stacks.python_canopen()]
    if canopenlinux:
        found.append(stacks.canopennode(canopenlinux.resolve(), BUILD / "canopennode"))
    if lely:
        found.append(stacks.lely(lely.resolve(), BUILD / "lely"))
    return found


async def outcomes(stack: Stack, channel: str) -> dict[str, str]:
    """Return the outcome of each scenario, and print it."""
    found = {}
    async for name, said in scenarios.run_all(stack, channel):
        found[name] = said
        sys.stdout.write(f"{stack.name:24} {name:16} {said}\n")
        sys.stdout.flush()
    return found


def page(results: dict[str, dict[str, str]]) -> str:
    """Return the page with the table."""
    names = list(results)
    documented = {
        each.__name__: (each.__doc__ or "").rstrip(".") for each in (*scenarios.SCENARIOS, scenarios.killed_daemon)
    }
    rows = [
        f"| {name.replace('_', ' ')} | {documented[name]} | "
        + " | ".join(results[stack].get(name, "not run") for stack in names)
        + " |"
        for name in _NAMES
    ]
    return (
        "# Other CANopen stacks\n\n<!-- Written by `make interop`. -->\n\n"
        "Two drives and a load cell made of other CANopen stacks, on SocketCAN, driven by regolithd's master.\n\n"
        f"| scenario | what must happen | {' | '.join(names)} |\n|---|---|{'---|' * len(names)}\n"
        + "\n".join(rows)
        + "\n\n"
        "`make interop CANOPENLINUX=… LELY=…` builds the slaves from sources that you point to, and writes this page.\n"
    )


if __name__ == "__main__":
    main()
