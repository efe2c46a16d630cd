"""`make interop`: other CANopen stacks as slaves on SocketCAN; the table of scenarios × stacks in the documentation.

    make interop CANOPENLINUX=FOLDER LELY=FOLDER

CANOPENLINUX is a checkout of CANopenNode/CANopenLinux with its sub-module CANopenNode; LELY one of
lely-industries/lely-core. A stack without sources is left out of the run, and keeps its column. The exit
status is 1 where a scenario failed.
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
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--canopenlinux", type=Path)
    parser.add_argument("--lely", type=Path)
    parser.add_argument("--channel", default="vcan0")
    chosen = parser.parse_args()
    results = json.loads(RESULTS.read_text()) if RESULTS.exists() else {}
    for name, folder in (("CANOPENLINUX", chosen.canopenlinux), ("LELY", chosen.lely)):
        if folder is None:
            say(f"{name}=FOLDER is not given: this stack is left out, and keeps its column")
    for stack in available(chosen.canopenlinux, chosen.lely):
        results[stack.name] = asyncio.run(outcomes(stack, chosen.channel))
    RESULTS.write_text(json.dumps(results, indent=2) + "\n")
    PAGE.write_text(page(results), encoding="utf-8")
    sys.exit(int(any(said != "passed" for result in results.values() for said in result.values())))


def available(canopenlinux: Path | None, lely: Path | None) -> list[Stack]:
    """Return the stacks whose sources are given, built, with the versions of the sources."""
    found = [stacks.python_canopen()]
    if canopenlinux:
        say("building CANopenNode …")
        found.append(stacks.canopennode(canopenlinux.resolve(), BUILD / "canopennode"))
    if lely:
        say("building Lely core …")
        found.append(stacks.lely(lely.resolve(), BUILD / "lely"))
    return found


async def outcomes(stack: Stack, channel: str) -> dict[str, str]:
    """Return the outcome of each scenario, and print it."""
    found = {}
    async for name, said in scenarios.run_all(stack, channel):
        found[name] = said
        say(f"{stack.name:24} {name:16} {said}")
    return found


def say(line: str) -> None:
    """Print a line at once."""
    sys.stdout.write(f"{line}\n")
    sys.stdout.flush()


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
        "To repeat it, with the sources in folders of your choice (needs gcc; a stack whose folder is not given keeps"
        " its column):\n\n"
        f"```sh\n{stacks.LINUX_SOURCES}\n{stacks.LELY_SOURCES}\n"
        "make interop CANOPENLINUX=CANopenLinux LELY=lely-core       # some minutes; writes this page\n```\n\n"
        "Where the kernel has no vcan, it runs in User Mode Linux: "
        "`sudo apt-get install user-mode-linux iproute2 kmod hostname`.\n"
    )


if __name__ == "__main__":
    main()
