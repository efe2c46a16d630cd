"""What is told of a fleet: effects with rovers and dates, parameters, sensitivities, and the catalogue's rows."""

from __future__ import annotations

import json
from dataclasses import replace
from datetime import UTC, datetime, timedelta
from pathlib import Path
from typing import TYPE_CHECKING, ClassVar

import numpy as np
import pytest
from golden import assert_golden, rounded
from sample_answer import WORN
from synthetic_fleet import (
    COLUMNS,
    CURVE,
    DEVIATION,
    DRAG,
    GROUPS,
    KNOTS,
    WAVE,
    WEAR,
    drive,
    equations_of,
    on_both,
    term,
)

from regolithd.calibration.mismatch.answer import Unexplained
from regolithd.calibration.mismatch.candidates.stribeck_friction import StribeckFriction
from regolithd.calibration.mismatch.fleet.catalogue import catalogue_rows
from regolithd.calibration.mismatch.fleet.choice.courses import Course
from regolithd.calibration.mismatch.fleet.choice.equations import fleet_equations
from regolithd.calibration.mismatch.fleet.choice.search import penalty, places_of
from regolithd.calibration.mismatch.fleet.choice.selection import Chooser
from regolithd.calibration.mismatch.fleet.choice.terms import FleetTerm, Units
from regolithd.calibration.mismatch.fleet.told.chosen import Chosen, Names
from regolithd.calibration.mismatch.fleet.told.findings import NOT_CONFIRMED, answer_of_fleet
from regolithd.calibration.mismatch.fleet.work.found import Found, FoundTerm
from regolithd.calibration.mismatch.inference.findings import Findings
from regolithd.calibration.mismatch.problem.prior import Prior
from regolithd.calibration.mismatch.problem.problem import LeftOut
from regolithd.calibration.mismatch.simulation.simulation import Simulation

if TYPE_CHECKING:
    from collections.abc import Iterable, Sequence

    from regolithd.calibration.mismatch.fleet.choice.equations import FleetEquations, Level

GOLDEN = Path(__file__).parent / "golden"
FIRST = datetime(2026, 3, 1, 8, 0, tzinfo=UTC)
ROVER = (0, 1) * 4
SILENT = Findings("consistent", (), (), (), (), ())


class Machine(Simulation):
    """Two wheels whose current has a gain; a second parameter is known exactly."""

    channel, unit = "current_A", "A"
    parameters: ClassVar = {"gain": Prior(1.5, 0.2, "A/A"), "offset": Prior(0.1, 0.0, "A")}


def found(findings: Findings = SILENT, *terms: FoundTerm, last_s: float = 0.0) -> Found:
    """Return what one recording was found to show."""
    floor = float(np.sqrt(np.mean(DEVIATION**2)))
    return Found(findings, {}, DEVIATION, 1.0, floor, 8.0, terms, {}, last_s=last_s)


def chosen(
    equations: FleetEquations, terms: Iterable[FleetTerm], of_recordings: Sequence[Found], *, dated: bool = True
) -> Chosen:
    """Return the choice of these terms among recordings a day apart."""
    names = Names(
        tuple(f"rover {number}" for number in range(int(equations.rover.max()) + 1)),
        tuple(f"drive {number}" for number in range(equations.count)),
        tuple(FIRST + timedelta(days=number) if dated else None for number in range(equations.count)),
    )
    chooser = Chooser(equations, places_of(equations), 8.0)
    return Chosen(chooser, equations.fit(terms), names, tuple(of_recordings), Machine())


def consistent(level: Level = "rover", rover: Sequence[int] = ROVER, *, dated: bool = True) -> Chosen:
    """Return the choice of nothing among recordings of noise."""
    return chosen(
        equations_of([drive(n) for n in range(len(rover))], rover, level), (), [found()] * len(rover), dated=dated
    )


