"""Friction larger than all the current that the simulation expects: named, corrected, and then consistent."""

import tomllib
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from rover_drives import TABLES, columns, simulation
from servo import ServoAxis

from regolithd.calibration.mismatch.answer import CalibratedParameter, Parameter
from regolithd.calibration.mismatch.comparison import compare
from regolithd.calibration.mismatch.contribution import Contribution
from regolithd.calibration.mismatch.corrected import corrected_tables, stated_effects, write_corrected
from regolithd.calibration.mismatch.data.recording import Recording, from_columns
from regolithd.calibration.mismatch.result import Comparison
from regolithd.calibration.mismatch.signal.normal_interval import NINETY_PERCENT_STDS
from regolithd.calibration.mismatch.simulation.load import load_simulation
from regolithd.calibration.mismatch.simulation.rover_wheel import RoverWheel
from regolithd.calibration.mismatch.templates import write_templates
from regolithd.calibration.toml_document import to_toml, with_tables

UNKNOWN: dict[str, Any] = {"law_std": 0.0, "posterior": None}
"""What an effect says of how well its law is known, where it is not."""
CONCEALED_A = 0.037


@pytest.fixture(scope="module")
def dragging() -> Recording:
    """Return a recording with a constant drag that no prior can stand in for."""
    table = columns(3)
    moving = np.abs(table["motor_speed_rad_s"]) > 0
    table["motor_current_A"] = table["motor_current_A"] + CONCEALED_A * np.sign(table["motor_speed_rad_s"]) * moving
    return from_columns(table)


@pytest.fixture(scope="module")
def found(dragging: Recording) -> Comparison:
    """Return the comparison with the simulation that has no friction."""
    return compare(dragging, simulation())


def _corrected(found: Comparison) -> dict[str, Any]:
    evidence = found.evidence
    tables = corrected_tables(TABLES, simulation(), evidence.values, evidence.contributions, found.answer.effects)
    return tomllib.loads(to_toml(tables))


def test_it_is_named_though_the_priors_are_what_tells_it_from_the_gain(found: Comparison) -> None:
    """Most of the gain is the priors': held-out errors alone would not bring half of it back."""
    assert [effect.name for effect in found.answer.effects] == ["coulomb-friction"]


def test_the_drivetrain_has_it_and_says_how_sure(found: Comparison) -> None:
    """In the daemon's own words, with a standard deviation that a person would believe."""
    drivetrain = _corrected(found)["drivetrain"]
    assert drivetrain["no_load_current_A"] == pytest.approx([CONCEALED_A] * 6, rel=0.1)
    assert 1e-5 < drivetrain["no_load_current_std_A"][0] < 5e-3


def test_the_corrected_simulation_is_consistent_with_the_same_recording(dragging: Recording, found: Comparison) -> None:
    """What was found is not found again."""
    tables = _corrected(found)
    again = compare(dragging, RoverWheel.from_tables(tables), effects=stated_effects(tables))
    assert again.answer.verdict == "consistent"


def test_parameters_that_lean_over_stay_where_they_can_be(found: Comparison) -> None:
    """Three standard deviations at most, whatever the recording says."""
    moved = {**found.evidence.values, "gain_factor": -0.5, "friction_angle_deg": 70.0}
    tables = corrected_tables(TABLES, simulation(), moved, ())
    assert tables["drivetrain"]["gain_factor"] == pytest.approx([1 - 3 * 0.02] * 6)
    assert tables["soil"]["friction_angle_deg"] == pytest.approx(30.3 * (1 + 3 * 0.02))


def test_parameters_that_left_their_priors_are_written_as_they_were_run() -> None:
    """Where everything is explained, the file gives what the answer promised."""
    servo = {"simulation": {"model": "servo:ServoAxis"}}
    tables = corrected_tables(servo, ServoAxis(), {"mass_kg": 70.0}, (), within_priors=False)
    assert tables["parameters"]["mass_kg"] == {"value": 70.0, "std": 2.0}
    tables = corrected_tables(servo, ServoAxis(), {"mass_kg": 700.0}, ())  # three standard deviations otherwise
    assert tables["parameters"]["mass_kg"]["value"] == ServoAxis.parameters["mass_kg"].value + 3 * 2.0


@pytest.mark.parametrize("size", [None, Parameter(0.0, -0.1, 0.1, "1")])
def test_an_effect_without_a_relative_size_has_no_standard_deviation(size: Parameter | None) -> None:
    """Where the size is not known, or nothing, there is nothing that it could be relative to."""
    term = Contribution("coulomb-friction", {}, (0.5,), (1,), 0.1)
    effect: Any = SimpleNamespace(
        parameters={} if size is None else {"relative_size": size}, law_std=0.0, posterior=None
    )
    servo = {"simulation": {"model": "servo:ServoAxis"}}
    tables = corrected_tables(servo, ServoAxis(), {"mass_kg": 96.0}, (term,), (effect,))
    assert [each["relative_std"] for each in tables["effects"]] == [0.0]


