"""MkDocs hook: puts a section for each alarm where a page says `<!-- alarms -->`, from the alarm guide."""

from __future__ import annotations

from typing import TYPE_CHECKING

from regolithd.daemon.messages.alarm_guide import ALARM_GUIDE, NODE

if TYPE_CHECKING:
    from regolithd.daemon.messages.alarm_guide import AlarmGuide

MARK = "<!-- alarms -->"


def on_page_markdown(markdown: str, **_: object) -> str:
    """Replace the mark by one section for each alarm."""
    return markdown.replace(MARK, "\n".join(map(_section, ALARM_GUIDE.values()))) if MARK in markdown else markdown


def _section(guide: AlarmGuide) -> str:
    title = "node-…" if guide.name == NODE else guide.name
    actions = "\n".join(f"- {action}" for action in guide.actions)
    return (
        f"## {title} {{ #{guide.name} }}\n\n{guide.meaning}\n\n**Consequence.** {guide.consequence}\n\n"
        f"**What to do**\n\n{actions}\n\n**Ends when** {guide.ends}\n"
    )
