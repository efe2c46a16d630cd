"""Mutation testing on a random sample: `make mutants`, or `python tests/mutation/sample.py --seed 1 --count 200`.

Works in a copy of the checkout in `build/mutants/seed-N`, and continues there: the copy, what each fast test executes,
and the result of each mutant are kept, so that the checkout may change meanwhile. Remove the folder to begin anew.

Prints each survivor as a diff, with what `survivors.toml` says of it; writes `build/figures/mutants.json` and, for a
sample of all rooms, `docs/explanation/mutation-testing.md`.
"""

from __future__ import annotations

import argparse
import fcntl
import json
from dataclasses import asdict
from pathlib import Path
from typing import IO, TYPE_CHECKING

from checkout import copy_of
from coverage_map import coverage_map
from fast_tests import FAST_S
from figures import line_of, read_words, score, write_figures, write_page
from mutants import Mutation, room_of, sample
from trial import Result, try_mutant

if TYPE_CHECKING:
    from figures import Words

ROOT = Path(__file__).resolve().parents[2]
PAGE = ROOT / "docs" / "explanation" / "mutation-testing.md"
SMALLEST = 50
"""Mutants of a sample that the documentation shows."""


def read_results(path: Path) -> dict[tuple[str, int, int, str], Result]:
    """Return the results so far, by file, line, column and operator."""
    rows = [Result(**json.loads(line)) for line in path.read_text().splitlines()] if path.exists() else []
    return {(row.file, row.line, row.column, row.operator): row for row in rows}


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


def main() -> None:
    """Try every mutant of the sample that has no result yet."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--count", type=int, default=200)
    parser.add_argument("--only", default="", help="a folder, for instance drivers/can")
    given = parser.parse_args()
    folder = ROOT / "build" / "mutants" / f"seed-{given.seed}"
    lock = alone_in(folder)
    checkout, words = copy_of(ROOT, folder / "copy"), read_words()
    chosen, log = drawn(checkout.root, given.count, given.seed, given.only), folder / "results.jsonl"
    known, results = read_results(log), []
    for number, mutation in enumerate(chosen, 1):
        result = known.get((mutation.file, mutation.line, mutation.column, mutation.operator))
        if result is None:
            room = room_of(mutation.file)
            found = coverage_map(checkout, room, folder / f"{room.replace('/', '-')}.json")
            result = try_mutant(mutation, checkout, found)
            if result.verdict != "undecided":
                with log.open("a") as file:
                    file.write(json.dumps(asdict(result)) + "\n")
        show(number, result, words)
        results.append(result)
    decided = [result for result in results if result.verdict != "undecided"]
    figures = score(decided, given.seed, words)
    write_figures(figures, ROOT / "build" / "figures" / "mutants.json")
    if not given.only and len(decided) >= SMALLEST:
        write_page(figures, FAST_S, PAGE)
    print(line_of(figures))
    lock.close()


if __name__ == "__main__":
    main()
