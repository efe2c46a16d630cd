"""`make chaos SECONDS=1800 SEED=1`: a daemon on SocketCAN meets faults in a random order; its outside is checked.

Each round begins with everything normal. A fault is drawn, sometimes a second one of another kind beside it, and in
half of the rounds the wheels turn. After a random time the fault ends, and the time until everything is normal again is
measured. Checked all the time:

- snapshots arrive in order and complete, in each session, and a repetition is marked;
- each published value came on the bus between its SYNC and the next: nothing is stale or invented;
- what the store held when the daemon was killed or stopped arrives;
- every recording can be read without a gap, and its log replays to the same numbers;
- the wheels stop where they must, also when the client of a traverse disconnects;
- each fault that has an alarm raises it; SIGTERM is obeyed within 5 s.

Exit status 1 where something does not hold. The figures are written to build/figures/chaos.json.
"""

from __future__ import annotations

import argparse
import json
import platform
import random
import statistics
import sys
import tempfile
import time
from collections import defaultdict
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING

from chaos_faults import CAN, COMPUTER, DAEMON, SIGTERM_TIMEOUT_S, Fault, possible
from chaos_recordings import check_recordings
from chaos_rig import Rig, new_rig

if TYPE_CHECKING:
    from collections.abc import Iterator

    from chaos_observers import Snapshot

ROOT = Path(__file__).resolve().parents[2]
TWO_AT_ONCE = 0.25
DRIVING = 0.5
STOP_TIMEOUT_S = 8.0
"""Time in which wheels must stand still: loss of a heartbeat is noticed after 3 s, and the guest is slow."""


@dataclass
class Outcome:
    """What came of one kind of fault."""

    normal_after_s: list[float] = field(default_factory=list)
    never_normal: int = 0
    lost: int = 0