@pytest.fixture(scope="module")
def season() -> Chosen:
    """Return effects with a size for each rover, growing, and until a date; and findings of one recording alone."""
    drives = []
    for n, rover in enumerate(ROVER):
        concealed = {**on_both(1, 0.2 + 0.1 * rover), (0, 0): 0.05, (0, 1): 0.05}
        concealed |= {(2, 1): 0.1 * (n - 2) / 4} if rover == 0 and n > 2 else {}
        concealed |= on_both(3, 0.1) | on_both(4, 0.2) if rover == 1 and n < 5 else {}
        concealed |= {(2, 0): 0.3} if n == 3 else {}
        drives.append(drive(n, concealed))
    own = FoundTerm("bearing-drag", True, {}, (0,), 2.0, np.zeros((1, 1, 2), np.float32))
    curve = FoundTerm("voltage", False, {}, (0, 1), 2.0, np.zeros((1, 1, 2), np.float32))
    sums = [each.sums() for each in drives]
    sums[3] = replace(sums[3], own=((2,), (2,)))
    equations = fleet_equations(sums, ROVER, range(8), GROUPS, "rover")
    rest = Unexplained("current_A", ("left",), "voltage", 0.0, 60.0, 0.2)
    worn = replace(WORN, wheels=("left",), channel="current_A")
    shown = replace(SILENT, verdict="missing-physics", effects=(worn,), unexplained=(rest,))
    left_out = replace(
        SILENT,
        left_out=(LeftOut("current_A", 7, "an outlier"),),
        notes=("Stays unexplained.",),
        notes_on_recording=("It rained.",),
    )
    of_recordings = [found(left_out), found(left_out), *[found()] * 6]
    of_recordings[3] = found(shown, own, curve)
    terms = (
        FleetTerm(DRAG, Units((0, 1), (0, 1), each=True), Course("always")),
        term(WEAR, Course("growing", 4), wheels=(1,)),
        term(WAVE, Course("until", 5), rovers=(1,)),
    )
    return chosen(equations, terms, of_recordings)


def test_the_answer_of_a_season_is_the_reviewed_one(season: Chosen) -> None:
    """Every sentence, number, date, parameter and note of it."""
    told = json.dumps(rounded(answer_of_fleet(season).to_json()), indent=1, ensure_ascii=False)
    assert_golden(told + "\n", GOLDEN / "answer.json")


def test_the_catalogue_of_a_season_is_the_reviewed_one(season: Chosen) -> None:
    """One row for each recording, wheel and effect."""
    rows = catalogue_rows(season, answer_of_fleet(season))
    lines = [", ".join(str(rounded(value)) for value in vars(row).values()) for row in rows]
    assert_golden("\n".join(lines) + "\n", GOLDEN / "catalogue.txt")


def test_parameters_have_the_units_of_the_machine() -> None:
    """A speed in the law is in the unit of the column that is the speed, as in the answer of one recording."""
    drives = [drive(n, on_both(1, 0.3)) for n in range(4)]
    group = replace(DRAG, candidate=StribeckFriction(), shape={"stribeck_speed_rad_s": 0.05, "fades": "exponent 1"})
    always = FleetTerm(group, Units((0,), (0, 1)), Course("always"))
    in_metres = replace(found(), labels={"wheel_speed": "carriage speed (m/s)"})
    equations = replace(equations_of(drives, (0,) * 4), groups=(group, *GROUPS[1:]))
    (effect,) = answer_of_fleet(chosen(equations, (always,), [in_metres] * 4)).effects
    assert effect.parameters["stribeck_speed_rad_s"].unit == "m/s"
    assert effect.form == "exponential"
    assert effect.statement.startswith(
        "Extra drag near standstill that decays with speed (exponential), on both wheels: "
    )


def test_each_effect_pays_in_held_out_error_where_it_acts(season: Chosen) -> None:
    """Left out, it makes the error of its own recordings and wheels larger."""
    effects = answer_of_fleet(season).effects
    assert all(effect.rmse_before > effect.rmse_after for effect in effects[:3])
    worn = effects[1]
    acting = [season.names.recordings.index(name) for name in worn.recordings]
    assert acting == [4, 6]
    assert worn.rmse_after == pytest.approx(DEVIATION[1], rel=0.15)


def test_what_is_told_of_the_fit_is_on_recordings_that_did_not_fit_it(season: Chosen) -> None:
    """Without effects it is the same before and after; the noise floor is that of the recordings' own noise."""
    fit = answer_of_fleet(season).fit
    assert fit.held_out_rmse_after < 0.8 * fit.held_out_rmse_before
    nothing = answer_of_fleet(consistent()).fit
    assert nothing.held_out_rmse_before == nothing.held_out_rmse_after
    assert nothing.noise_floor_rmse == pytest.approx(np.sqrt(np.mean(DEVIATION**2)))
    assert nothing.held_out_rmse_after == pytest.approx(nothing.noise_floor_rmse, rel=0.05)


def test_a_noise_floor_is_no_higher_than_what_is_left(season: Chosen) -> None:
    """Where recordings alone show nothing of what all together show, each of them leaves more than all together."""
    found = tuple(replace(each, noise_floor=10 * each.noise_floor) for each in season.found)
    fit = answer_of_fleet(replace(season, found=found)).fit
    assert 0.9 * fit.held_out_rmse_after < fit.noise_floor_rmse < fit.held_out_rmse_after


