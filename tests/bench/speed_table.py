"""The rows of `speed`: a figure of ours, its goal, and the same figure of another program in the same run."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from collections.abc import Iterable

Value = float | int | str | None
Figures = dict[str, Value]


@dataclass(frozen=True, slots=True)
class Row:
    """One figure; `theirs` is that of `peer`, or `peer` says why there is none."""

    figure: str
    ours: float | None
    goal: str = ""
    theirs: float | None = None
    peer: str = ""


def flat(rows: Iterable[Row]) -> Figures:
    """Return the rows as `figures_page` reads them; what a row does not have is left out."""
    found: Figures = {}
    for row in rows:
        cells = {"regolithd": row.ours, "goal": row.goal, "peer": row.theirs, "the peer is": row.peer}
        found |= {f"{row.figure} / {name}": value for name, value in cells.items() if value not in {None, ""}}
    return found