def main() -> None:
    """Run for the given time, print the table, and write the figures."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--seconds", type=float, default=1800.0)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--only", help="names of faults, separated by commas")
    parser.add_argument("--figures", type=Path, default=ROOT / "build/figures/chaos.json")
    chosen = parser.parse_args()
    with tempfile.TemporaryDirectory() as folder:
        rig = new_rig(Path(folder))
        try:
            figures = run(rig, chosen.seconds, chosen.seed, chosen.only.split(",") if chosen.only else [])
        finally:
            rig.close()
    figures = {"command": f"make chaos SECONDS={chosen.seconds:g} SEED={chosen.seed}"} | figures
    chosen.figures.parent.mkdir(parents=True, exist_ok=True)
    chosen.figures.write_text(json.dumps(figures, indent=1) + "\n")
    say(json.dumps(figures, indent=1))
    for problem in rig.problems[:40]:
        say(f"DOES NOT HOLD: {problem}")
    sys.exit(bool(rig.problems))


def say(line: str) -> None:
    """Print a line at once."""
    sys.stdout.write(f"{line}\n")
    sys.stdout.flush()


def run(rig: Rig, seconds: float, seed: int, only: list[str]) -> dict[str, object]:
    """Run rounds until the time is over, then stop everything and check it; return the figures."""
    outcomes: defaultdict[str, Outcome] = defaultdict(Outcome)
    begun, rounds, compared = time.monotonic(), 0, 0
    rig.check(rig.until_normal() is not None, "not normal at the start")
    for faults, drive, hold_s in plan(seed, only):
        if time.monotonic() - begun > seconds:
            break
        rounds += 1
        name = " + ".join(fault.name for fault in faults) if len(faults) == 1 else "two at once"
        one_round(rig, faults, outcomes[name], drive=drive, hold_s=hold_s)
        received = rig.messages.snapshots[compared:]
        compared += len(received)
        rig.compare_with_bus(received, " + ".join(fault.name for fault in faults))
        outcomes[name].lost += lost(received)
        if rig.daemon.poll() is not None:
            rig.check(False, f"the daemon has ended: {rig.daemon.poll()}")
            break
    end(rig)
    rig.check_order()
    files, messages = check_recordings(rig)
    longest = max(rig.sigterm_s, default=0.0)
    rig.check(longest <= SIGTERM_TIMEOUT_S, f"SIGTERM took {longest:.1f} s")
    return {
        "measured": f"{time.strftime('%Y-%m-%d')}, Linux {platform.release()}, {rounds} rounds in {seconds:g} s",
        "invariants checked": rig.checked,
        "invariants violated": len(rig.problems),
        "snapshots received": len(rig.messages.snapshots),
        "values compared with the bus": rig.compared,
        "frames of faulty nodes": rig.sent,
        "snapshots queued at a kill or stop": len(rig.queued),
        "recordings read": files,
        "recorded messages that replay to the same numbers": messages,
        "longest time from SIGTERM to the end, s": round(longest, 2),
        **table(outcomes),
    }


def lost(received: list[Snapshot]) -> int:
    """Return how many snapshots of each session are missing between the first and the last of a round."""
    sequences: defaultdict[str, set[int]] = defaultdict(set)
    for each in received:
        sequences[each.session].add(each.sequence)
    return sum(max(one) - min(one) + 1 - len(one) for one in sequences.values())


def plan(seed: int, only: list[str]) -> Iterator[tuple[list[Fault], bool, float]]:
    """Yield rounds without end: one fault or two, whether the wheels turn, and how long it lasts."""
    chance = random.Random(seed)
    faults = [fault for fault in possible() if not only or fault.name in only]
    while True:
        for fault in chance.sample(faults, len(faults)):  # each once before any comes again
            both = [fault]
            others = [other for other in faults if other.kind != fault.kind and other.kind not in {CAN, DAEMON}]
            if others and chance.random() < TWO_AT_ONCE:
                both.append(chance.choice(others))
            yield both, chance.random() < DRIVING, max(chance.uniform(*each.hold_s) for each in both)


def one_round(rig: Rig, faults: list[Fault], outcome: Outcome, *, drive: bool, hold_s: float) -> None:
    """Begin the faults, end them, wait until everything is normal, and check what they must cause."""
    what = " + ".join(fault.name for fault in faults)
    driving = drive and rig.drive()
    begun = time.monotonic()
    for fault in faults:
        fault.begin(rig)
    time.sleep(hold_s)
    if driving and any(fault.stops for fault in faults):
        check_standstill(rig, what, begun)
    for fault in reversed(faults):
        fault.end(rig)
    after = rig.until_normal()
    if after is None:
        outcome.never_normal += 1
        rig.check(False, f"{what}: not normal again: {rig.stack.output('daemon')[-1500:]}")
    else:
        outcome.normal_after_s.append(after)
    say(f"{what:60} {'driving' if driving else '':8} {f'{after:.1f} s' if after is not None else 'NEVER'}")
    for fault in faults:
        if fault.heard is not None and not unnoticed(fault, faults):
            topic, fields = fault.heard
            rig.check(rig.until_heard(topic, begun, **fields), f"{what}: not heard: {topic} {fields}")
    rig.end_drive()
    if driving:
        deadline = time.monotonic() + STOP_TIMEOUT_S
        while rig.turning() and time.monotonic() < deadline:
            time.sleep(0.1)
        rig.check(not rig.turning(), f"{what}: wheels turn after the client has gone")


def unnoticed(fault: Fault, faults: list[Fault]) -> bool:
    """Return whether the daemon cannot notice a fault: it does not run meanwhile, or has nothing to write."""
    if fault.kind != COMPUTER:
        return False
    nothing_to_write = fault.name == "disk full" and any(other.name == "link down" for other in faults)
    return nothing_to_write or any(other.kind == DAEMON and other.stops for other in faults)


def check_standstill(rig: Rig, what: str, begun: float) -> None:
    """Check that all wheels stand still at the latest `STOP_TIMEOUT_S` after the fault's begin."""
    running = rig.daemon.poll() is None and "suspended" not in what and "link" not in what
    if "link" in what:
        return  # nobody can ask the drives; the check after the round does
    standing = (lambda: not rig.turning()) if running else rig.stopped_by_sdo
    while not standing() and time.monotonic() - begun < STOP_TIMEOUT_S:
        time.sleep(0.1)
    rig.check(standing(), f"{what}: wheels turn {STOP_TIMEOUT_S:g} s after it")
    if not running:
        rig.bus.speeds.clear()  # no PDO comes without SYNC


def end(rig: Rig) -> None:
    """Stop the daemon with everything delivered."""
    begun = time.monotonic()
    rig.daemon.terminate()
    rig.check(rig.daemon.wait(30) == 0, f"exit status {rig.daemon.returncode} at the end")
    rig.sigterm_s.append(time.monotonic() - begun)
    rig.note_queued()
    time.sleep(2.0)  # the broker delivers
    rig.check("Traceback" not in rig.stack.output("daemon"), f"traceback: {rig.stack.output('daemon')[-3000:]}")


def table(outcomes: dict[str, Outcome]) -> dict[str, object]:
    """Return the figures of each kind of fault as `FAULT / COLUMN`."""
    figures: dict[str, object] = {}
    for name, outcome in sorted(outcomes.items()):
        times = outcome.normal_after_s
        figures[f"{name} / times"] = len(times) + outcome.never_normal
        figures[f"{name} / normal after, median s"] = round(statistics.median(times), 1) if times else None
        figures[f"{name} / normal after, longest s"] = round(max(times), 1) if times else None
        figures[f"{name} / snapshots lost"] = outcome.lost
    return figures


if __name__ == "__main__":
    main()
