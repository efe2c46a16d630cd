"""What the documentation names exists: files, commands, options, make targets, modules."""

from __future__ import annotations

import importlib.util
import re
from pathlib import Path
from typing import TYPE_CHECKING

import pytest
from typer.main import get_command

from regolithd.daemon.cli import app

if TYPE_CHECKING:
    from collections.abc import Iterator

ROOT = Path(__file__).resolve().parents[2]
OLD = {"CHANGELOG.md"}  # tells of earlier versions
PAGES = [
    path
    for path in sorted([*ROOT.glob("*.md"), *(ROOT / "docs").rglob("*.md"), *(ROOT / ".github").rglob("*.*")])
    if path.name not in OLD
]
FOLDERS = ("daemon", "drivers", "calibration", "systemd", "tests", "docs", r"\.ci", r"\.github", "src")
CODE = re.compile(r"```\w*\n(.*?)```|(?<!`)`([^`\n]+)`(?!`)|((?:^ {4}\S.*\n)+)", flags=re.DOTALL | re.MULTILINE)
PATH = re.compile(rf"(?<![\w/.-])((?:{'|'.join(FOLDERS)})/[\w./-]*\w/?)(?![\w*…<{{])")
PLACEHOLDER = re.compile(r"/[A-Z]+\b")
COMMAND = re.compile(r"(?<![\w./-])(?<!-u )(?:\.venv/bin/)?regolithd ([a-z][a-z-]*)(?: ([a-z][a-z-]*))?([^`\n]*)")


def page_name(path: Path) -> str:
    """Name a page in a test's report."""
    return path.relative_to(ROOT).as_posix()


def code_of(text: str) -> Iterator[str]:
    """Every piece of code of a page: blocks with continued lines joined, and spans."""
    joined = re.sub(r"\\\n\s*", " ", text)
    for block in re.findall(
        r"```\w*\n(.*?)```|(?<!`)`([^`\n]+)`(?!`)|((?:^ {4}\S.*\n)+)", joined, flags=re.DOTALL | re.MULTILINE
    ):
        yield "".join(block)


def options(*words: str) -> set[str] | None:
    """Return the options of a command, or nothing where there is no such command."""
    command = get_command(app)
    for word in words:
        commands = getattr(command, "commands", {})
        if word not in commands:
            return options(*words[:-1]) if len(words) == 2 and not commands else None
        command = commands[word]
    return {name for parameter in command.params for name in (*parameter.opts, *parameter.secondary_opts)} | {"--help"}


@pytest.mark.parametrize("page", PAGES, ids=page_name)
def test_every_path_exists(page: Path) -> None:
    """Each path of the repository that a page names as code is there."""
    named = {
        match
        for code in code_of(page.read_text(encoding="utf-8"))
        for match in PATH.findall(code)
        if not PLACEHOLDER.search(match)
    }
    assert [path for path in sorted(named) if not (ROOT / path).exists()] == []


@pytest.mark.parametrize("page", PAGES, ids=page_name)
def test_every_command_and_option_exists(page: Path) -> None:
    """Each `regolithd` command that a page names as code is one, and so are its options."""
    wrong = []
    for code in code_of(page.read_text(encoding="utf-8")):
        for first, second, rest in COMMAND.findall(code):
            known = options(first, second) if second else options(first)
            if known is None:
                wrong.append(f"regolithd {first} {second}".strip())
            else:
                said = re.findall(r"(?<!\S)--[a-z][a-z-]*", rest.split("#")[0].split("&&")[0])
                wrong += [f"regolithd {first} {option}" for option in said if option not in known]
    assert wrong == []


@pytest.mark.parametrize("page", PAGES, ids=page_name)
def test_every_make_target_and_module_exists(page: Path) -> None:
    """Each `make NAME` and `python -m NAME` that a page names as code can be run."""
    targets = set(re.findall(r"^([a-z-]+):", (ROOT / "Makefile").read_text(encoding="utf-8"), flags=re.MULTILINE))
    text = "\n".join(code_of(page.read_text(encoding="utf-8")))
    told = {word for words in re.findall(r"\bmake ((?:[a-z-]+ ?)+)", text) for word in words.split()}
    assert told <= targets
    modules = re.findall(r"python -m ((?:regolithd|tests)[\w.]+)", text)
    assert [name for name in modules if not _found(name)] == []


def _found(name: str) -> bool:
    if name.startswith("tests."):
        return (ROOT / name.replace(".", "/")).with_suffix(".py").exists()
    return importlib.util.find_spec(name) is not None


@pytest.mark.parametrize("page", sorted(ROOT.glob("*.md")), ids=page_name)
def test_every_link_of_a_page_at_the_top_leads_somewhere(page: Path) -> None:
    """Each relative link of the README and its neighbours is a file; those below docs/ are checked by the site."""
    links = re.findall(r"\]\(([^)#:]+)(?:#[^)]*)?\)", page.read_text(encoding="utf-8"))
    assert [link for link in links if not (ROOT / link).exists()] == []
