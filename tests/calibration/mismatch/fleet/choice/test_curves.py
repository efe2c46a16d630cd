"""Curves that the recordings of a fleet have in common, against its names."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
import pytest
from sample_answer import FINDINGS
from synthetic_fleet import (
    COLUMNS,
    CURVE,
    DEVIATION,
    DRAG,
    KNOTS,
    PRIOR_STD,
    Drive,
    drive,
    equations_of,
    on_both,
    term,
)

from regolithd.calibration.mismatch.fleet.choice import curves
from regolithd.calibration.mismatch.fleet.choice.courses import Course
from regolithd.calibration.mismatch.fleet.choice.curves import with_curves
from regolithd.calibration.mismatch.fleet.choice.recordings import Shown
from regolithd.calibration.mismatch.fleet.choice.search import further, places_of
from regolithd.calibration.mismatch.fleet.choice.selection import Chooser
from regolithd.calibration.mismatch.fleet.work.found import Found
from regolithd.calibration.mismatch.problem.prior import Prior

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from regolithd.calibration.mismatch.fleet.choice.equations import FleetEquations
    from regolithd.calibration.mismatch.fleet.choice.terms import FleetFit

ROVER = (0, 1) * 4
"""Whose each of eight recordings is."""
BEND = {place: size for knot in range(KNOTS) for place, size in on_both(COLUMNS + knot, 0.03 * (-1) ** knot).items()}
"""A curve on both wheels, a fifth of the noise at each knot."""


def drives(concealed: Sequence[Mapping[tuple[int, int], float]]) -> list[Drive]:
    """Return recordings with these effects, and the columns of a curve."""
    return [drive(seed, each, COLUMNS + KNOTS) for seed, each in enumerate(concealed)]


def chosen(of: Sequence[Drive]) -> tuple[FleetFit, FleetFit]:
    """Return the names that are chosen alone, and what is chosen of names and curves."""
    equations = equations_of(of, ROVER)
    chooser = Chooser(equations, places_of(equations), 8.0)
    names = chooser.chosen()
    found = [Found(FINDINGS, {}, DEVIATION, 1.0, 0.1, 10.0, (), {})] * len(of)
    return names, with_curves(chooser, names, found, {"gain": Prior(1.5, PRIOR_STD, "A/A")})


def test_a_curve_of_all_recordings_is_found_without_a_name() -> None:
    """One too weak for a single recording, on both rovers, from the start."""
    names, found = chosen(drives([BEND] * 8))
    assert names.terms == ()
    assert found.terms == (term(CURVE, Course("always"), (0, 1)),)
    assert found.coefficients[found.spans[0]] == pytest.approx([0.03 * (-1) ** knot for knot in range(KNOTS)], abs=0.02)


def test_a_curve_of_one_rover_has_its_rover_and_its_date() -> None:
    """Since its third recording."""
    (found,) = chosen(drives([{}, {}, {}, {}, BEND, {}, BEND, {}]))[1].terms
    assert (found.group, found.units.rovers, found.course) == (CURVE, (0,), Course("since", 4))


def test_nothing_has_no_curve() -> None:
    """Nor a name."""
    assert chosen(drives([{}] * 8))[1].terms == ()


def test_a_law_keeps_its_name_where_a_curve_explains_no_more() -> None:
    """A curve beside it would pay for eight coefficients."""
    names, found = chosen(drives([on_both(1, 0.1)] * 8))
    assert names.terms == found.terms == (term(DRAG, Course("always"), (0, 1)),)


def test_a_name_beside_a_curve_keeps_its_name() -> None:
    """Where it gains what a name has to, and the curve is of something else."""
    found = chosen(drives([{**BEND, **on_both(1, 0.1)}] * 8))[1]
    assert found.named == (term(DRAG, Course("always"), (0, 1)),)
    assert found.curves == (term(CURVE, Course("always"), (0, 1)),)
    assert found.terms == (*found.named, *found.curves)


def test_a_name_that_imitates_a_curve_goes() -> None:
    """A part of what the curve explains leaks into a law whose column is like one of its knots."""
    imitated = []
    for each in drives([BEND] * 8):
        columns = each.columns.copy()
        columns[1] = 0.8 * sum((-1) ** knot * columns[COLUMNS + knot] for knot in range(KNOTS)) / np.sqrt(KNOTS)
        columns[1] += 0.6 * each.columns[1]
        imitated.append(Drive(columns, each.residual))
    names, found = chosen(imitated)
    assert [each.name for each in names.terms] == ["steady-drag"]
    assert found.terms == (term(CURVE, Course("always"), (0, 1)),)


@pytest.mark.parametrize(("alone", "named"), [(0, True), (1, True), (2, False)])
def test_a_law_that_is_a_little_wrong_keeps_its_name(alone: int, named: bool, monkeypatch: pytest.MonkeyPatch) -> None:
    """A curve explains a twelfth more; but two findings of single recordings beside the law are too many."""

    def shown(_: FleetEquations, fit: FleetFit, __: Sequence[Found]) -> Shown:
        findings = () if fit.curves else tuple((n, FINDINGS.effects[0]) for n in range(alone))
        return Shown(findings, (), (), ())

    imitated = []
    for seed, each in enumerate(drives([{}] * 8)):
        columns, own = each.columns.copy(), np.random.default_rng(seed + 50).normal(size=each.residual.shape)
        knots = sum(columns[COLUMNS + knot] for knot in range(KNOTS))
        columns[1] = np.sqrt(0.92 / KNOTS) * knots + np.sqrt(0.08) * own
        imitated.append(Drive(columns, each.residual + 0.06 * knots))
    monkeypatch.setattr(curves, "shown_beside", shown)
    names, found = chosen(imitated)
    assert names.terms == (term(DRAG, Course("always"), (0, 1)),)
    assert found.terms == (names.terms if named else (term(CURVE, Course("always"), (0, 1)),))


def test_a_parameter_that_was_stated_wrongly_is_no_curve() -> None:
    """One of which the tangent is like a curve: the prior holds it, and the curve would explain the rest."""
    wrong = []
    for each in drives([{}] * 8):
        columns = each.columns.copy()
        columns[0] = 0.1 * sum(columns[COLUMNS + knot] for knot in range(KNOTS)) / np.sqrt(KNOTS)
        wrong.append(Drive(columns, each.residual + 6 * PRIOR_STD * columns[0]))
    equations = equations_of(wrong, ROVER)
    (_, best), *_ = further(equations, equations.fit(()), places_of(equations), equations.curve_groups)
    assert best.group == CURVE
    assert chosen(wrong)[1].terms == ()


def test_a_rover_shows_a_curve_by_all_of_its_knots_together() -> None:
    """One knot that is far from 0 by chance is none."""
    equations = equations_of(drives([BEND if rover == 0 else {} for rover in ROVER]), ROVER)
    chooser = Chooser(equations, places_of(equations), 1.0)
    fit = equations.fit((term(CURVE, Course("always"), (0, 1)),))
    assert chooser.showing(fit, 0) == (0,)
