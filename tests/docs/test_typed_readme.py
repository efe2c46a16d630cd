"""The script that types the README's commands: it finds them, visits a page, and fails when one of them does."""

from __future__ import annotations

import signal
import subprocess
from pathlib import Path
from typing import TYPE_CHECKING

import pytest
import typed_readme

if TYPE_CHECKING:
    from collections.abc import Iterator

ROOT = Path(__file__).parents[2]
SERVER = "python3 -u -m http.server --bind 127.0.0.1 0"


def project(folder: Path, *lines: str) -> Path:
    """Return a repository whose README tells these commands."""
    folder.mkdir()
    (folder / "README.md").write_text("# regolithd\n\n```sh\n{}\n```\n".format("\n".join(lines)))
    for command in (
        ["init", "--quiet"],
        ["add", "."],
        ["-c", "user.name=a", "-c", "user.email=a@b", "commit", "-qm", "a"],
    ):
        subprocess.run(["git", *command], cwd=folder, check=True)
    return folder


def test_the_commands_of_this_readme_lead_to_demo_page_and_comparison() -> None:
    """Everything that needs no root is typed, in the README's order."""
    found = typed_readme.commands((ROOT / "README.md").read_text(encoding="utf-8"))
    programs = [line.split("  ")[0].split(" --")[0] for line in found]
    assert programs[0] == "make demo"
    assert [line for line in programs if line.endswith(("regolithd ground", "regolithd prove"))]
    assert programs[-1].startswith(".venv/bin/regolithd mismatch")
    assert not [line for line in found if line.startswith("sudo")]


@pytest.fixture
def ignored_interrupt() -> Iterator[None]:
    """Ctrl-C is ignored, as in a job that a shell started in the background."""
    before = signal.signal(signal.SIGINT, signal.SIG_IGN)
    yield
    signal.signal(signal.SIGINT, before)


@pytest.mark.timeout(120)
@pytest.mark.usefixtures("ignored_interrupt")
def test_commands_are_typed_in_a_clone_and_a_page_is_visited_and_closed(
    tmp_path: Path, capfd: pytest.CaptureFixture[str]
) -> None:
    """A command sees what the one before it made; a server is ended once its page answers, also in a background job."""
    ours = project(
        tmp_path / "ours",
        "echo regolithd > index.html",
        f"{SERVER}  # the page",
        "test -s index.html \\",
        "  && echo seen",
    )
    assert typed_readme.main(tmp_path / "clone", ours) == 0
    shown = capfd.readouterr().out
    assert "/ answers" in shown
    assert "\nseen\n" in shown
    assert not (ours / "index.html").exists()


@pytest.mark.parametrize(
    "command", ["exit 3", f"rm README.md; {SERVER}", "regolithd-unknown"], ids=["status", "page", "unknown"]
)
def test_the_first_command_that_fails_ends_the_run(
    command: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capfd: pytest.CaptureFixture[str]
) -> None:
    """A status, a page that is not ours, and an unknown command."""
    monkeypatch.setattr(typed_readme, "PAGE_TIMEOUT_S", 1)
    assert typed_readme.main(tmp_path / "clone", project(tmp_path / "ours", command, "echo never")) != 0
    shown = capfd.readouterr().out
    assert "failed with status" in shown
    assert "\nnever" not in shown
