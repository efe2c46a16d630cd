"""The page about simulations of one's own lists everything that may be stated, and its code runs."""

from __future__ import annotations

import inspect
import re
from pathlib import Path
from typing import TYPE_CHECKING, Any, ClassVar

import numpy as np
import pytest
from scipy.signal import lfilter

from regolithd.calibration.mismatch import Prior, compare, direction_of
from regolithd.calibration.mismatch.contribution import Contribution
from regolithd.calibration.mismatch.data.recording import TIME_UNITS_S, read_recording
from regolithd.calibration.mismatch.data.slow_channels import filled_between
from regolithd.calibration.mismatch.simulation.checked import checked
from regolithd.calibration.mismatch.simulation.checked_candidate import STATED
from regolithd.calibration.mismatch.simulation.simulation import Simulation

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping

    from numpy.typing import NDArray

    from regolithd.calibration.mismatch import Array

FOLDER = Path(__file__).resolve().parents[2] / "docs/how-to"
PAGE, COVARIATES = ((FOLDER / name).read_text(encoding="utf-8") for name in ("simulation.md", "covariates.md"))


def test_the_page_lists_every_attribute_and_method() -> None:
    """Nothing has to be looked up in the source."""
    methods = {name for name, value in vars(Simulation).items() if inspect.isroutine(value) and name[0] != "_"}
    listed = set(re.findall(r"^\| `(\w+)", PAGE, flags=re.MULTILINE))
    assert set(Simulation.__annotations__) | methods | set(STATED) | {"coefficients", "columns"} <= listed


def test_the_page_names_every_unit_of_time() -> None:
    """A column of time has its unit in its name."""
    assert all(f"`{name}`" in PAGE for name in TIME_UNITS_S)


def test_the_class_on_the_page_predicts_the_recording_on_the_page(tmp_path: Path) -> None:
    """Text names of axes and a slower sensor are read as the page says."""
    blocks = re.findall(r"```(\w+)\n(.*?)```", PAGE, flags=re.DOTALL)
    python = next(text for kind, text in blocks if kind == "python")
    table = next(text for kind, text in blocks if kind == "text" and text.startswith("t_s"))
    (tmp_path / "monday.csv").write_text(table)
    names: dict[str, type[Simulation]] = {}
    exec(python, names)
    joint = checked(names["Joint"]())
    recording = read_recording(tmp_path / "monday.csv", unit=joint.wheel_column)
    assert recording.wheels == ("elbow", "wrist")
    prepared = joint.prepare(filled_between(recording, joint.channel, joint.between_readings))
    inputs = {**prepared.channels, "t_s": np.zeros(prepared.shape)}
    np.testing.assert_allclose(joint.predict(inputs, {"inertia_kg_m2": 0.5}), [[1.55, 0.45], [1.5, np.nan]])
    assert set(joint.covariates(inputs)) == {"wheel_speed", "temperature"}


@pytest.fixture(scope="module")
def fans() -> dict[str, Any]:
    """What the page's whole example defines."""
    blocks = re.findall(r"```python\n(.*?)```", PAGE, flags=re.DOTALL)
    names: dict[str, Any] = {}
    exec(next(text for text in blocks if "class Fans" in text), names)
    return names


