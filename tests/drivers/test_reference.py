"""The generated document of the bus."""

from __future__ import annotations

from pathlib import Path

from regolithd.drivers import reference


def test_the_document_of_the_bus_is_what_the_code_does() -> None:
    """`docs/bus.md` is written by `python -m regolithd.drivers.reference`; write it anew where this fails."""
    written = Path(__file__).parents[2] / "docs" / "bus.md"
    assert written.read_text() == reference.document()
