"""Effects that explain a fleet's recordings as well as those that were named."""

from __future__ import annotations

from dataclasses import replace
from typing import ClassVar

import numpy as np
import pytest
from synthetic_fleet import DRAG, WEAR, Drive, drive, equations_of, on_both, term

from regolithd.calibration.mismatch.candidates.candidate import Candidate, Coefficient
from regolithd.calibration.mismatch.fleet.choice.courses import Course
from regolithd.calibration.mismatch.fleet.choice.equations import FleetEquations, fleet_equations
from regolithd.calibration.mismatch.fleet.choice.search import places_of
from regolithd.calibration.mismatch.fleet.choice.selection import Chooser
from regolithd.calibration.mismatch.fleet.told.rivals import rivals
from regolithd.calibration.mismatch.fleet.work.grid import GridGroup
from regolithd.calibration.mismatch.simulation.simulation import Simulation


class Lookalike(Candidate):
    """A law whose column is nearly that of the drag."""

    name, covariate, words, experiment = "lookalike", "slip", "a lookalike", "vary the slip"
    coefficients = (Coefficient("alike"),)


class Machine(Simulation):
    """A machine that calls the speed by a name of its own."""

    channel = "current_A"
    covariate_labels: ClassVar = {"wheel_speed": "carriage speed (m/s)"}
    unloaded_experiment = "run with the wheels lifted"


def alike(share: float, size: float) -> FleetEquations:
    """Return a rover's recordings with a drag; the column of the lookalike has so much of the drag's."""
    drives = []
    for n in range(4):
        made = drive(n, on_both(1, size))
        columns = made.columns.copy()
        columns[3] = share * columns[1] + np.sqrt(1 - share**2) * columns[3]
        drives.append(Drive(columns, made.residual))
    groups = (DRAG, WEAR, GridGroup(Lookalike(), {}, (3,), 1))
    sums = [replace(each.sums(), places=((1,), (2,), (3,))) for each in drives]
    return fleet_equations(sums, (0,) * 4, range(4), groups, "rover")


def rivals_of_drag(of: FleetEquations) -> list[tuple[str, ...]]:
    """Return the sets of names that cannot be told apart where the drag was named."""
    chooser, fit = Chooser(of, places_of(of), 8.0), of.fit((term(DRAG, Course("always")),))
    return [one.effects for one in rivals(chooser, fit, Machine(), Machine.covariate_labels)]


def test_a_law_whose_column_is_alike_is_a_rival() -> None:
    """One that is hardly like it is none, and more data tell apart what is nearly alike."""
    assert rivals_of_drag(alike(0.999, 0.1)) == [("steady-drag", "lookalike")]
    assert rivals_of_drag(alike(0.9, 0.1)) == []
    assert rivals_of_drag(alike(0.999, 2.0)) == []


def test_a_law_of_exactly_the_same_column_is_always_a_rival() -> None:
    """No amount of data tells them apart."""
    assert rivals_of_drag(alike(1.0, 5.0)) == [("steady-drag", "lookalike")]


def test_an_effect_alone_has_no_rivals() -> None:
    """Laws that explain little in its place could not be true."""
    of = equations_of([drive(n, on_both(1, 0.2)) for n in range(4)], (0,) * 4)
    assert rivals_of_drag(of) == []


def test_a_rival_may_be_inacceptable() -> None:
    """Its coefficient has the wrong sign: its column is that of the drag, turned round."""
    assert rivals_of_drag(alike(-0.999, 0.1)) == []


def test_the_experiment_varies_the_covariate_of_each() -> None:
    """In the machine's own words; unloaded where one of them asks for it and the machine can."""
    of = alike(0.9999, 0.1)
    chooser, fit = Chooser(of, places_of(of), 8.0), of.fit((term(DRAG, Course("always")),))
    (one,) = rivals(chooser, fit, Machine(), Machine.covariate_labels)
    assert one.experiment == "Drive at several carriage speeds; then vary the slip."
    assert (one.vary, one.lift, one.duration_s) == (("wheel_speed", "slip"), False, 0.0)


class OneWay(Machine):
    """The same machine, which cannot reverse."""

    one_way = True


class Reversed(Lookalike):
    """A law that a reversal shows, or several speeds do."""

    experiment, experiment_one_way = "run to and fro", "hold several values of the {wheel_speed}"
    vary = ("direction",)


def test_a_machine_that_runs_one_way_is_asked_for_no_reversal() -> None:
    """The experiment is that of a machine that runs one way, in the words of the recording where none are stated."""
    of = alike(0.9999, 0.1)
    of = replace(of, groups=(DRAG, WEAR, GridGroup(Reversed(), {}, (3,), 1)))
    chooser, fit = Chooser(of, places_of(of), 8.0), of.fit((term(DRAG, Course("always")),))
    (one,) = rivals(chooser, fit, OneWay(), {"wheel_speed": "rake_rad_s"})
    assert "hold several values of the rake" in one.experiment
    assert one.vary == ("wheel_speed",)
    (one,) = rivals(chooser, fit, Machine(), {})
    assert "run to and fro" in one.experiment
    assert one.vary == ("wheel_speed", "direction")


@pytest.mark.parametrize(("can_lift", "told"), [(True, "; then run with the wheels lifted"), (False, "")])
def test_an_experiment_without_load_is_told_where_the_machine_can(can_lift: bool, told: str) -> None:
    """After the others."""
    unloaded = replace(DRAG, candidate=type("Unloaded", (type(DRAG.candidate),), {"run_unloaded": True})())
    of = alike(0.9999, 0.1)
    of = replace(of, groups=(unloaded, *of.groups[1:]))
    machine = Machine() if can_lift else type("Fixed", (Machine,), {"unloaded_experiment": ""})()
    (one,) = rivals(
        Chooser(of, places_of(of), 8.0), of.fit((term(unloaded, Course("always")),)), machine, machine.covariate_labels
    )
    assert one.experiment == f"Drive at several carriage speeds; then vary the slip{told}."
    assert one.lift == can_lift
