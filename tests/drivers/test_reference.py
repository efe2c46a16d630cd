"""The generated document of the bus."""

from __future__ import annotations

from pathlib import Path

from regolithd.drivers import reference


def test_the_bus_document_is_up_to_date() -> None:
    """The file `docs/reference/bus.md` equals the output of `python -m regolithd.drivers.reference`."""
    written = Path(__file__).parents[2] / "docs" / "reference" / "bus.md"
    assert written.read_text() == reference.document()
