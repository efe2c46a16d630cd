"""Mutation testing on a random sample: `make mutants`, or `python tests/mutation/sample.py --seed 1 --count 200`.

Works in a copy of the checkout in `build/mutants/seed-N`, and continues there: the copy, what each fast test executes,
and the result of each mutant are kept, so that the checkout may change meanwhile. Remove the folder to begin anew.

With `--retry`, the tests of the copy are renewed, not its code; the coverage of the test files that changed is measured
anew; and each survivor is tried again. What that gives is kept beside the first result, which stays.

Prints each survivor as a diff, with what `survivors.toml` says of it; writes `build/figures/mutants.json` and, for a
sample of all rooms, `docs/explanation/mutation-testing.md`.
"""

from __future__ import annotations

import argparse
import fcntl
import json
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import IO, TYPE_CHECKING

from checkout import copy_of, renew_tests
from coverage_map import coverage_map, renew
from fast_tests import FAST_S
from figures import line_of, read_words, score, write_figures, write_page
from mutants import ROOMS, Mutation, room_of, sample
from trial import Result, try_mutant

if TYPE_CHECKING:
    from collections.abc import Collection, Sequence

    from checkout import Checkout
    from figures import Words

ROOT = Path(__file__).resolve().parents[2]
PAGE = ROOT / "docs" / "explanation" / "mutation-testing.md"
SMALLEST = 50
"""Mutants of a sample that the documentation shows."""

Place = tuple[str, int, int, str]
"""File, line, column and operator of a mutant."""


def place_of(mutant: Mutation | Result) -> Place:
    """Return what tells a mutant from all others."""
    return mutant.file, mutant.line, mutant.column, mutant.operator


def read_results(path: Path) -> dict[Place, Result]:
    """Return the results so far by place; of several at one, the last."""
    rows = [Result(**json.loads(line)) for line in path.read_text().splitlines()] if path.exists() else []
    return {place_of(row): row for row in rows}


def alone_in(folder: Path) -> IO[str]:
    """Return the open lock of a folder; a second run there would restore the first one's mutants."""
    folder.mkdir(parents=True, exist_ok=True)
    lock = (folder / "lock").open("w")
    try:
        fcntl.flock(lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except BlockingIOError as error:
        raise SystemExit(f"another run works in {folder}") from error
    return lock


def drawn(root: Path, count: int, seed: int, only: str) -> list[Mutation]:
    """Return the sample, drawn once: to list every mutation takes a minute."""
    kept = root.parent / f"sample-{count}{only.replace('/', '-')}.json"
    if not kept.exists():
        kept.write_text(json.dumps([asdict(each) for each in sample(root, count, seed, only)]))
    return [Mutation(**each) for each in json.loads(kept.read_text())]


def show(number: int, result: Result, words: Words) -> None:
    """Print one result."""
    print(f"{number:4d} {result.verdict:9} {result.seconds:5.0f} s  {result.file}:{result.line}", flush=True)
    if result.verdict != "killed":
        print(result.diff, words.word(result), sep="\n", flush=True)


@dataclass(frozen=True)
class Trials:
    """The trials of one sample in its folder: `results.jsonl` of all mutants, `retried.jsonl` of survivors."""

    folder: Path
    checkout: Checkout
    words: Words

    def map_of(self, room: str) -> Path:
        """Return where a room's coverage map is kept."""
        return self.folder / f"{room.replace('/', '-')}.json"

    def first(self, chosen: Sequence[Mutation], *, shown: bool = True) -> list[Result]:
        """Try each mutant that has no result yet; return all results, those from before `shown` as well."""
        log, results = self.folder / "results.jsonl", []
        known = read_results(log)
        for number, mutation in enumerate(chosen, 1):
            before = known.get(place_of(mutation))
            result = before or self._tried(mutation, log, confirmed=False)
            if shown or before is None:
                show(number, result, self.words)
            results.append(result)
        return results

    def again(self, chosen: Sequence[Mutation], survived: Collection[Place]) -> None:
        """Renew the tests of the copy, and try each of the survivors."""
        pending = self.folder / "renewed-tests.json"  # stays where this run is interrupted before they are measured
        changed = {*renew_tests(ROOT, self.checkout), *(json.loads(pending.read_text()) if pending.exists() else ())}
        pending.write_text(json.dumps(sorted(changed)))
        for room, folder in ROOMS.items():
            files = [name for name in sorted(changed) if name.startswith(folder + "/") and "/test_" in name]
            if files and self.map_of(room).exists():
                renew(self.checkout, room, self.map_of(room), files)
        pending.unlink()
        for number, mutation in enumerate(chosen, 1):
            if place_of(mutation) in survived:
                show(number, self._tried(mutation, self.folder / "retried.jsonl", confirmed=True), self.words)

    def _tried(self, mutation: Mutation, log: Path, *, confirmed: bool) -> Result:
        """Try a mutant and keep its result, if there is one."""
        room = room_of(mutation.file)
        found = coverage_map(self.checkout, room, self.map_of(room))
        result = try_mutant(mutation, self.checkout, found, confirmed=confirmed)
        if result.verdict != "undecided":
            with log.open("a") as file:
                file.write(json.dumps(asdict(result)) + "\n")
        return result

    def noticed(self, results: Sequence[Result]) -> list[Result] | None:
        """Return the survivors that were killed when they were tried again; None where none was tried again."""
        log = self.folder / "retried.jsonl"
        if not log.exists():
            return None
        killed = {place for place, result in read_results(log).items() if result.verdict == "killed"}
        return [each for each in results if each.verdict == "survived" and place_of(each) in killed]


def main() -> None:
    """Try every mutant of the sample that has no result yet; with `--retry`, the survivors again."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--count", type=int, default=200)
    parser.add_argument("--only", default="", help="a folder, for instance drivers/can")
    parser.add_argument("--retry", action="store_true", help="try the survivors again, with the tests of today")
    given = parser.parse_args()
    folder = ROOT / "build" / "mutants" / f"seed-{given.seed}"
    lock = alone_in(folder)
    trials = Trials(folder, copy_of(ROOT, folder / "copy"), read_words())
    chosen = drawn(trials.checkout.root, given.count, given.seed, given.only)
    results = trials.first(chosen, shown=not given.retry)
    if given.retry:
        noticed = trials.noticed(results) or []
        trials.again(chosen, {place_of(each) for each in results if each.verdict == "survived" and each not in noticed})
    decided = [result for result in results if result.verdict != "undecided"]
    figures = score(decided, given.seed, trials.words, trials.noticed(decided))
    write_figures(figures, ROOT / "build" / "figures" / "mutants.json")
    if not given.only and len(decided) >= SMALLEST:
        write_page(figures, FAST_S, PAGE)
    print(line_of(figures))
    lock.close()


if __name__ == "__main__":
    main()
