"""What the README promises exists."""

from __future__ import annotations

import re
from pathlib import Path

from regolithd.daemon.messages.documents import table

ROOT = Path(__file__).parent.parent
README = (ROOT / "README.md").read_text(encoding="utf-8")


def test_every_link_of_the_readme_leads_somewhere() -> None:
    """Each relative link and picture is a file of the repository."""
    links = re.findall(r"\]\(([^)#:]+)\)", README)
    assert links
    assert [link for link in links if not (ROOT / link).exists()] == []


def test_every_make_command_of_the_readme_is_a_target() -> None:
    """Each `make NAME` that the README tells people to type is in the Makefile."""
    targets = set(re.findall(r"^([a-z]+):", (ROOT / "Makefile").read_text(encoding="utf-8"), flags=re.MULTILINE))
    told = set(re.findall(r"\bmake ([a-z]+)\b", README))
    assert "demo" in told
    assert told <= targets


def test_the_message_table_is_the_generated_one() -> None:
    """The README has the table that `regolithd schema` makes, whole, with links from the top of the project."""
    assert table().replace("](", "](docs/messages/") in README
