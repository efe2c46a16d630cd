"""Text in square brackets is printed as it is: the tables of rover.toml are written so in help texts and remedies."""

from __future__ import annotations

import ast
import io
import re
from pathlib import Path
from typing import TYPE_CHECKING, Any

import typer.core
from rich.console import Console
from typer.testing import CliRunner

import regolithd.daemon
from regolithd.daemon.cli import app
from regolithd.daemon.commands import status as status_command
from regolithd.daemon.control.protocol import NodeLine, Status
from regolithd.daemon.recording import progress
from regolithd.daemon.terminal import terminal

if TYPE_CHECKING:
    from collections.abc import Iterator

    import pytest

BRACKETS = re.compile(r"\[[^\]\n]*\]")
DAEMON = Path(regolithd.daemon.__path__[0])


def commands(group: Any, path: tuple[str, ...] = ()) -> Iterator[tuple[tuple[str, ...], Any]]:
    """Yield every group and command, and the words that call it."""
    yield path, group
    for name, each in getattr(group, "commands", {}).items():
        yield from commands(each, (*path, name))


def test_every_help_text_is_printed_whole() -> None:
    """Everything in square brackets of a command's text and of its options' is in what `--help` prints."""
    found = 0
    for path, command in commands(typer.main.get_command(app)):
        printed = CliRunner().invoke(app, [*path, "--help"], env={"COLUMNS": "400", "TERMINAL_WIDTH": "400"}).output
        texts = [command.help or "", *(getattr(each, "help", None) or "" for each in command.params)]
        for bracketed in BRACKETS.findall(" ".join(texts)):
            assert bracketed in printed, path
            found += 1
    assert found >= 5


def test_a_status_is_printed_whole(capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch) -> None:
    """The broker's problem and a node's text name the keys."""
    monkeypatch.setenv("COLUMNS", "200")
    node = NodeLine(node_id=3, kind="motor", wheel=1, phase="lost", drive_state=None, text="see [nodes] motors :x:")
    reply = Status(
        rover="kapvik",
        bus="active",
        broker="connection refused. Correct [mqtt] port.",
        nodes=(node,),
        snapshots=1,
        rate_Hz=2.0,
        traverse=None,
    )
    terminal().print(status_command._head(reply))
    terminal().print(status_command._table(reply))
    printed = capsys.readouterr().out
    assert "Correct [mqtt] port." in printed
    assert "see [nodes] motors :x:" in printed


def test_a_file_is_named_whole_while_it_is_read(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """A name may have square brackets."""
    path, screen = tmp_path / "drive[old].log", io.StringIO()
    path.write_text("line\n" * 1000)
    monkeypatch.setattr(
        progress, "terminal", lambda **_: Console(file=screen, force_terminal=True, width=100, color_system=None)
    )
    with progress.open_text(path) as lines:
        assert len(list(lines)) == 1000
    assert "drive[old].log" in re.sub(r"\x1b\[[0-9;?]*[A-Za-z]", "", screen.getvalue())


def test_no_command_makes_a_console_of_its_own() -> None:
    """`terminal` alone does, and the screenshot of the demo: another would take `[mqtt]` for markup."""
    made = {
        path.relative_to(DAEMON).as_posix()
        for path in DAEMON.rglob("*.py")
        for node in ast.walk(ast.parse(path.read_text(encoding="utf-8")))
        if isinstance(node, ast.Call) and ast.unparse(node.func).split(".")[-1] == "Console"
    }
    assert made == {"terminal.py", "demo/screenshot.py"}
