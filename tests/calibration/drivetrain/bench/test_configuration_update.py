"""Values are set in a TOML text, and everything else in it stays."""

import tomllib
from pathlib import Path

import pytest

from regolithd.calibration.drivetrain.bench.configuration_update import set_value

ROVER_TOML = Path(__file__).resolve().parents[4] / "rover.toml"


def test_the_users_comments_stay() -> None:
    """In the shipped file only the value changes; a new key is added to its table, a new table at the end."""
    before = ROVER_TOML.read_text(encoding="utf-8")
    after = set_value(before, "drivetrain", "no_load_current_A", [0.0371, 0.036, 0.04, 0.033, 0.035, 0.036])
    changed = [(a, b) for a, b in zip(before.splitlines(), after.splitlines(), strict=True) if a != b]
    assert len(changed) == 1
    assert changed[0][1].startswith("no_load_current_A = [0.0371, 0.036, 0.04, 0.033, 0.035, 0.036]")
    assert changed[0][1].endswith(changed[0][0].split("#")[1])
    assert "# Maxon RE 25, 24 V winding" in after
    added = set_value(set_value(before, "wheel", "radius_std_m", 0.0002), "new", "value", 3.0)
    assert added.index("radius_std_m") < added.index("[drivetrain]") < added.index("[new]")


def test_a_comment_stays_in_its_column() -> None:
    """A shorter value is padded, a longer one moves the comment by as much as it must."""
    text = "[wheel]\nradius_m = 0.0750   # tape\n"
    assert set_value(text, "wheel", "radius_m", 0.08) == "[wheel]\nradius_m = 0.08     # tape\n"
    assert set_value(text, "wheel", "radius_m", 0.0754321) == "[wheel]\nradius_m = 0.0754321 # tape\n".replace(
        "21 #", "21 #"
    )


def test_a_value_over_several_lines_is_replaced() -> None:
    """An array over several lines is replaced as a whole."""
    text = "[load_cells]\nspan = [\n  1.0, 1.0, 1.0,  # left\n  1.0, 1.0, 1.0,\n]\nzero_N = 0.0\n"
    found = tomllib.loads(set_value(text, "load_cells", "span", [1.1] * 6))
    assert found == {"load_cells": {"span": [1.1] * 6, "zero_N": 0.0}}


def test_a_name_that_is_no_table_is_refused() -> None:
    """A key of the top level is not overwritten by a table."""
    with pytest.raises(TypeError, match="wheel is not a table"):
        set_value("wheel = 3\n", "wheel", "radius_m", 0.08)
