"""Recordings are read with a bar on a terminal alone, and on standard error, so that output can be piped."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import pytest

from regolithd.daemon.recording import progress

if TYPE_CHECKING:
    from pathlib import Path


@pytest.fixture
def given(monkeypatch: pytest.MonkeyPatch) -> dict[str, Any]:
    """Return the options with which rich opens the next file."""
    options: dict[str, Any] = {}
    original = progress.open_with_bar

    def opened(path: Path, mode: str, **more: Any) -> Any:
        options.update(more)
        return original(path, mode, **more)  # type: ignore[call-overload]

    monkeypatch.setattr(progress, "open_with_bar", opened)
    return options


@pytest.mark.parametrize("terminal", [True, False])
def test_a_bar_is_shown_on_a_terminal_alone(
    terminal: bool, given: dict[str, Any], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """With the file's name, on standard error; it goes when the file is read."""
    monkeypatch.setenv("FORCE_COLOR" if terminal else "NO_COLOR", "1")
    if not terminal:
        monkeypatch.delenv("FORCE_COLOR", raising=False)
    path = tmp_path / "drive.log"
    path.write_bytes(b"(1.5) can0 181#00\xff\n")
    with progress.open_text(path) as text:
        assert text.read() == "(1.5) can0 181#00\ufffd\n"
    for opening in (progress.open_text, progress.open_binary):
        given.clear()
        with opening(path):
            assert given["disable"] is not terminal
            assert (given["description"], given["transient"], given["console"].stderr) == ("drive.log", True, True)
    with progress.open_binary(path) as content:
        assert content.read() == path.read_bytes()
