"""The page of disagreements and their messages is what the code says."""

from __future__ import annotations

import os
from pathlib import Path

from disagreements import AT_BOOT, IN_THE_FILE, page, while_running

PAGE = Path(__file__).parents[2] / "docs" / "reference" / "disagreements.md"


async def test_the_page_of_disagreements_is_up_to_date() -> None:
    """Each disagreement gives the message that the page shows; there are more than twenty."""
    text = await page()
    if os.environ.get("GOLDEN") == "write":
        PAGE.write_text(text, encoding="utf-8")
    assert len(AT_BOOT) + len(IN_THE_FILE) + len(while_running()) >= 20
    assert PAGE.read_text(encoding="utf-8") == text