def test_how_well_a_law_is_known_is_written_and_read() -> None:
    """Its power has a standard deviation; when it began is of one recording, and a usual number was not fitted."""
    term = Contribution("bearing-drag", {"onset_s": 60.0, "power": 0.8, "rise_s": 5.0}, (0.5,), (1,))
    told = {"onset_s": Parameter(60.0, 50.0, 70.0, "s"), "power": Parameter(0.8, 0.6, 1.0, "1")}
    told["rise_s"] = Parameter(5.0, float("nan"), float("nan"), "s")
    effect: Any = SimpleNamespace(
        parameters={"relative_size": Parameter(0.1, 0.09, 0.11, "1"), **told}, law_std=0.2, posterior=None
    )
    servo = {"simulation": {"model": "servo:ServoAxis"}}
    tables = corrected_tables(servo, ServoAxis(), {"mass_kg": 96.0}, (term,), (effect,))
    (written,) = tables["effects"]
    assert written["relative_std"] == 0.2, "the law is known less well than its size here"
    assert written["shape_std"] == {"power": pytest.approx(0.2 / NINETY_PERCENT_STDS)}
    (read,) = stated_effects(tomllib.loads(to_toml(tables)))
    assert read.shape_std == written["shape_std"]


def test_the_user_s_comments_and_order_stay(found: Comparison) -> None:
    """SIM.toml is edited, not written anew."""
    text = to_toml(TABLES).replace("[soil]", "[soil]  # from the bin").replace("k_phi_kN", "# stiff\nk_phi_kN")
    evidence = found.evidence
    tables = corrected_tables(TABLES, simulation(), evidence.values, evidence.contributions, found.answer.effects)
    edited = with_tables(text, tables)
    assert tomllib.loads(edited) == tomllib.loads(to_toml(tables))
    assert "[soil]  # from the bin" in edited
    assert "# stiff\nk_phi_kN" in edited


def test_a_simulation_without_keys_for_an_effect_leaves_it_to_the_list() -> None:
    """Only the rover's simulation has friction in its own tables."""
    term = Contribution("coulomb-friction", {}, (0.5,), (1,), 0.1)
    tables = corrected_tables({"simulation": {"model": "servo:ServoAxis"}}, ServoAxis(), {"mass_kg": 96.0}, (term,))
    assert tables["parameters"]["mass_kg"] == {"value": 96.0, "std": 2.0}
    (effect,) = tables["effects"]
    assert effect == {
        "name": "coulomb-friction",
        "shape": {},
        "coefficients": [0.5],
        "wheels": [1],
        "relative_std": 0.1,
    }
    assert stated_effects(tables) == (term,)


def test_viscous_friction_is_told_per_motor_speed_and_its_wheels_alone_have_it() -> None:
    """The effect is per wheel speed; another power stays in the list; standard deviations add in quadrature."""
    rover = simulation()
    values = {name: prior.value for name, prior in rover.parameters.items()}
    terms = [
        Contribution("viscous-friction", {"power": 1.0}, (0.14,), (2, 5), 0.1),
        Contribution("viscous-friction", {"power": 0.8}, (0.14,), (2,), 0.1),
        Contribution("coulomb-friction", {}, (0.03,), (1,), 0.2),
        Contribution("coulomb-friction", {}, (0.04,), (1,), 0.2),
    ]
    tables = corrected_tables(TABLES, rover, values, terms)
    drivetrain = tables["drivetrain"]
    assert drivetrain["viscous_current_A_s_per_rad"] == pytest.approx([0, 1e-4, 0, 0, 1e-4, 0])
    assert drivetrain["viscous_current_std_A_s_per_rad"] == pytest.approx([0, 1e-5, 0, 0, 1e-5, 0])
    assert drivetrain["no_load_current_A"] == pytest.approx([0.07, 0, 0, 0, 0, 0])
    assert drivetrain["no_load_current_std_A"] == pytest.approx([0.01, 0, 0, 0, 0, 0])
    assert [effect["shape"]["power"] for effect in tables["effects"]] == [0.8]


@pytest.mark.parametrize(
    ("folder", "led"), [("sim", None), ("before", "../sim"), ("zoo", "../sim"), ("sim/inner", ".."), (".", "sim")]
)
def test_a_file_in_another_folder_leads_to_the_class(folder: str, led: str | None, tmp_path: Path) -> None:
    """Wherever it is; beside SIM.toml nothing is added, and the class is found again from both."""
    (tmp_path / folder).mkdir(parents=True, exist_ok=True)
    (tmp_path / "sim").mkdir(exist_ok=True)
    write_templates("class", tmp_path / "sim")
    found = load_simulation(tmp_path / "sim" / "SIM.toml")
    values = {name: prior.value for name, prior in found.parameters.items()}
    answer = SimpleNamespace(unexplained=(), effects=(), parameters=())
    evidence = SimpleNamespace(values=values, contributions=())
    path = tmp_path / folder / "CORRECTED.toml"
    write_corrected(path, answer, evidence, found)  # type: ignore[arg-type]
    assert tomllib.loads(path.read_text())["simulation"].get("path") == led
    assert load_simulation(path).parameters.keys() == found.parameters.keys()


def test_beside_something_unexplained_the_file_has_the_answers_parameters(tmp_path: Path) -> None:
    """Not those of a fit without the unknown, which move to imitate it."""
    write_templates("class", tmp_path)
    found = load_simulation(tmp_path / "SIM.toml")
    name, prior = next(iter(found.parameters.items()))
    told = prior.value + prior.std
    posterior = CalibratedParameter(name, prior.unit, prior.value, prior.std, told, told, told)
    answer = SimpleNamespace(unexplained=(None,), effects=(), parameters=(posterior,))
    values = {each: of.value - 5 * of.std for each, of in found.parameters.items()}
    evidence = SimpleNamespace(values=values, contributions=())
    write_corrected(tmp_path / "NEW.toml", answer, evidence, found)  # type: ignore[arg-type]
    assert load_simulation(tmp_path / "NEW.toml").parameters[name].value == pytest.approx(told)