def test_whose_parameter_left_its_prior_and_since_when_is_in_the_catalogue() -> None:
    """With its value in each recording of that rover alone, and whether that excludes the stated value."""
    shifted = {(0, 0): 1.6, (0, 1): 1.6}
    drives = [drive(n, shifted if n in {5, 7} else {}) for n in range(8)]
    one = chosen(equations_of(drives, ROVER), (), [found()] * 8)
    answer = answer_of_fleet(one)
    assert [each.told_name for each in answer.parameters if each.beyond_prior()] == ["gain of rover 1"]
    rows = [row for row in catalogue_rows(one, answer) if row.found == "parameter"]
    assert [(row.rover, row.recording, row.acts) for row in rows] == [
        ("rover 1", f"drive {n}", n in {5, 7}) for n in (1, 3, 5, 7)
    ]
    for row in rows:
        assert row.parameter == "gain"
        assert row.value == pytest.approx(1.5 + (1.6 if row.acts else 0.0), abs=0.05)


@pytest.mark.parametrize(
    ("level", "owners"),
    [("shared", [("rover 0", "rover 1")]), ("rover", [("rover 0",), ("rover 1",)]), ("recording", [])],
)
def test_parameters_are_told_of_their_owners(level: Level, owners: list[tuple[str, ...]]) -> None:
    """Of the fleet or of each rover, those of every recording being too many; what is known exactly stays."""
    told = answer_of_fleet(consistent(level)).parameters
    assert [parameter.rovers for parameter in told] == [owner for owner in owners for _ in range(2)]
    for parameter in told:
        reach = parameter.high - parameter.value
        assert parameter.low == pytest.approx(parameter.value - reach)
        assert (reach == 0.0) == (parameter.name == "offset")
        assert abs(parameter.value - parameter.prior) < 0.05


def test_a_parameter_that_leaves_its_prior_is_a_finding() -> None:
    """Although nothing is missing from the simulation."""
    drives = [drive(n, {(0, 0): 0.9, (0, 1): 0.9}) for n in range(4)]
    answer = answer_of_fleet(chosen(equations_of(drives, (0,) * 4), (), [found()] * 4))
    assert (answer.verdict, answer.effects) == ("missing-physics", ())
    assert answer.parameters[0].value == pytest.approx(1.5 + 0.9, abs=0.02)
    assert answer_of_fleet(consistent()).verdict == "consistent"


def test_the_smallest_effect_that_shows_is_where_it_would_be_found() -> None:
    """Its energy outside the parameters must be worth threshold, penalty and the probability of finding it."""
    nothing = consistent()
    told = {one.name: one.smallest_detectable for one in answer_of_fleet(nothing).sensitivity}
    assert list(told) == ["steady-drag", "wave", "wear"]
    equations = nothing.equations
    drag = FleetTerm(DRAG, Units((0, 1), (0, 1)), Course("always"))
    needed = np.sqrt(8.0 + penalty(equations, drag)) + 1.2816
    readings = 8 * 120 * 2
    mean_square = np.mean([each.gram[:, 1, 1] for each in equations.sums]) / 120
    noise = 1 / np.mean(1 / DEVIATION**2)
    assert told["steady-drag"] == pytest.approx(max(needed * np.sqrt(mean_square * noise / readings), 0.02), rel=0.05)
    assert told["wear"] > told["steady-drag"]


def test_an_effect_that_has_no_place_shows_never() -> None:
    """A change by its nature needs a second recording; what the simulation can imitate is not seen."""
    one = consistent(rover=(0,))
    told = {each.name: each.smallest_detectable for each in answer_of_fleet(one).sensitivity}
    assert told["wear"] == float("inf")
    assert np.isfinite(told["steady-drag"])


def test_recordings_without_dates_are_told_by_their_names() -> None:
    """There is no `since`; the sentence has the recording's name."""
    drives = [drive(n, on_both(1, 0.3) if n >= 2 else None) for n in range(4)]
    equations = equations_of(drives, (0,) * 4)
    answer = answer_of_fleet(chosen(equations, (term(DRAG, Course("since", 2)),), [found()] * 4, dated=False))
    (effect,) = answer.effects
    assert (effect.since, effect.since_low, effect.since_high) == (None, None, None)
    assert "on both wheels since drive 2: 30 % of the mean reading" in effect.statement
    assert (answer.rovers[0].first, answer.rovers[0].last) == (None, None)


@pytest.mark.parametrize(
    ("rainy", "told"),
    [
        ((0,), "drive 0: It rained."),
        ((0, 2, 3), "drive 0, drive 2, drive 3: It rained."),
        ((0, 1, 2, 3), "drive 0, drive 1 and 2 more: It rained."),
        (range(5), "All recordings: It rained."),
    ],
)
def test_a_note_of_several_recordings_is_told_once(rainy: Sequence[int], told: str) -> None:
    """With the recordings that it is of; what was decided of one recording alone is not told."""
    noted = found(replace(SILENT, notes=("Gain had to leave its prior.",), notes_on_recording=("It rained.",)))
    of_recordings = [noted if n in rainy else found() for n in range(5)]
    answer = answer_of_fleet(chosen(equations_of([drive(n) for n in range(5)], (0,) * 5), (), of_recordings))
    assert answer.notes == (told,)


