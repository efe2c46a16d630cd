"""Names of a fleet against what its recordings show by themselves: what leaks from a curve earns no name."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np
import pytest
from sample_answer import FINDINGS
from synthetic_fleet import DEVIATION, DRAG, GROUPS, PRIOR_STD, Drive, drive, term

from regolithd.calibration.mismatch.fleet.choice.courses import Course
from regolithd.calibration.mismatch.fleet.choice.earned import earned
from regolithd.calibration.mismatch.fleet.choice.equations import fleet_equations
from regolithd.calibration.mismatch.fleet.choice.recordings import shown_beside
from regolithd.calibration.mismatch.fleet.choice.search import places_of
from regolithd.calibration.mismatch.fleet.choice.selection import Chooser
from regolithd.calibration.mismatch.fleet.work.found import Found, FoundTerm

if TYPE_CHECKING:
    from collections.abc import Sequence

    from regolithd.calibration.mismatch.fleet.choice.equations import FleetEquations
    from regolithd.calibration.mismatch.fleet.choice.terms import FleetFit

CURVE = 4
"""The column over which recordings have a curve here."""
ENTRY = 8.0
ALWAYS = term(DRAG, Course("always"))


def recorded(seed: int, drag: float, curve: float, likeness: float = 0.0) -> Drive:
    """Return a recording with a drag and a curve; `likeness` is their columns' correlation."""
    plain = drive(seed)
    columns = plain.columns.copy()
    columns[CURVE] = likeness * columns[1] + np.sqrt(1 - likeness**2) * columns[CURVE]
    return Drive(columns, plain.residual + drag * columns[1] + curve * columns[CURVE])


def equations(drives: Sequence[Drive], curves: bool = True) -> FleetEquations:
    """Return one rover's recordings, each with a curve of its own."""
    own = ((CURVE,),) if curves else ()
    sums = [replace(each.sums(), own=own) for each in drives]
    return fleet_equations(sums, (0,) * len(sums), range(len(sums)), GROUPS, "rover")


def found(of: FleetEquations) -> list[Found]:
    """Return what the recordings were found to show."""
    curve = FoundTerm("voltage", False, {}, (0, 1), 2.0, np.zeros((1, 1, 2), np.float32))
    return [Found(FINDINGS, {}, DEVIATION, 1.0, 0.1, 10.0, (curve,) if each.own else (), {}) for each in of.sums]


def kept(of: FleetEquations) -> FleetFit:
    """Return what is left of a drag on all wheels."""
    return earned(Chooser(of, places_of(of), ENTRY), of.fit((ALWAYS,)), found(of))


def test_what_leaks_from_curves_has_no_name() -> None:
    """Alone it would gain much; beside the curves that stay, nothing of its own."""
    of = equations([recorded(n, 0.0, 0.4, likeness=0.6) for n in range(4)])
    assert of.fit((ALWAYS,)).delta_chi2 > 10 * ENTRY
    assert kept(of).terms == ()


def test_a_name_beside_curves_that_are_there_stays() -> None:
    """It gains its entry beside them, and lowers the error of recordings that did not fit it."""
    of = equations([recorded(n, 0.2, 0.4, likeness=0.6) for n in range(4)])
    assert kept(of).terms == (ALWAYS,)


def test_a_name_does_not_stand_for_the_curve_of_a_recording() -> None:
    """Beside it one recording would leave nothing; without it, all have one and the same fault."""
    alike = [recorded(n, 0.0, 0.3, likeness=0.6) for n in range(2)]
    of = equations([*alike, recorded(2, 0.0, 0.18, likeness=0.98)])
    with_it, without_it = (shown_beside(of, of.fit(terms), found(of)) for terms in ((ALWAYS,), ()))
    assert (with_it.curves, without_it.curves) == (((0, 0), (1, 0)), ((0, 0), (1, 0), (2, 0)))
    assert of.beside(with_it.terms).fit((ALWAYS,)).delta_chi2 > 10 * ENTRY
    assert kept(of).terms == ()


def test_a_name_has_its_sign_beside_curves() -> None:
    """A drag that pushes, once curves take what made it brake, is none."""
    of = equations([recorded(n, -0.3, 1.0, likeness=0.8) for n in range(4)])
    assert of.fit((ALWAYS,)).coefficients[-1] > 0.2
    assert of.beside([(n, 0) for n in range(4)]).fit((ALWAYS,)).coefficients[-1] < -0.2
    assert kept(of).terms == ()


@pytest.mark.parametrize(("sizes", "count"), [((1.0, 0.0), 0), ((0.3, 0.3), 1), ((0.3,), 1)])
def test_a_name_lowers_the_error_of_recordings_that_did_not_fit_it(sizes: Sequence[float], count: int) -> None:
    """With two recordings too; a single one has no other that could fit it."""
    of = equations([recorded(n, size, 0.0) for n, size in enumerate(sizes)], curves=False)
    assert len(kept(of).terms) == count


def test_names_and_curves_explain_what_least_squares_of_the_readings_does() -> None:
    """With the parameter held by its prior, the name in all recordings, and a curve in each of two."""
    drives = [recorded(n, 0.2, 0.3, likeness=0.5) for n in range(3)]
    of = equations(drives)
    rows, right = [], []
    for n, each in enumerate(drives):
        own = [each.columns[CURVE] * (n == k) for k in (0, 2)]
        rows.append(np.stack([(column / DEVIATION).ravel() for column in (*each.columns[:2], *own)], axis=1))
        right.append((each.residual / DEVIATION).ravel())
    matrix = np.concatenate([*rows, [[1 / PRIOR_STD, 0.0, 0.0, 0.0]]])
    values = np.append(np.concatenate(right), 0.0)
    left = np.linalg.lstsq(matrix, values, rcond=None)[1][0]
    assert of.explained(of.fit((ALWAYS,)), [(0, 0), (2, 0)]) == pytest.approx(values @ values - left)
