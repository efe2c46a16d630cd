"""The alarm guide: complete, shown in the documentation and on the ground."""

from __future__ import annotations

import ast
import inspect
from pathlib import Path

import pytest
from starlette.requests import Request

from regolithd.daemon.ground.web.alarm_pages import alarm_page
from regolithd.daemon.health import alarms
from regolithd.daemon.messages.alarm_guide import ALARM_GUIDE, NODE, AlarmGuide, guide_of
from regolithd.daemon.publish import comparison

ROOT = Path(__file__).resolve().parents[3]


def names_in_code() -> set[str]:
    """Return the name that each `Alarm(…)` of the code has, from the code itself; `node` for the alarms of nodes."""
    found = {"mismatch"} if '"alarm/mismatch"' in inspect.getsource(comparison) else set()
    for call in ast.walk(ast.parse(inspect.getsource(alarms))):
        if isinstance(call, ast.Call) and isinstance(call.func, ast.Name) and call.func.id == "Alarm":
            name = call.args[0]
            found.add(name.value if isinstance(name, ast.Constant) else NODE)
    return found


def test_every_alarm_has_an_entry_and_every_entry_is_an_alarm() -> None:
    """The names are those with which the code raises alarms."""
    assert names_in_code() == set(ALARM_GUIDE)
    assert set(alarms.alarm_names([])) == set(ALARM_GUIDE) - {NODE, "mismatch"}


@pytest.mark.parametrize("guide", ALARM_GUIDE.values(), ids=lambda guide: guide.name)
def test_an_entry_says_what_it_means_and_what_to_do(guide: AlarmGuide) -> None:
    """Whole sentences, at least two things to do, and when it ends."""
    assert len(guide.actions) >= 2
    for text in (guide.meaning, guide.consequence, *guide.actions, guide.ends):
        assert text.endswith(".")
        assert text.count("`") % 2 == 0


def test_nodes_share_an_entry() -> None:
    """`node-id` is another alarm."""
    assert guide_of("node-13") is ALARM_GUIDE[NODE]
    assert guide_of("node-id") is ALARM_GUIDE["node-id"]
    assert guide_of("of-the-next-version") is None


@pytest.mark.parametrize("name", [*(name for name in ALARM_GUIDE if name != NODE), "node-3"])
async def test_the_ground_has_a_page_for_every_alarm(name: str) -> None:
    """It is HTML with the texts of the guide, code marked as such."""
    status, text = await page(name)
    assert status == 200
    assert f"<h1>Alarm {name}</h1>" in text
    assert "<h2>What to do</h2><ul><li>" in text
    assert "`" not in text


async def test_an_unknown_alarm_is_not_found() -> None:
    """What stands in the address is shown as text."""
    status, text = await page("<script>")
    assert status == 404
    assert "<script>" not in text


async def page(name: str) -> tuple[int, str]:
    """Return status and text of the answer to `/alarms/NAME`."""
    answer = await alarm_page(Request({"type": "http", "path_params": {"name": name}}))
    return answer.status_code, bytes(answer.body).decode()


def test_the_documentation_has_a_section_for_every_alarm() -> None:
    """The page of the reference takes them from the guide, by the hook."""
    import importlib.util  # noqa: PLC0415  # the hook lies in no package

    specification = importlib.util.spec_from_file_location("alarms_hook", ROOT / "docs/site/alarms.py")
    assert specification is not None
    assert specification.loader is not None
    hook = importlib.util.module_from_spec(specification)
    specification.loader.exec_module(hook)
    page = hook.on_page_markdown((ROOT / "docs/reference/alarms.md").read_text())
    for name in ALARM_GUIDE:
        assert f"{{ #{name} }}" in page
    assert page.count("**What to do**") == len(ALARM_GUIDE)
