"""Edits of TOML: the values change, everything that a person wrote stays."""

from __future__ import annotations

import tomllib

import pytest

from regolithd.calibration.toml_document import to_toml, with_tables

TEXT = """# The rover.
[wheel]
radius_m = 0.075   # measured
width_m = 0.07

[drivetrain]  # Eq. 11
gain = [
    1.0,  # front
    2.0,
]
"""


def test_tables_replace_add_and_remove_keys_and_keep_comments() -> None:
    """The result parses to the tables that were asked for."""
    wanted = {"wheel": {"radius_m": 0.08, "new": {"value": 1.0}}, "drivetrain": {"gain": [1.0, 2.0]}, "name": "a"}
    edited = with_tables(TEXT, wanted)
    assert tomllib.loads(edited) == wanted
    assert "# front" in edited
    assert "radius_m = 0.08    # measured" in edited
    assert "width_m" not in edited


@pytest.mark.parametrize("name", ["effects", "other"])
def test_a_list_of_tables_is_continued_where_it_begins_as_before(name: str) -> None:
    """What stands there keeps its comments; a list that begins otherwise is written anew."""
    first, second = {"name": "a", "shape": {"onset_s": float("inf")}}, {"name": 'b "quoted"', "wheels": [1, 2]}
    text = to_toml({name: [first]}).replace('"a"', '"a"  # found in May')
    more = with_tables(text, {name: [first, second]})
    assert tomllib.loads(more)[name] == [first, second]
    assert "found in May" in more
    other = with_tables(text, {name: [second]})
    assert tomllib.loads(other)[name] == [second]
    assert "found in May" not in other


def test_tables_out_of_order_are_edited_too() -> None:
    """TOML lets a table's parts stand apart."""
    text = "[a.b]\nx = 1\n[c]\ny = 2\n[a.d]\nz = 3\n"
    wanted = {"a": {"b": {"x": 5}, "d": {"z": 3}}, "c": {"y": 2}}
    assert tomllib.loads(with_tables(text, wanted)) == wanted