def test_the_size_in_a_recording_is_beside_what_that_shows_itself() -> None:
    """An effect of one recording that is like the fleet's does not count in its size there."""
    drives = [drive(n, on_both(1, 0.3)) for n in range(4)]
    columns = drives[3].columns.copy()
    columns[2] = 0.6 * columns[1] + 0.8 * columns[2]
    residual = drives[3].residual + 0.5 * columns[2]
    sums = [each.sums() for each in (*drives[:3], replace(drives[3], columns=columns, residual=residual))]
    sums[3] = replace(sums[3], own=((2,),))
    own = FoundTerm("time", False, {}, (0, 1), 2.0, np.zeros((1, 1, 2), np.float32))
    rest = Unexplained("current_A", ("left", "right"), "time", 0.0, 60.0, 0.2)
    of_recordings = [*[found()] * 3, found(replace(SILENT, unexplained=(rest,)), own)]
    equations = fleet_equations(sums, (0,) * 4, range(4), GROUPS, "rover")
    one = chosen(equations, (term(DRAG, Course("always")),), of_recordings)
    sizes = [row.value for row in catalogue_rows(one, answer_of_fleet(one)) if row.found == "fleet"]
    assert sizes == pytest.approx([0.3] * 8, abs=0.03)


def test_on_a_machine_of_one_wheel_a_fault_of_one_wheel_is_one_of_a_rover() -> None:
    """It has a smallest size that would show."""
    one = consistent()
    assert one.equations.groups[1].candidate.sharing == ("one",)
    sums = [
        replace(
            each,
            wheels=("left",),
            **{name: getattr(each, name)[:1] for name in ("gram", "moment", "fourth", "energy", "counts", "weights")},
            blocks=each.blocks[:, :1],
        )
        for each in one.equations.sums
    ]
    equations = fleet_equations(sums, ROVER, range(8), GROUPS, "rover")
    told = {
        each.name: each.smallest_detectable for each in answer_of_fleet(chosen(equations, (), one.found)).sensitivity
    }
    assert np.isfinite(told["wear"])


def test_a_curve_is_told_with_its_recordings_and_their_dates() -> None:
    """And how much of what the recordings leave without it, it is."""
    bend = {place: size for knot in range(KNOTS) for place, size in on_both(COLUMNS + knot, 0.1 * (-1) ** knot).items()}
    drives = [drive(n, bend if n in {4, 6} else {}, COLUMNS + KNOTS) for n in range(8)]
    of = chosen(equations_of(drives, ROVER), (term(CURVE, Course("since", 4)),), [found(last_s=n) for n in range(8)])
    answer = answer_of_fleet(of)
    (rest,) = answer.unexplained
    assert (answer.verdict, answer.effects) == ("unexplained", ())
    assert (rest.covariate, rest.rovers, rest.recordings) == ("load", ("rover 0",), ("drive 4", "drive 6"))
    assert (rest.since, rest.until, rest.to_s) == ("2026-03-05T08:00:00Z", None, 6.0)
    assert rest.told_where == "drive 4 and drive 6 of rover 0 since 2026-03-05 08:00"
    own, noise = KNOTS * 0.1**2, float(np.mean(DEVIATION**2))
    assert rest.share_of_residual == pytest.approx(own / (own + noise), rel=0.15)
    assert rest.curve is not None
    assert rest.curve.at == tuple(range(KNOTS))
    inside = [
        low <= 0.1 * (-1) ** knot <= high
        for knot, low, high in zip(range(KNOTS), rest.curve.low, rest.curve.high, strict=True)
    ]
    assert sum(inside) >= KNOTS - 2
    assert (rest.curve.coupling, rest.curve.unit, rest.curve.magnitude) == ("offset", "A", False)
    assert rest.curve.helps_held_out


def test_an_error_that_does_not_fall_is_told() -> None:
    """What acts in one recording of a rover has no other that could confirm it."""
    drives = [drive(n, on_both(1, 0.4) if n == 6 else {}) for n in range(8)]
    equations = equations_of(drives, ROVER, "recording")
    in_one = answer_of_fleet(chosen(equations, (term(DRAG, Course("since", 6)),), [found()] * 8))
    assert in_one.notes[-1] == NOT_CONFIRMED
    drives = [drive(n, on_both(1, 0.4)) for n in range(8)]
    in_all = chosen(equations_of(drives, ROVER), (term(DRAG, Course("always"), (0, 1)),), [found()] * 8)
    assert NOT_CONFIRMED not in answer_of_fleet(in_all).notes
