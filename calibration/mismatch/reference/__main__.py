"""Writes the tables of `docs/reference/effects.md` and `answer.md`; the folder is the only argument."""

from __future__ import annotations

import sys
from pathlib import Path

from regolithd.calibration.mismatch.reference.pages import PAGES, with_tables


def main() -> None:
    """Write the tables of all pages."""
    folder = Path(sys.argv[1])
    for name in PAGES:
        path = folder / name
        path.write_text(with_tables(name, path.read_text(encoding="utf-8")), encoding="utf-8")


if __name__ == "__main__":
    main()