def duct(simulation: Simulation) -> dict[str, NDArray[Any]]:
    """Return two runs of two fans: a filter that clogs, and a bearing of the supply fan that drags with speed."""
    rng, count, names = np.random.default_rng(1), 700, np.array(["exhaust", "supply"])
    run = np.repeat([0, 1], count // 2)
    inputs = {
        "t_s": np.tile(np.arange(count // 2, dtype=float), 2),
        "run": run,
        "bearing_degC": 20 + 25 * (1 - np.exp(-np.arange(count) / 400)),
    }
    inputs = {name: np.repeat(values[:, None], 2, axis=1) for name, values in inputs.items()}
    speed = np.repeat(rng.uniform(500, 1500, (count // 35, 2)), 35, axis=0)
    inputs |= {"speed_rpm": speed, "damper_pct": np.repeat(rng.uniform(35, 100, (count // 70, 2)), 70, axis=0)}
    values = {name: prior.value for name, prior in simulation.parameters.items()}
    predicted: Any = simulation.predict(inputs, values)
    flow = simulation.flow(inputs, values)  # type: ignore[attr-defined]
    clogged = 0.02 * flow**2 * np.arange(count)[:, None]
    drag = speed / 1000 * [0.0, 0.15]
    inputs["bearing_degC"][np.arange(count) % 10 > 0] = np.nan
    table = inputs | {
        "rise_Pa": predicted["rise_Pa"] - clogged + rng.normal(0, 4, flow.shape),
        "motor_current_A": predicted["motor_current_A"] + drag + rng.normal(0, 0.05, flow.shape),
    }
    return {"fan": np.tile(names, count), **{name: each.ravel() for name, each in table.items()}}


def test_the_whole_example_names_what_its_recording_conceals(fans: dict[str, Any]) -> None:
    """Its own effect in one column and one of the library in the other, each on its fans, in its units."""
    simulation = fans["Fans"]()
    answer = compare(duct(simulation), simulation).answer
    assert answer.verdict == "missing-physics"
    found = {(effect.name, effect.channel): effect for effect in answer.effects}
    assert set(found) == {("filter-clogging", "rise_Pa"), ("viscous-friction", "motor_current_A")}
    clogging, friction = found["filter-clogging", "rise_Pa"], found["viscous-friction", "motor_current_A"]
    assert (clogging.wheels, friction.wheels) == (("exhaust", "supply"), ("supply",))
    assert clogging.statement.startswith("A filter whose resistance grows with time, on both fans: ")
    loss = clogging.parameters["loss_per_second"]
    assert loss.low < 0.02 < loss.high
    assert loss.unit == "Pa s⁵/m⁶"
    assert friction.parameters["viscous_coefficient"].unit == "A/rpm^p"
    told = [*answer.notes, *(one.experiment for one in answer.indistinguishable)]
    assert any("without the channel rise_Pa: filter-clogging" in note for note in told)
    assert not any("to and fro" in text or "both ways" in text for text in told)


def test_friction_in_a_predict_is_not_known_where_a_noisy_speed_stands() -> None:
    """The page's lines give the friction's whole size in motion, and NaN within the sensor's noise at rest."""
    code = next(
        text for text in re.findall(r"```python\n(.*?)```", COVARIATES, flags=re.DOTALL) if "friction =" in text
    )
    rng, count = np.random.default_rng(2), 2000
    moving = np.repeat([1.0, 0.0, -1.0, 0.0], count // 4)
    speed = (moving + rng.normal(0, 0.01, count))[:, None]
    names: dict[str, Any] = {"values": {"friction_Nm": 3.0}, "inputs": {"speed_rad_s": speed}}
    exec(code, names)
    np.testing.assert_array_equal(names["friction"][moving != 0, 0], 3.0 * moving[moving != 0])
    assert np.mean(np.isfinite(names["friction"][moving == 0])) < 0.01


class Joint(Simulation):
    """A joint whose friction is known, in a law of its own near standstill."""

    channel, unit = "torque_Nm", "N·m"
    inputs = ("acceleration_rad_s2", "speed_rad_s")
    parameters: ClassVar = {"inertia_kg_m2": Prior(0.5, 0.01, "kg·m²"), "friction_Nm": Prior(0.4, 0.02, "N·m")}
    parameter_effects: ClassVar = {"friction_Nm": "coulomb-friction"}

    def __init__(self, law: Callable[[Array], Array | float]) -> None:
        self.law = law

    def predict(self, inputs: Mapping[str, Array], values: Mapping[str, float]) -> Array:
        """Return inertia and friction."""
        friction = values["friction_Nm"] * self.law(inputs["speed_rad_s"])
        return values["inertia_kg_m2"] * inputs["acceleration_rad_s2"] + friction

    def covariates(self, inputs: Mapping[str, Array]) -> dict[str, Array]:
        """Return the speed."""
        return {"wheel_speed": inputs["speed_rad_s"]}


def stop_and_go() -> dict[str, Array]:
    """Return a drive that stands for a third of the time, with noise of all sensors."""
    rng, count, step_s = np.random.default_rng(3), 4000, 0.05
    speed = np.convolve(np.repeat(rng.choice([-5.0, -2, 0, 0, 2, 5], count // 50), 50), np.ones(15) / 15, "same")
    speed[np.abs(speed) < 1e-9] = 0
    acceleration = np.gradient(speed, step_s)
    return {
        "t_s": step_s * np.arange(count),
        "torque_Nm": 0.5 * acceleration + 0.4 * np.sign(speed) + rng.normal(0, 0.08, count),
        "speed_rad_s": speed + rng.normal(0, 0.02, count),
        "acceleration_rad_s2": acceleration + rng.normal(0, 0.05, count),
    }


def test_friction_in_a_predict_is_written_as_the_page_says() -> None:
    """NaN at rest, a stated effect and a sign are consistent with such a machine; a law over a range is not."""
    recording = stop_and_go()
    resting = Joint(lambda speed: np.where(direction_of(speed) == 0, np.nan, np.sign(speed)))
    assert compare(recording, resting).answer.verdict == "consistent"
    without = Joint(lambda _: 0.0)
    without.parameters = {"inertia_kg_m2": Joint.parameters["inertia_kg_m2"], "friction_Nm": Prior(0.0)}  # type: ignore[misc]
    without.corrected_effects = (Contribution("coulomb-friction", {}, (0.4,), (1,), 0.05),)
    assert compare(recording, without).answer.verdict == "consistent"
    assert compare(recording, Joint(np.sign)).answer.verdict == "consistent"  # the smoothed speed is 0 at rest
    assert compare(recording, Joint(lambda speed: np.tanh(speed / 1.0))).answer.verdict != "consistent"


def test_rows_at_rest_of_a_joint_that_holds_its_friction_are_left_out_as_the_page_says() -> None:
    """The controller keeps the friction of the last motion as long as the joint dwells; it is named all the same."""
    code = next(text for text in re.findall(r"```python\n(.*?)```", COVARIATES, flags=re.DOTALL) if "moves =" in text)
    recording = stop_and_go()
    direction = direction_of(recording["speed_rad_s"][:, None])[:, 0]
    last = np.maximum.accumulate(np.where(direction != 0, np.arange(len(direction)), 0))
    recording["torque_Nm"] = recording["torque_Nm"] + np.where(direction == 0, 0.4 * direction[last], 0.0)

    class Dwelling(Joint):
        def predict(self, inputs: Mapping[str, Array], values: Mapping[str, float]) -> Array:
            """Return the inertia's torque, in motion alone."""
            names: dict[str, Any] = {"inputs": inputs, "torque": super().predict(inputs, values)}
            exec(code, {"np": np}, names)
            return np.asarray(names["torque"])

    joint = Dwelling(lambda _: 0.0)
    joint.parameters = {**Joint.parameters, "friction_Nm": Prior(0.0)}  # type: ignore[misc]
    answer = compare(recording, joint).answer
    assert (answer.verdict, [effect.name for effect in answer.effects]) == ("missing-physics", ["coulomb-friction"])
    coulomb = answer.effects[0].parameters["coulomb_current"]
    assert coulomb.low < 0.4 < coulomb.high


class Winding(Simulation):
    """A motor's current, and the temperature of its winding: by the predicted current, or by the recorded one."""

    channels: ClassVar = {"motor_current_A": "A", "winding_degC": "°C"}
    inputs = ("load_Nm", "speed_rad_s", "motor_current_A")
    parameters: ClassVar = {"current_per_load": Prior(0.5, 0.005, "A/(N·m)"), "heating": Prior(8.0, 0.1, "K/(s A²)")}

    def __init__(self, *, recorded: bool) -> None:
        self.recorded = recorded

    def predict(self, inputs: Mapping[str, Array], values: Mapping[str, float]) -> Any:
        """Return both columns."""
        current = values["current_per_load"] * inputs["load_Nm"]
        heated_by = inputs["motor_current_A"] if self.recorded else current
        return {"motor_current_A": current, "winding_degC": heated(heated_by, values["heating"])}

    def covariates(self, inputs: Mapping[str, Array]) -> dict[str, Array]:
        """Return the speed."""
        return {"wheel_speed": inputs["speed_rad_s"]}


def heated(current: Array, heating: float, step_s: float = 0.5) -> Array:
    """Return a winding's temperature [°C], (time, wheel): warmed by the current, cooled to 20 °C within 150 s."""
    warmed = step_s * heating / 100 * np.concatenate([np.zeros((1, *current.shape[1:])), current[:-1] ** 2])
    return np.asarray(20 + lfilter([1.0], [1.0, step_s / 150 - 1], warmed, axis=0))


@pytest.mark.parametrize(("recorded", "verdict"), [(False, "unexplained"), (True, "missing-physics")])
def test_friction_that_heats_a_winding_is_named_in_the_current_alone(recorded: bool, verdict: str) -> None:
    """The temperature is unexplained where it follows from the predicted current, and not where from the recorded."""
    rng, time_s = np.random.default_rng(2), 0.5 * np.arange(3000)
    load = 2 + np.sin(0.17 * time_s) + 0.5 * np.sin(0.56 * time_s)
    speed = np.choose((time_s // 60).astype(int) % 4, [1.0, -1.0, 1.0, 0.0]) * (1 + 0.5 * np.sin(0.065 * time_s))
    current = 0.5 * load + 0.3 * np.sign(speed) + rng.normal(0, 0.001, len(time_s))
    winding = heated(current[:, None], 8.0)[:, 0] + rng.normal(0, 0.1, len(time_s))
    columns = {"t_s": time_s, "load_Nm": load, "speed_rad_s": speed, "motor_current_A": current}
    answer = compare(columns | {"winding_degC": winding}, Winding(recorded=recorded)).answer
    assert [(each.name, each.channel) for each in answer.effects] == [("coulomb-friction", "motor_current_A")]
    assert answer.effects[0].wheels == (1,)
    assert answer.verdict == verdict
    assert all(rest.channel == "winding_degC" for rest in answer.unexplained)


def test_an_effect_is_kept_out_of_one_column_as_the_page_says() -> None:
    """It is looked for in the other, and in both without that."""
    code = next(text for text in re.findall(r"```python\n(.*?)```", PAGE, flags=re.DOTALL) if "kept_out_of" in text)
    names: dict[str, Any] = {}
    exec(code, names)
    rng, time_s = np.random.default_rng(3), 0.5 * np.arange(600)
    load = 2 + np.sin(0.17 * time_s) + 0.5 * np.sin(0.56 * time_s)
    current = 0.5 * load + rng.normal(0, 0.01, len(time_s))
    winding = heated(current[:, None], 8.0)[:, 0] + rng.normal(0, 0.1, len(time_s))
    columns = {"t_s": time_s, "load_Nm": load, "speed_rad_s": np.sin(0.3 * time_s), "motor_current_A": current}

    def looked_for(simulation: Simulation) -> set[str]:
        answer = compare(columns | {"winding_degC": winding}, simulation).answer
        shown = [each for each in answer.sensitivity if np.isfinite(each.smallest_detectable)]
        return {each.channel for each in shown if each.name == "sensor-delay"}

    assert looked_for(Winding(recorded=True)) == {"motor_current_A", "winding_degC"}
    limited = type("Limited", (Winding,), {"candidates": names["candidates"]})
    assert looked_for(limited(recorded=True)) == {"motor_current_A"}


class Climber(Simulation):
    """A cart on slopes whose force lacks the weight; a brake holds it where it stands."""

    channel, unit = "force_N", "N"
    inputs = ("speed_m_s", "pitch_rad", "brake")
    parameters: ClassVar = {"friction_N": Prior(2.0, 0.1, "N")}

    def __init__(self, covariates: Callable[[Any, Any], dict[str, Array]]) -> None:
        self._covariates = covariates

    def predict(self, inputs: Mapping[str, Array], values: Mapping[str, float]) -> Array:
        """Return the friction; under the brake the drive has no force."""
        return np.where(inputs["brake"] > 0, 0.0, values["friction_N"] * np.sign(inputs["speed_m_s"]))

    def covariates(self, inputs: Mapping[str, Array]) -> dict[str, Array]:
        """Return speed and pitch."""
        return self._covariates(self, {**inputs, "speed_rad_s": inputs["speed_m_s"]})


def test_a_brake_carries_the_weight_on_a_slope_as_the_page_says() -> None:
    """The rows under the brake make the weight too small, unless they have no pitch."""
    code = next(text for text in re.findall(r"```python\n(.*?)```", COVARIATES, flags=re.DOTALL) if "held =" in text)
    names: dict[str, Any] = {"np": np}
    exec(code, names)
    rng, time_s = np.random.default_rng(4), 0.5 * np.arange(3000)
    speed = np.choose((time_s // 40).astype(int) % 4, [1.0, 0.0, -1.0, 0.0])
    pitch = np.repeat(rng.uniform(-0.15, 0.15, 150), 20)
    force = np.where(speed == 0, 0.0, 2 * np.sign(speed) + 10 * np.sin(pitch)) + rng.normal(0, 0.4, len(time_s))
    columns = {"t_s": time_s, "speed_m_s": speed, "pitch_rad": pitch, "brake": np.float64(speed == 0), "force_N": force}
    (grade,) = compare(columns, Climber(names["covariates"])).answer.effects
    assert grade.name == "grade-resistance"
    assert grade.parameters["grade_current"].low < 10 < grade.parameters["grade_current"].high
    as_read = compare(
        columns, Climber(lambda _, inputs: {"wheel_speed": inputs["speed_m_s"], "pitch": inputs["pitch_rad"]})
    )
    assert all(each.parameters["grade_current"].high < 9 for each in as_read.answer.effects if each.name == grade.name)
