"""A named effect beside what comes and goes keeps its name."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace
from typing import TYPE_CHECKING, ClassVar

import numpy as np
import pytest
from linear_machine import AXES, INSTANTS, NOISE, equations_of, problem_of, table, term_of

from regolithd.calibration.mismatch import Prior, Simulation, compare
from regolithd.calibration.mismatch.data.recording import from_columns
from regolithd.calibration.mismatch.inference.beside_spells import that_gain
from regolithd.calibration.mismatch.regression.group import Term

if TYPE_CHECKING:
    from collections.abc import Mapping

    from numpy.typing import NDArray

    from regolithd.calibration.mismatch.answer import Answer

    Array = NDArray[np.float64]

ROWS, STEP_S = 5000, 0.2


class Rake(Simulation):
    """Current of a drive that ploughs a bed, at a few speeds one after the other."""

    channel, unit = "rake_current_A", "A"
    inputs = ("rake_rad_s", "bed_kg")
    parameters: ClassVar = {"per_kg": Prior(0.012, 0.0002, "A/kg")}
    one_way = True
    without_effects = ("grade-resistance", "turning-resistance", "slip-sinkage", "soil-transition", "load-cell-drift")

    def predict(self, inputs: Mapping[str, Array], values: Mapping[str, float]) -> Array:
        """Return the current."""
        return values["per_kg"] * inputs["bed_kg"]

    def covariates(self, inputs: Mapping[str, Array]) -> dict[str, Array]:
        """Return the speed."""
        return {"wheel_speed": inputs["rake_rad_s"]}


def raked(quadratic: float, spells: float) -> Answer:
    """Compare 1000 s at eight speeds with a drag of their square, and with one that comes and goes for 8 s or so."""
    rng = np.random.default_rng(11)
    time_s = STEP_S * np.arange(ROWS)
    speed = np.repeat(rng.permutation(np.linspace(0.04, 0.12, 8)), ROWS // 8)
    bed = 500 + 120 * np.sin(time_s / 90) + 60 * np.sin(time_s / 37)
    acting, now = np.zeros(ROWS), 0.0
    for row in range(ROWS):
        now = now if rng.random() > STEP_S / (8.0 if now else 25.0) else 1 - now
        acting[row] = now
    noise = np.convolve(rng.normal(0, 1, ROWS + 3), np.ones(4) / 2, "valid")
    current = 0.012 * bed + quadratic * (speed / 0.1) ** 2 + spells * acting + 0.4 * noise
    columns = {"t_s": time_s, "rake_rad_s": speed, "bed_kg": bed, "rake_current_A": current}
    return compare(from_columns(columns), Rake()).answer


def test_a_drag_is_named_beside_spells() -> None:
    """The speed changes as seldom as the spells come: a curve over time would follow both."""
    found = raked(quadratic=0.8, spells=2.0)
    assert found.verdict == "unexplained"
    assert [place.covariate for place in found.unexplained] == ["time"]
    assert [effect.name for effect in found.effects] == ["quadratic-drag"]


def test_spells_alone_get_no_name() -> None:
    """What follows a law beside them is their noise."""
    found = raked(quadratic=0.0, spells=2.0)
    assert found.verdict == "unexplained"
    assert found.effects == ()


class Rollers(Simulation):
    """Current of three rollers: in proportion to the press force, against the motion."""

    channel, unit = "roller_current_A", "A"
    inputs = ("roller_rad_s", "press_kN")
    parameters: ClassVar = {"per_kN": Prior(0.1, 0.003, "A/kN")}
    own_to_each_wheel = frozenset({"per_kN"})
    without_effects = ("grade-resistance", "turning-resistance", "slip-sinkage", "soil-transition", "load-cell-drift")

    def predict(self, inputs: Mapping[str, Array], values: Mapping[str, float]) -> Array:
        """Return the current."""
        return values["per_kN"] * inputs["press_kN"] * np.sign(inputs["roller_rad_s"])

    def covariates(self, inputs: Mapping[str, Array]) -> dict[str, Array]:
        """Return the speed, and what may be imitated."""
        return {
            "wheel_speed": inputs["roller_rad_s"],
            "spray": inputs["spray_L_min"],
            "temperature": inputs["oil_degC"],
        }


def rolled(seed: int) -> Answer:
    """Compare 400 s in which each roller drags for 15 s or so now and then, at times of its own."""
    rng, rows = np.random.default_rng(seed), 2000
    time_s = STEP_S * np.arange(rows)
    speed = np.repeat(rng.choice([-0.6, -0.3, 0.3, 0.6, 0.9], 40), rows // 40)
    press = np.repeat(rng.uniform(60, 140, 50), rows // 50)
    currents = []
    for _ in range(3):
        acting, now = np.zeros(rows), 0.0
        for row in range(rows):
            now = now if rng.random() > STEP_S / (15.0 if now else 25.0) else 1 - now
            acting[row] = now
        noise = np.convolve(rng.normal(0, 1, rows + 3), np.ones(4) / 2, "valid")
        currents.append((0.1 * press + 2.5 * acting) * np.sign(speed) + 1.2 * noise)
    of_all = {
        "t_s": time_s,
        "roller_rad_s": speed,
        "press_kN": press,
        "spray_L_min": 8 + 2 * np.sin(time_s / 21) + np.sin(time_s / 8),
        "oil_degC": 40 - 20 * np.exp(-time_s / 200),
    }
    columns = {name: np.repeat(values, 3) for name, values in of_all.items()}
    columns |= {"wheel": np.tile([1, 2, 3], rows), "roller_current_A": np.stack(currents, axis=1).ravel()}
    return compare(from_columns(columns), Rollers()).answer


@pytest.mark.parametrize("seed", [2, 5, 8], ids=["as-constant-friction", "as-a-curve-over-temperature", "as-noise"])
def test_spells_on_several_axes_are_told_over_time_without_a_name(seed: int) -> None:
    """The others' noise has spells, too, and a covariate that changes slowly imitates the mean of all."""
    found = rolled(seed)
    assert found.verdict == "unexplained"
    assert {place.covariate for place in found.unexplained} == {"time"}
    assert sum(len(place.wheels) for place in found.unexplained) >= 2
    assert found.effects == ()


@pytest.mark.parametrize("drag", [0.0, 0.3])
def test_of_the_names_those_stay_that_gain_beside_the_course_of_spells(drag: float) -> None:
    """A drag that is the mean of spells gains nothing beside their course; a constant one does."""
    acting = np.random.default_rng(3).random(INSTANTS // 5) < 0.4
    course = np.zeros((INSTANTS, AXES))
    course[:] = np.repeat(acting, 5)[:, None]
    equations = equations_of(problem_of(table(drag=drag + 0.8 * course)))
    direction = equations.problem.known("direction")
    design, (place,) = equations.design.extended([course * direction])
    equations = equations.over(design).weighted(np.full(AXES, NOISE**-2.0))
    term = term_of(equations, "drag")
    spells = Term(replace(term.group, columns=(place,), signs=(0,), candidate=None), term.wheels)
    named = equations.fit([term])
    beside = SimpleNamespace(equations=equations, named=named, unnamed=(spells,), entry_threshold=5.0)
    assert len(that_gain(beside).terms) == (drag > 0)  # type: ignore[arg-type]  # what it reads of a decision
