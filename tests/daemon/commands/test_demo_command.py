"""What the demo's command prints and hands on, without driving."""

from __future__ import annotations

import importlib.util
import io
from contextlib import contextmanager
from types import SimpleNamespace
from typing import TYPE_CHECKING, Any

import pytest
import typer
from rich.console import Console
from typer.testing import CliRunner

from regolithd.daemon.cli import app
from regolithd.daemon.commands import demo

if TYPE_CHECKING:
    from collections.abc import Iterator
    from pathlib import Path

PART = "regolithd.daemon.demo"


def record(time_ns: int) -> Any:
    """Return an estimate of that instant, and the truth."""
    return SimpleNamespace(snapshot=SimpleNamespace(time_ns=time_ns)), SimpleNamespace()


def done(folder: Path, *times_ns: int, live_from_ns: int = 0) -> Any:
    """Return a run with estimates at these times."""
    return SimpleNamespace(
        ground_truth=SimpleNamespace(records=[record(time_ns) for time_ns in times_ns]),
        live_from_ns=live_from_ns,
        recording=folder / "drive.mcap",
        log=folder / "drive.log",
    )


def console(*, terminal: bool = False) -> Console:
    """Return a wide console that keeps what is printed."""
    return Console(file=io.StringIO(), force_terminal=terminal, width=200, color_system=None)


def text_of(shown: Console) -> str:
    """Return what was printed."""
    assert isinstance(shown.file, io.StringIO)
    return shown.file.getvalue()


@pytest.mark.parametrize(
    ("options", "paper", "compared"), [([], False, True), (["--paper", "--no-compare"], True, False)]
)
def test_options_are_handed_on(
    options: list[str], paper: bool, compared: bool, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The folder is made, the screen lasts as long as the drive, and the comparison may be left out."""
    told: list[Any] = []

    @contextmanager
    def screen(_: Console, seconds: float, *, paper: bool) -> Iterator[str]:
        told.append(("screen", seconds, paper))
        yield "show"

    async def run_demo(out: Path, seconds: float, show: str) -> str:
        told.append(("run", out, seconds, show))
        return "done"

    monkeypatch.setattr(f"{PART}.screen.screen", screen)
    monkeypatch.setattr(f"{PART}.run.run_demo", run_demo)
    monkeypatch.setattr(demo, "_results", lambda _, run, out, paper: told.append(("results", run, out, paper)))
    monkeypatch.setattr(demo, "_compare", lambda _, run, out: told.append(("compare", run, out)))
    out = tmp_path / "some" / "folder"
    ended = CliRunner().invoke(app, ["demo", "--seconds", "7", "--out", str(out), *options])
    assert ended.exit_code == 0, ended.output
    assert out.is_dir()
    expected = [("screen", 7.0, paper), ("run", out, 7.0, "show"), ("results", "done", out, paper)]
    assert told == expected + ([("compare", "done", out)] if compared else [])


def test_packages_that_are_absent_are_named(monkeypatch: pytest.MonkeyPatch) -> None:
    """With the command that installs them; nothing is run."""
    found = importlib.util.find_spec
    monkeypatch.setattr(importlib.util, "find_spec", lambda name: None if name in {"amqtt", "scipy"} else found(name))
    ended = CliRunner().invoke(app, ["demo"])
    assert (ended.exit_code, ended.stdout) == (1, "")
    assert "the demo needs amqtt and scipy: pip install 'regolithd[demo]'" in ended.stderr


@pytest.mark.parametrize("paper", [False, True])
def test_the_picture_is_of_the_live_drive(paper: bool, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """What was computed before is in the posterior's table alone; the paper's network has a table if it is wanted."""
    told: list[Any] = []
    lines = ["rear axle on the weak soil from 30 s", "alarm at 22 s"]
    monkeypatch.setattr(f"{PART}.crossings.crossings", lambda *_: SimpleNamespace(lines=lines))
    monkeypatch.setattr(f"{PART}.ground_truth_log.posteriors_on_soils", lambda records: ("posteriors", len(records)))
    monkeypatch.setattr(f"{PART}.ground_truth_log.wheels_on_soils", lambda live, settle_s: (len(live), settle_s))
    monkeypatch.setattr(f"{PART}.result_tables.posterior_table", lambda found: f"table of {found}")
    monkeypatch.setattr(f"{PART}.result_tables.wheel_table", lambda found: f"wheels of {found}")
    monkeypatch.setattr(f"{PART}.picture.draw", lambda live, path, *, paper: told.append((live, path, paper)))
    run, shown = done(tmp_path, 8, 9, 10, 11, live_from_ns=10), console()
    demo._results(shown, run, tmp_path, paper=paper)
    ((live, path, drawn),) = told
    assert [each[0].snapshot.time_ns for each in live] == [10, 11]
    assert (path, drawn) == (tmp_path / "drive.png", paper)
    printed = text_of(shown)
    assert "table of ('posteriors', 4)" in printed
    assert ("wheels of (2, 4.0)" in printed) == paper
    assert all(line in printed for line in lines)
    for name, file in (("recording", "drive.mcap"), ("frames", "drive.log"), ("picture", "drive.png")):
        assert f"{name:10} {tmp_path / file}" in printed


@pytest.mark.parametrize(
    ("terminal", "variable", "launched"),
    [(True, "DISPLAY", True), (True, "WAYLAND_DISPLAY", True), (True, "OTHER", False), (False, "DISPLAY", False)],
)
def test_the_report_is_opened_where_there_is_a_screen(
    terminal: bool, variable: str, launched: bool, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """On a terminal, with a display of either kind; its path is printed in any case."""
    opened: list[str] = []
    for name in ("DISPLAY", "WAYLAND_DISPLAY"):
        monkeypatch.delenv(name, raising=False)
    monkeypatch.setenv(variable, ":0")
    monkeypatch.setattr(typer, "launch", opened.append)
    monkeypatch.setattr(f"{PART}.comparison.compare", lambda recording, _: recording.with_suffix(".html"))
    shown = console(terminal=terminal)
    demo._compare(shown, done(tmp_path), tmp_path)
    assert opened == ([str(tmp_path / "drive.html")] if launched else [])
    assert f"report     {tmp_path / 'drive.html'}" in text_of(shown)


def test_a_recording_that_cannot_be_compared_ends_with_1(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """The reason is on standard error."""

    def fails(*_: object) -> Path:
        raise OSError("no space left")

    monkeypatch.setattr(f"{PART}.comparison.compare", fails)
    with pytest.raises(typer.Exit) as ended:
        demo._compare(console(), done(tmp_path), tmp_path)
    assert ended.value.exit_code == 1
    assert capsys.readouterr().err == "no space left\n"
