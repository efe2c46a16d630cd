"""What a command says before it ends with an error goes to standard error, so that its output can be piped."""

from __future__ import annotations

import ast
import socket
import subprocess
import sys
from pathlib import Path
from typing import TYPE_CHECKING

import pytest
import typer
from typer.testing import CliRunner

from regolithd.daemon.cli import app

if TYPE_CHECKING:
    from collections.abc import Iterator

COMMANDS = Path(__file__).resolve().parents[3] / "daemon" / "commands"


def failing_blocks(tree: ast.Module) -> Iterator[list[ast.stmt]]:
    """Yield each run of statements that ends by `raise typer.Exit(status)` with a status that is not 0."""
    for node in ast.walk(tree):
        for block in (getattr(node, name, None) for name in ("body", "orelse", "finalbody")):
            for place, each in enumerate(block if isinstance(block, list) else ()):
                if isinstance(each, ast.Raise) and isinstance(each.exc, ast.Call):
                    status = ast.unparse(each.exc.args[0]) if each.exc.args else "0"
                    if ast.unparse(each.exc.func) == "typer.Exit" and status != "0":
                        yield block[:place]  # type: ignore[index]


def echoes(block: list[ast.stmt]) -> list[ast.Call]:
    """Return the calls of `typer.echo` among statements."""
    calls = [each.value for each in block if isinstance(each, ast.Expr) and isinstance(each.value, ast.Call)]
    return [call for call in calls if ast.unparse(call.func) == "typer.echo"]


def test_an_error_is_said_on_standard_error() -> None:
    """Every `typer.echo` right before a status that is not 0 has `err=True`, and there are some."""
    found = {
        f"{path.name}:{call.lineno}": {each.arg: ast.unparse(each.value) for each in call.keywords}.get("err")
        for path in sorted(COMMANDS.glob("*.py"))
        for block in failing_blocks(ast.parse(path.read_text(encoding="utf-8")))
        for call in echoes(block)
    }
    assert len(found) > 10
    assert {place for place, err in found.items() if err != "True"} == set()


@pytest.fixture
def ground(tmp_path: Path) -> Path:
    """A ground.toml that names a file of users."""
    path = tmp_path / "ground.toml"
    path.write_text(f'[page]\nusers = "{tmp_path / "users"}"\n')
    return path


def test_a_password_is_asked_twice_and_not_shown(ground: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """A typing error would lock the user out."""
    asked: list[tuple[str, dict[str, object]]] = []

    def prompt(text: str, **options: object) -> str:
        asked.append((text, options))
        return "correct horse battery staple"

    monkeypatch.setattr(typer, "prompt", prompt)
    done = CliRunner().invoke(app, ["ground", "--config", str(ground), "--add-user", "anna"])
    assert (done.exit_code, asked) == (
        0,
        [("Password of anna", {"hide_input": True, "confirmation_prompt": True})],
    ), done.output
    assert "anna can log in" in done.stdout
    assert "anna" in (ground.parent / "users").read_text()


def test_a_store_that_cannot_be_used_is_one_message(tmp_path: Path) -> None:
    """The status is 1, and there is no traceback."""
    (tmp_path / "ground.sqlite").write_text("no database, but a text of more than a hundred bytes. " * 5)
    with socket.socket() as free:
        free.bind(("127.0.0.1", 0))
        port = free.getsockname()[1]
    config = tmp_path / "ground.toml"
    config.write_text(f'[page]\nport = {port}\n[store]\ndirectory = "{tmp_path}"\n')
    line = [sys.executable, "-m", "regolithd", "ground", "--config", str(config)]
    done = subprocess.run(line, capture_output=True, text=True, check=False, timeout=60)
    assert done.returncode == 1
    assert "ground.sqlite: file is not a database. Set [store] directory" in done.stderr
    assert "Traceback" not in done.stderr


def test_a_user_needs_a_file_and_a_broker_a_host(tmp_path: Path) -> None:
    """The status is that of a wrong configuration, 78, and the message is on standard error."""
    (tmp_path / "ground.toml").write_text("[page]\n")
    for arguments, told in (
        (["--add-user", "anna", "--config", str(tmp_path / "ground.toml")], "name a file in [page] users"),
        (["--broker", "host:port"], "--broker host:port: not HOST or HOST:PORT"),
        (["--config", str(tmp_path / "absent.toml")], "absent.toml"),
    ):
        done = CliRunner().invoke(app, ["ground", *arguments])
        assert (done.exit_code, done.stdout) == (78, "")
        assert told in done.stderr


@pytest.mark.parametrize(("arguments", "code"), [(["--version"], 0), (["no-such-command"], 2)])
def test_a_library_that_aborts_at_exit_leaves_the_exit_code_and_the_output(arguments: list[str], code: int) -> None:
    """The exit code is the command's where a function that C runs at exit aborts, and what was printed is there."""
    script = (
        "import atexit, ctypes, sys\n"
        "from regolithd.daemon import cli\n"
        "c = ctypes.CDLL(None)\n"
        "c.__cxa_atexit(c.abort, None, None)\n"
        "real = cli.app\n"
        "cli.app = lambda: (atexit.register(print, 'registered by the command'), real())\n"
        "cli.main()\n"
    )
    done = subprocess.run([sys.executable, "-c", script, *arguments], capture_output=True, text=True, check=False)
    assert done.returncode == code
    assert "registered by the command" in done.stdout
    assert ("regolithd" in done.stdout) == (code == 0)
