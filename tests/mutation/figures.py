"""Score of a sample, and the page of the documentation that shows it: docs/explanation/mutation-testing.md."""

from __future__ import annotations

import json
import re
import tomllib
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from mutants import ROOMS

if TYPE_CHECKING:
    from collections.abc import Collection, Mapping, Sequence

    from trial import Result

SURVIVORS = Path(__file__).with_name("survivors.toml")
PAGE = """# Mutation testing

Do the tests notice when the code is wrong? `make mutants` changes random places of `drivers/`, `daemon/` and
`calibration/mismatch/`, one at a time, by the operators of [Cosmic Ray](https://github.com/sixty-north/cosmic-ray):
another comparison, another operator, another number, a `not` added, a decorator removed. It runs those fast tests of
the same room that execute the changed line (at most {fast_s:g} s of CPU time each), and counts the changes after which
a test fails.

Then tests are written for the survivors, and `make mutants SEED=… RETRY=1` tries each survivor again, in the same copy
of the code with the tests of today. The first number is an estimate for all of the code, because the places are random;
the second one is not: it says what was done about the places that were drawn. (Up to seed 31415927 it counts the tests
that were named for survivors, without a second trial.)

{line}

| room | mutants | killed | with the tests that were added |
|---|---|---|---|
{rows}
{earlier}
The mutation score leaves equal programs out, which no test can kill (DeMillo, Lipton and Sayward, 1978).

Limits are of CPU time, and a test of the daemon or the drivers that fails is repeated alone, so that a busy machine
kills no mutant. Left out are annotations, which do not run, and the values of constants, fields and parameters named
`timeout_s` or `…_timeout_s`, because no requirement fixes a time limit to a second.

Each survivor of a sample has a word in `tests/mutation/survivors.toml`: `equal`, where the changed program does the
same, or the test that was added and notices it now. An interrupted run continues; another seed draws another sample.
"""


@dataclass(frozen=True)
class Words:
    """What is said of known survivors, by file and diff: `equal: …` or `test: …`."""

    of: Mapping[tuple[str, str], str]

    def word(self, result: Result) -> str:
        """Return the word for a survivor; empty where there is none."""
        return self.of.get((result.file, result.diff.strip()), "")


def read_words() -> Words:
    """Return the words of `survivors.toml`."""
    listed: list[dict[str, Any]] = tomllib.loads(SURVIVORS.read_text()).get("survivor", [])
    return Words({(each["file"], each["diff"].strip()): each["word"] for each in listed})


def score(
    results: Sequence[Result], seed: int, words: Words, noticed: Collection[Result] | None = None
) -> dict[str, Any]:
    """Return the figures of a sample; `noticed` are the survivors that were killed when they were tried again.

    None where they were not tried again: then the words count.
    """
    survivors = [each for each in results if each.verdict == "survived"]
    if noticed is None:
        noticed = [each for each in survivors if words.word(each).startswith("test")]
    rooms = {room: [each for each in results if each.file.startswith(room + "/")] for room in ROOMS}
    return {
        "seed": seed,
        "mutants": len(results),
        "killed": len(results) - len(survivors),
        "share_killed": 1 - len(survivors) / max(len(results), 1),
        "equal": sum(words.word(each).startswith("equal") for each in survivors),
        "test_added": len(noticed),
        "rooms": {
            room: {
                "mutants": len(mine),
                "killed": sum(each.verdict == "killed" for each in mine),
                "since": sum(each.verdict == "killed" or each in noticed for each in mine),
            }
            for room, mine in rooms.items()
        },
    }


def line_of(figures: Mapping[str, Any]) -> str:
    """Return the figures as one line."""
    mutants, since = max(figures["mutants"], 1), figures["killed"] + figures["test_added"]
    mutation_score = figures["killed"] / max(figures["mutants"] - figures["equal"], 1)
    return (
        f"Seed {figures['seed']}: {figures['killed']} of {figures['mutants']} mutants killed "
        f"({100 * figures['share_killed']:.0f} %; mutation score {100 * mutation_score:.0f} %), {since} "
        f"({100 * since / mutants:.0f} %) with the tests that were added for survivors since; "
        f"{figures['equal']} are equal programs."
    )


def earlier_lines(page: str, seed: int) -> list[str]:
    """Return the lines of a page about samples of other seeds, the newest first."""
    lines = re.findall(r"^(?:- )?(Seed (\d+): .*)$", page, flags=re.MULTILINE)
    return [line for line, other in lines if int(other) != seed]


def write_page(figures: Mapping[str, Any], fast_s: float, path: Path) -> None:
    """Write the page of the documentation; what it says of other samples stays as a list."""
    before = earlier_lines(path.read_text(encoding="utf-8") if path.exists() else "", figures["seed"])
    earlier = "".join(f"- {line}\n" for line in before)
    if earlier:
        earlier = f"\nSamples before it, each of the code and the tests of its day:\n\n{earlier}"
    rows = "\n".join(
        f"| `{room}/` | {each['mutants']} | {each['killed']} | {each['since']} |"
        for room, each in figures["rooms"].items()
    )
    path.write_text(PAGE.format(line=line_of(figures), rows=rows, earlier=earlier, fast_s=fast_s), encoding="utf-8")


def write_figures(figures: Mapping[str, Any], path: Path) -> None:
    """Write the figures as JSON."""
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text(json.dumps(figures, indent=1) + "\n")
