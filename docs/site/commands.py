"""MkDocs hook: puts the help of every `regolithd` command where a page says `<!-- commands -->`."""

from __future__ import annotations

import re
from typing import TYPE_CHECKING

from typer.main import get_command

from regolithd.daemon.cli import app

if TYPE_CHECKING:
    from collections.abc import Iterator

    from typer.core import TyperArgument, TyperGroup, TyperOption

MARK = "<!-- commands -->"


def on_page_markdown(markdown: str, **_: object) -> str:
    """Replace the mark by one section for each command."""
    return markdown.replace(MARK, "\n".join(_sections())) if MARK in markdown else markdown


def _sections() -> Iterator[str]:
    group = get_command(app)
    for path, command in _commands(group, "regolithd"):
        yield f"## {path} {{ data-toc-label='{path.removeprefix('regolithd ')}' }}\n"
        yield f"{_sentence(command.help)}\n"
        parameters = [row for parameter in command.params if (row := _row(parameter))]
        if parameters:
            yield "| argument or option | meaning | default |\n|---|---|---|"
            yield "\n".join(parameters) + "\n"


def _commands(group: TyperGroup, path: str) -> Iterator[tuple[str, TyperGroup]]:
    for name, command in sorted(group.commands.items()):
        if getattr(command, "commands", None):
            yield from _commands(command, f"{path} {name}")
        else:
            yield f"{path} {name}", command


def _row(parameter: TyperOption | TyperArgument) -> str:
    if "--help" in parameter.opts or getattr(parameter, "hidden", False):
        return ""
    is_option = parameter.param_type_name == "option"
    name = ", ".join([*parameter.opts, *parameter.secondary_opts]) if is_option else (parameter.name or "").upper()
    default = "required" if parameter.required else _default(parameter.default)
    return f"| `{name}` | {_sentence(getattr(parameter, 'help', ''))} | {default} |"


def _default(value: object) -> str:
    if value is None or value is False or value == () or callable(value):
        return ""
    return f"`{value}`"


def _sentence(text: str | None) -> str:
    return re.sub(r"\s+", " ", (text or "").replace("|", "\\|")).strip()
