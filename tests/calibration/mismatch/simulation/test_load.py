"""SIM.toml as a file: a mistake in it is one message with file, line and cure."""

from __future__ import annotations

from typing import TYPE_CHECKING

import pytest

from regolithd.calibration.mismatch.candidates.library import library
from regolithd.calibration.mismatch.errors import SimulationError
from regolithd.calibration.mismatch.simulation.load import load_simulation
from regolithd.calibration.mismatch.simulation.toml_place import line_of
from regolithd.calibration.mismatch.templates import write_templates

if TYPE_CHECKING:
    from pathlib import Path

TEXT = """# a comment
[simulation]
model = "tank:Tank"

[parameters.area_m2]
value = 0.5
std = 0.01   # = known well

[[effects]]
name = "x"
[tank]
"drain cm" = 3
"""


@pytest.mark.parametrize(
    ("keys", "line"),
    [
        (("simulation", "model"), 3),
        (("parameters", "area_m2", "std"), 7),
        (("parameters", "area_m2", "absent"), 5),
        (("effects",), 9),
        (("tank", "drain cm"), 12),
        (("absent",), None),
    ],
)
def test_a_key_has_a_line(keys: tuple[str, ...], line: int | None) -> None:
    """The line is the key's, or that of the table around it."""
    assert line_of(TEXT, keys) == line


@pytest.mark.parametrize(
    ("kind", "old", "new", "told"),
    [
        (
            "class",
            '"my_simulation:Joint"',
            "my_simulation",
            "is not TOML: Invalid value (at line {line}, column 9)",
        ),
        ("class", "my_simulation:Joint", "my_simulation", "SIM.toml, line {line}: [simulation] model must be"),
        ("class", "my_simulation:", "your_simulation:", "say where it is with [simulation] path"),
        ("class", "# path =", "path = 3 #", "SIM.toml, line {line}: [simulation] path must be a folder's name"),
        ("class", "value = 0.50", 'value = "half"', "a finite number is needed, not 'half'"),
        ("class", "value = 0.50", "valu = 0.50", "did you mean value?"),
        (
            "class",
            "inertia_kg_m2",
            "inertia_kgm2",
            "SIM.toml, line {line}: [parameters]: the simulation has no parameter",
        ),
        ("class", "# path =", "without_effects = 'x' #", "line {line}: [simulation] without_effects must be a list of"),
        (
            "class",
            "# path =",
            "motor_constant_degC = 20 #",
            "{line}: [simulation] has no key motor_constant_degC;",
        ),
        ("class", "# path =", "without_effect = [] #", "did you mean without_effects?"),
        ("class", "# path =", "motor_constant_at_degC = 'x' #", "[simulation] motor_constant_at_degC must be a number"),
        ("class", "[parameters.v", "[effects]\n[parameters.v", "effects are tables, [[effects]]"),
        ("rover-wheel", "cohesion_Pa =", "cohesion_kPa =", "did you mean cohesion_Pa?"),
        ("rover-wheel", "[soil]", "[ground]", "soil: Field required"),
        ("rover-wheel", "mass_kg = 30.0", 'mass_kg = "heavy"', "SIM.toml, line 26: the simulation's tables are wrong"),
    ],
)
def test_a_mistake_is_told_with_its_line(kind: str, old: str, new: str, told: str, tmp_path: Path) -> None:
    """The message begins with the file; `{line}` is that of the mistake."""
    write_templates(kind, tmp_path)
    path = tmp_path / "SIM.toml"
    before, found, after = path.read_text().partition(old)
    assert found
    path.write_text(before + new + after)
    with pytest.raises(SimulationError) as caught:
        load_simulation(path)
    assert str(caught.value).startswith(str(path))
    assert told.format(line=before.count("\n") + 1) in str(caught.value)


@pytest.mark.parametrize("kind", ["class", "rover-wheel"])
def test_the_temperature_of_the_motor_constant_is_stated_by_the_file(kind: str, tmp_path: Path) -> None:
    """`[simulation] motor_constant_at_degC`, whatever the kind of simulation; by default nothing is said."""
    write_templates(kind, tmp_path)
    path = tmp_path / "SIM.toml"
    assert load_simulation(path).motor_constant_at_degC is None
    path.write_text(path.read_text().replace("[simulation]", "[simulation]\nmotor_constant_at_degC = 22", 1))
    assert load_simulation(path).motor_constant_at_degC == 22


@pytest.mark.parametrize("content", [b"\xff\xfe[\x00", b"[simulation]\nmodel = '\xe9'\n"])
def test_another_encoding_is_told(content: bytes, tmp_path: Path) -> None:
    """The cure is to save as UTF-8."""
    (tmp_path / "SIM.toml").write_bytes(content)
    with pytest.raises(SimulationError, match="save it as UTF-8"):
        load_simulation(tmp_path / "SIM.toml")


def test_an_absent_file_is_told(tmp_path: Path) -> None:
    """It is one of the tool's own errors."""
    with pytest.raises(SimulationError, match=r"SIM\.toml cannot be read"):
        load_simulation(tmp_path / "SIM.toml")


@pytest.mark.parametrize("kind", ["class", "rover-wheel"])
def test_effects_that_a_machine_cannot_have_are_left_out_by_the_file(kind: str, tmp_path: Path) -> None:
    """`[simulation] without_effects`, whatever the kind of simulation; a name that nobody knows is an error."""
    write_templates(kind, tmp_path)
    path = tmp_path / "SIM.toml"
    text = path.read_text()
    all_names = {each.name for each in load_simulation(path).candidates(library())}
    path.write_text(
        text.replace("[simulation]", '[simulation]\nwithout_effects = ["slip-sinkage", "rotor-inertia"]', 1)
    )
    names = {each.name for each in load_simulation(path).candidates(library())}
    assert all_names - names == {"slip-sinkage", "rotor-inertia"}
    path.write_text(text.replace("[simulation]", '[simulation]\nwithout_effects = ["slip-sinking"]', 1))
    with pytest.raises(SimulationError, match=r"there is no effect slip-sinking; did you mean slip-sinkage\?"):
        load_simulation(path).candidates(library())
