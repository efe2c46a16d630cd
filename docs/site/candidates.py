"""MkDocs hook: puts every candidate of the mismatch tool where a page says `<!-- candidates -->`."""

from __future__ import annotations

from typing import TYPE_CHECKING

from regolithd.calibration.mismatch.candidates.library import library
from regolithd.calibration.mismatch.problem.words import in_units, in_words

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence

    from regolithd.calibration.mismatch.candidates.candidate import Candidate, Sharing

MARK = "<!-- candidates -->"
WHEELS: dict[Sharing, str] = {"all": "all alike", "one": "one alone"}


def on_page_markdown(markdown: str, **_: object) -> str:
    """Replace the mark by a section for each candidate."""
    return markdown.replace(MARK, "\n".join(_sections(library()))) if MARK in markdown else markdown


def _sections(candidates: Sequence[Candidate]) -> Iterator[str]:
    for candidate in candidates:
        yield f"## {candidate.label[:1].upper()}{candidate.label[1:]}\n"
        yield f"`{candidate.name}`: {candidate.words}.\n\n| | |\n|---|---|"
        yield "\n".join(f"| {name} | {_cell(text)} |" for name, text in _rows(candidate)) + "\n"


def _rows(candidate: Candidate) -> Iterator[tuple[str, str]]:
    yield "law", candidate.equation
    yield "depends on", f"`{candidate.covariate}`" if candidate.covariate != "none" else "nothing"
    yield "needs", ", ".join(f"`{name}`" for name in candidate.requires) or "nothing more"
    yield "wheels", " or ".join(WHEELS[each] for each in candidate.sharing)
    yield "parameters", ", ".join(_parameters(candidate))
    yield "in a residual", candidate.signature
    yield "experiment", in_words(candidate.experiment, {})
    yield "source", candidate.source


def _parameters(candidate: Candidate) -> Iterator[str]:
    for coefficient in candidate.coefficients:
        unit = in_units(coefficient.unit, "channel's unit", {})
        yield f"`{coefficient.name}`" + (f" [{unit}]" if unit != "1" else "")
    yield from (f"`{name}`" for name in candidate.free)


def _cell(text: str) -> str:
    return text.replace("|", "\\|").replace("_", "\\_") if "`" not in text else text.replace("|", "\\|")
