"""Writes docs/reference/figures.md from the measurements in build/figures: `make figures`.

Each measurement writes one flat JSON object, `build/figures/NAME.json`: figure → number, text or truth value. A key
`ROW / COLUMN` is a cell of a table; any other key is a line of the list above it. `command` and `measured` (where and
when it ran) stand under the heading. A section whose file is not there is left on the page as it was.

    {"command": "make bench", "measured": "2026-11-22, two cores", "frames_per_s": 9009,
     "import / regolithd": 0.31, "import / python-can": 0.22}
"""

from __future__ import annotations

import argparse
import json
import re
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

ROOT = Path(__file__).resolve().parents[2]
FIGURES, PAGE = ROOT / "build/figures", ROOT / "docs/reference/figures.md"
HEADING = (
    "# Figures of robustness, speed and security\n\n<!-- Written by `make figures` from build/figures/*.json. -->\n"
)
CELL = " / "
HEAD_KEYS = ("command", "measured")

Value = str | float | bool | None


@dataclass(frozen=True)
class Section:
    """A measurement: name of its file, heading, and what it measures, in one paragraph."""

    name: str
    title: str
    text: str


SECTIONS = (
    Section(
        "chaos",
        "Faults in random order",
        "A daemon on SocketCAN with a real broker, recording and publishing, meets faults in an order that a seed "
        "draws. Everything is judged from outside: what a subscriber received, what the recording holds, "
        "what the drives did.",
    ),
    Section(
        "holds",
        "Kills, damaged files, babbling nodes",
        "The store killed by SIGKILL at random points, single flipped bits in every file that the daemon reads, nodes "
        "that send without a pause, and a replay compared with what was published.",
    ),
    Section("fuzz", "Damaged input", "Random damage to everything that the program reads from others."),
    Section(
        "bench",
        "Speed",
        "Each figure beside its goal and the same of another program, in one run. [How it is measured, and what "
        "limits it](speed.md).",
    ),
    Section("audit", "Dependencies", "Packages that an installation has, their licences and known vulnerabilities."),
)


def main() -> None:
    """Rewrite the sections whose figures are there."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--figures", type=Path, default=FIGURES, help="folder of the JSON files")
    parser.add_argument("--page", type=Path, default=PAGE)
    chosen = parser.parse_args()
    before = chosen.page.read_text(encoding="utf-8") if chosen.page.exists() else ""
    chosen.page.write_text(page(before, read_figures(chosen.figures)), encoding="utf-8")


def read_figures(folder: Path) -> dict[str, dict[str, Value]]:
    """Return the figures of each measurement whose file is there.

    Raises
    ------
    SystemExit
        A file is not one flat JSON object.
    """
    found = {}
    for section in SECTIONS:
        path = folder / f"{section.name}.json"
        if path.exists():
            figures = json.loads(path.read_text(encoding="utf-8"))
            if not isinstance(figures, dict) or any(isinstance(value, dict | list) for value in figures.values()):
                raise SystemExit(f"{path}: not one flat JSON object. Write each figure as a key of its own.")
            found[section.name] = figures
    return found


def page(before: str, figures: Mapping[str, Mapping[str, Value]]) -> str:
    """Return the page: new sections where there are figures, otherwise those that it had before."""
    old = sections_of(before)
    kept = (
        section_text(each, figures[each.name]) if each.name in figures else old.get(each.title, "") for each in SECTIONS
    )
    return "\n".join([HEADING, *filter(None, kept)])


def sections_of(text: str) -> dict[str, str]:
    """Return the sections of a page, by heading."""
    parts = re.split(r"^## (.+)\n", text, flags=re.MULTILINE)
    return {title: f"## {title}\n{body.rstrip()}\n" for title, body in zip(parts[1::2], parts[2::2], strict=True)}


def section_text(section: Section, figures: Mapping[str, Value]) -> str:
    """Return the section of one measurement."""
    plain = {key: value for key, value in figures.items() if CELL not in key and key not in HEAD_KEYS}
    cells = {tuple(key.split(CELL, 1)): value for key, value in figures.items() if CELL in key}
    parts = [f"## {section.title}\n", section.text + "\n", head(figures)]
    if plain:
        parts.append(table(("figure", "value"), [(name, shown(value)) for name, value in plain.items()]))
    if cells:
        columns = list(dict.fromkeys(column for _, column in cells))
        rows = list(dict.fromkeys(row for row, _ in cells))
        lines = [(row, *(shown(cells.get((row, column), "")) for column in columns)) for row in rows]
        parts.append(table(("", *columns), lines))
    return "\n".join(filter(None, parts))


def head(figures: Mapping[str, Value]) -> str:
    """Return the line that says which command measured, and where and when."""
    command, measured = (figures.get(key) for key in HEAD_KEYS)
    said = [f"`{command}`" if command else "", str(measured) if measured else ""]
    return ": ".join(filter(None, said)) + ".\n" if any(said) else ""


def table(header: Sequence[str], rows: Sequence[Sequence[str]]) -> str:
    """Return a Markdown table."""
    lines = [header, ["---"] * len(header), *rows]
    return "".join("| " + " | ".join(cell.replace("|", r"\|") for cell in line) + " |\n" for line in lines)


def shown(value: Value) -> str:
    """Return a value as a reader wants it: at most four significant digits."""
    match value:
        case None:
            return "–"
        case bool():
            return "yes" if value else "no"
        case float():
            return str(round(value)) if abs(value) >= 1000 else f"{value:.4g}"
        case _:
            return str(value)


if __name__ == "__main__":
    main()
