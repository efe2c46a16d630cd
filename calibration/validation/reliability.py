"""How often answers are right, against the probability that they state: `make reliability`.

    python -m regolithd.calibration.validation.reliability FIGURES.json PICTURE.svg BATCH [BATCH …]

A batch is a folder of `regolithd prove` or of `make prove-machines` with its answers and opened truths. An answer is
right when its set of names is: none where nothing or only a stated parameter was wrong, `unexplained` without a name
where what acts has no name. Recordings at one constant speed are left out: several sets of names are right for them.
"""

from __future__ import annotations

import json
import sys
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
from rich.console import Console
from rich.table import Table
from scipy.stats import binom

from regolithd.calibration.mismatch.report.axes import Panel, axes, box, line, svg, text

EDGES = (0.0, 0.5, 0.7, 0.8, 0.9, 0.95, 1.0)
STYLE = """<style>text{font:12px sans-serif;fill:#5c6570}.ground{fill:#f5f6f8}.axis{stroke:#d9dde2;fill:none}
.after{fill:none;stroke:#23679b;stroke-width:1.6}.dot{fill:#23679b}
.expected{stroke:#b9c1cb;stroke-width:4;fill:none}.zero{stroke:#b5482a;stroke-dasharray:3 3;fill:none}
.paper{fill:#fff}</style><rect class="paper" width="420" height="352"/>"""

Truth = dict[str, Any]
Answer = dict[str, Any]

NINETEEN_IN_TWENTY = 0.95


@dataclass(frozen=True)
class Stated:
    """One answer: the probability that it states, and whether its names are right."""

    probability: float
    right: bool


@dataclass(frozen=True)
class Bin:
    """Answers with probabilities in a range: how many, their mean probability, and the share that is right."""

    low: float
    high: float
    count: int
    stated: float
    right: float

    @property
    def standard_error(self) -> float:
        """Of the share, if the stated probability is true (binomial)."""
        return float(np.sqrt(self.stated * (1 - self.stated) / self.count))

    @property
    def expected(self) -> tuple[float, float]:
        """Bounds of the share 19 times in 20, if the stated probability is true (binomial)."""
        low, high = binom.interval(NINETEEN_IN_TWENTY, self.count, self.stated)
        return float(low) / self.count, float(high) / self.count


def wanted(truth: Truth) -> set[str]:
    """Return the names that are right, of a rover's or another machine's trial."""
    named = {effect["name"] for effect in truth["effects"] if effect.get("name")}
    if truth.get("change") is not None and truth.get("corrected"):
        named |= {effect["name"] for effect in truth["corrected"]}
    return named


def outside(truth: Truth) -> bool:
    """Return whether what was concealed has no name in the library."""
    if "group" in truth:
        return bool(truth["group"] == "outside")
    return any(effect["name"] is None for effect in truth["effects"])


def is_right(truth: Truth, answer: Answer) -> bool:
    """Return whether the answer's set of names is the concealed one."""
    told = {effect["name"] for effect in (*answer["effects"], *answer["changes"])}
    if outside(truth):
        return bool(answer["verdict"] == "unexplained") and not told
    return told == wanted(truth) and answer["verdict"] != "unexplained"


def answers_of(batch: Path) -> list[Stated]:
    """Return what the answers of a batch state, and whether they are right."""
    found = []
    for opened in sorted((batch / "opened").glob("*.json")):
        truth = json.loads(opened.read_text())["truth"]
        told = json.loads((batch / "answers" / opened.name).read_text())
        answer = told["answers"][0] if "answers" in told else told["answer"]
        if truth.get("group") != "constant" and answer.get("probability") is not None:
            found.append(Stated(answer["probability"], is_right(truth, answer)))
    return found


def bins(answers: list[Stated]) -> list[Bin]:
    """Return the ranges of probability that have answers."""
    found = []
    for low, high in pairwise(EDGES):
        inside = [each for each in answers if low <= each.probability < high or each.probability == high == 1.0]
        if inside:
            stated = float(np.mean([each.probability for each in inside]))
            found.append(Bin(low, high, len(inside), stated, float(np.mean([each.right for each in inside]))))
    return found


def picture(found: list[Bin]) -> str:
    """Return the reliability diagram as SVG: the share that is right against the stated probability.

    Bars show where that share lies 19 times in 20 if what is stated is true: few answers say little.
    """
    panel = Panel(left=80, top=20, width=310, height=240, x=(0.0, 1.0), y=(0.0, 1.0))
    dots = [
        f'<circle class="dot" cx="{panel.at_x(each.stated):.1f}" cy="{panel.at_y(each.right):.1f}" '
        f'r="{2 + np.sqrt(each.count) / 2:.1f}"/>'
        for each in found
    ]
    diagonal = [(panel.at_x(at), panel.at_y(at)) for at in (0.0, 1.0)]
    bars = [line([(panel.at_x(each.stated), panel.at_y(end)) for end in each.expected], "expected") for each in found]
    parts = [STYLE, box(panel), axes(panel, "stated probability", "share of answers that are right"), *bars, *dots]
    parts.append(line(diagonal, "zero"))
    legend = (
        "dashed: stated = right; area: number of answers",
        "bars: 19 shares of 20, if what is stated is true",
    )
    parts += [text(panel.left, 322 + 16 * k, words) for k, words in enumerate(legend)]
    return svg(420, 352, parts, "Share of right answers against the stated probability")


def figures_of(answers: list[Stated], found: list[Bin]) -> dict[str, float]:
    """Return the figures as one flat object."""
    sure = [each for each in answers if each.probability >= 0.9]
    figures: dict[str, float] = {"answers": len(answers), "sure": len(sure)}
    figures["right_of_sure"] = float(np.mean([each.right for each in sure])) if sure else 0.0
    figures["right"] = float(np.mean([each.right for each in answers])) if answers else 0.0
    for each in found:
        figures |= {f"{each.low:g}_{each.high:g}_{key}": getattr(each, key) for key in ("count", "stated", "right")}
    return figures


def main(figures: str, image: str, *batches: str) -> None:
    """Print the table, and write the figures and the picture."""
    answers = [each for batch in batches for each in answers_of(Path(batch))]
    found = bins(answers)
    table = Table("stated probability", "answers", "mean stated", "right", "± if stated is true")
    for each in found:
        table.add_row(
            f"{each.low:g} to {each.high:g}",
            str(each.count),
            f"{each.stated:.3f}",
            f"{each.right:.3f}",
            f"{each.standard_error:.3f}",
        )
    Console().print(table)
    Path(figures).parent.mkdir(parents=True, exist_ok=True)
    Path(figures).write_text(json.dumps(figures_of(answers, found), indent=1) + "\n")
    Path(image).write_text(picture(found))


if __name__ == "__main__":
    main(*sys.argv[1:])
