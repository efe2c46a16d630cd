"""The sums of a fleet give what least squares of all its readings give."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np
import pytest
from synthetic_fleet import DRAG, GROUPS, WAVE, WEAR, Drive, Wave, drive, equations_of, least_squares, on_both, term

from regolithd.calibration.mismatch.fleet.choice.courses import Course
from regolithd.calibration.mismatch.fleet.choice.equations import fleet_equations
from regolithd.calibration.mismatch.fleet.choice.search import further, penalty, places_of
from regolithd.calibration.mismatch.fleet.choice.terms import FleetTerm, Units

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from regolithd.calibration.mismatch.candidates.candidate import Shape
    from regolithd.calibration.mismatch.fleet.choice.equations import Level

ROVER = (0, 1, 0, 1, 0)
TERMS = (
    FleetTerm(DRAG, Units((0, 1), (0, 1), each=True), Course("always")),
    term(WEAR, Course("growing", 2), wheels=(1,)),
    term(WAVE, Course("since", 1), rovers=(0, 1)),
)


@pytest.fixture(scope="module")
def drives() -> list[Drive]:
    """Return the recordings of two rovers, with effects of several sizes."""
    return [drive(n, on_both(1, 0.05 * n) | {(2, 1): 0.1, (0, 0): 0.2, (4, 0): -0.1}) for n in range(len(ROVER))]


@pytest.mark.parametrize("level", ["shared", "rover", "recording"])
def test_a_fit_is_least_squares_of_all_readings(drives: list[Drive], level: Level) -> None:
    """Coefficients, covariance, and Δχ² below the free parameters alone."""
    equations = equations_of(drives, ROVER, level)
    fit, without = equations.fit(TERMS), equations.fit(())
    direct, alone = least_squares(drives, fit), least_squares(drives, without)
    np.testing.assert_allclose(fit.coefficients, direct.coefficients, rtol=1e-9)
    np.testing.assert_allclose(fit.covariance, direct.covariance, rtol=1e-8, atol=1e-12)
    assert fit.delta_chi2 == pytest.approx(alone.chi2 - direct.chi2)
    assert without.delta_chi2 == pytest.approx(0.0, abs=1e-9)


@pytest.mark.parametrize(("level", "owners"), [("shared", 1), ("rover", 2), ("recording", 5)])
def test_a_parameter_belongs_to_the_fleet_a_rover_or_a_recording(
    drives: list[Drive], level: Level, owners: int
) -> None:
    """It acts on all wheels of its owner's recordings, which together are all."""
    columns, factors, precision = equations_of(drives, ROVER, level).parameter_factors
    assert columns.tolist() == [0] * owners
    np.testing.assert_array_equal(factors.sum(axis=0), np.ones((5, 2)))
    np.testing.assert_allclose(precision, 25.0)
    if level == "rover":
        assert np.flatnonzero(factors[1, :, 0]).tolist() == [1, 3]


def test_a_term_has_one_size_or_one_for_each_rover(drives: list[Drive]) -> None:
    """The spans of a fit's coefficients say which belong to which term."""
    equations = equations_of(drives, ROVER)
    fit = equations.fit(TERMS)
    assert fit.spans == (slice(2, 4), slice(4, 5), slice(5, 7))
    assert fit.columns.tolist() == [0, 0, 1, 1, 2, 3, 4]
    each, worn, wave = (equations.factors(one) for one in TERMS)
    assert [np.flatnonzero(size.any(axis=1)).tolist() for size in each] == [[0, 2, 4], [1, 3]]
    np.testing.assert_allclose(worn[0], [[0, 0], [0, 0], [0, 0.5], [0, 0], [0, 1]])
    np.testing.assert_array_equal(wave[0], [[0, 0], [1, 1], [1, 1], [1, 1], [1, 1]])


def test_what_a_recording_shows_by_itself_takes_up_what_it_can(drives: list[Drive]) -> None:
    """The fit is that of readings without all that is along its columns on each wheel; other recordings stay."""
    own = (3, 4)
    sums = [each.sums() for each in drives]
    sums[1] = replace(sums[1], own=tuple((column,) for column in own))
    without = [Drive(each.columns.copy(), each.residual.copy()) for each in drives]
    for wheel in (0, 1):
        along = without[1].columns[list(own), :, wheel].T.copy()
        for values in (*without[1].columns[:, :, wheel], without[1].residual[:, wheel]):
            np.subtract(values, along @ np.linalg.lstsq(along, values, rcond=None)[0], out=values)
    found = fleet_equations(sums, ROVER, range(5), GROUPS, "rover").beside([(1, 0), (1, 1)]).fit(TERMS)
    direct = least_squares(without, found)
    np.testing.assert_allclose(found.coefficients, direct.coefficients, rtol=1e-8)
    np.testing.assert_allclose(found.covariance, direct.covariance, rtol=1e-6, atol=1e-12)


def test_recordings_left_out_have_no_part_in_a_fit(drives: list[Drive]) -> None:
    """Those with `used` of 0 are neither fitted nor counted."""
    equations = equations_of(drives, ROVER)
    fit = equations.fit(TERMS, np.array([1.0, 1.0, 0.0, 1.0, 1.0]))
    direct = least_squares(drives, fit, used=(0, 1, 3, 4))
    np.testing.assert_allclose(fit.coefficients, direct.coefficients, rtol=1e-8)


def test_what_a_fit_leaves_is_known_for_each_wheel(drives: list[Drive]) -> None:
    """Moments of all columns, weighted, and sums of squares, unweighted."""
    equations = equations_of(drives, ROVER)
    fit = equations.fit(TERMS)
    left = least_squares(drives, fit).left
    np.testing.assert_allclose(equations.squares(fit), np.sum(left**2, axis=1), rtol=1e-9)
    columns = np.array([each.columns for each in drives])
    moments = np.einsum("ictw,itw->iwc", columns, left) * equations.weights[..., None]
    np.testing.assert_allclose(equations.left_moment(fit), moments, rtol=1e-7, atol=1e-9)


def test_recordings_are_ordered_by_time_whatever_their_place(drives: list[Drive]) -> None:
    """Also those of several rovers together."""
    sums = [each.sums() for each in drives]
    equations = fleet_equations(sums, ROVER, [40.0, 10.0, 20.0, 30.0, 0.0], GROUPS, "rover")
    assert equations.recordings_of == ((4, 2, 0), (1, 3))
    assert equations.of_rovers((0, 1)) == (4, 1, 2, 3, 0)


def test_wheels_and_parameters_are_aligned_by_their_names(drives: list[Drive]) -> None:
    """A recording may have them in another order, or lack some; what it lacks stays 0."""
    first, second = drives[0].sums(), drives[1].sums()
    lacking = replace(
        second,
        wheels=("right",),
        tangents=(),
        prior_stds=np.zeros(0),
        places=((1,), (), (3, 4)),
        **{name: getattr(second, name)[1:] for name in ("gram", "moment", "fourth", "energy", "counts", "weights")},
    )
    equations = fleet_equations([lacking, first], (0, 0), (0.0, 1.0), GROUPS, "shared")
    assert (equations.wheels, equations.tangents) == (("left", "right"), ("gain",))
    assert not equations.gram[0, 0].any()
    assert not equations.gram[0, 1][[0, 2]].any()
    assert (equations.counts[0, 0], equations.weights[0, 0]) == (0.0, 0.0)
    kept = [1, 3, 4]
    np.testing.assert_allclose(equations.moment[0, 1, kept], second.weights[1] * second.moment[1, kept])
    np.testing.assert_allclose(
        equations.gram[0, 1][np.ix_(kept, kept)], second.weights[1] * second.gram[1][np.ix_(kept, kept)]
    )
    np.testing.assert_allclose(equations.moment[1], first.weights[:, None] * first.moment)


def test_numbered_wheels_come_before_named_ones(drives: list[Drive]) -> None:
    """In numerical order."""
    numbered, named = replace(drives[0].sums(), wheels=(10, 9)), drives[1].sums()
    equations = fleet_equations([named, numbered], (0, 0), (0.0, 1.0), GROUPS, "shared")
    assert equations.wheels == (9, 10, "left", "right")
    np.testing.assert_allclose(equations.moment[1, 1], numbered.weights[0] * numbered.moment[0])


def test_a_simulation_without_free_parameters_is_fitted_too(drives: list[Drive]) -> None:
    """Then Δχ² is all that the terms explain."""
    sums = [replace(each.sums(), tangents=(), prior_stds=np.zeros(0), places=((1,), (2,), (3, 4))) for each in drives]
    groups = [replace(group, columns=tuple(column - 1 for column in group.columns)) for group in GROUPS]
    equations = fleet_equations(sums, ROVER, range(5), groups, "rover")
    fit = equations.fit((term(groups[0], Course("always")),))
    column = np.stack([drives[i].columns[1] for i in (0, 2, 4)]) / np.array([0.1, 0.12])
    residual = np.stack([drives[i].residual for i in (0, 2, 4)]) / np.array([0.1, 0.12])
    size = np.sum(column * residual) / np.sum(column**2)
    assert fit.coefficients == pytest.approx([size])
    assert fit.delta_chi2 == pytest.approx(size**2 * np.sum(column**2))


class OfWheels(Wave):
    """The same with coefficients of each wheel's own."""

    def columns_of_wheels(self, shape: Shape, wheels: int) -> NDArray[np.int64]:  # noqa: ARG002
        """Return two columns for each wheel."""
        return np.arange(2 * wheels).reshape(wheels, 2)


def test_a_law_whose_wheels_have_coefficients_of_their_own_has_them_on_each_wheel_of_each_rover() -> None:
    """Each the same in all recordings of its rover; a fit with them is least squares of all readings."""
    drives = [drive(n, {(3, 0): 0.2, (4, 1): 0.3 * (-1) ** n}) for n in range(5)]
    own = replace(WAVE, candidate=OfWheels())
    of = fleet_equations([each.sums() for each in drives], ROVER, range(5), (*GROUPS[:2], own), "rover")
    one = term(own, Course("since", 1), rovers=(0, 1))
    assert one.parts == (((0,), (0,)), ((0,), (1,)), ((1,), (0,)), ((1,), (1,)))
    fit = of.fit((one,))
    np.testing.assert_allclose(fit.coefficients, least_squares(drives, fit).coefficients, rtol=1e-8)
    expected = [[0.2, 0], [0, 0.3], [0.2, 0], [0, -0.3]]
    np.testing.assert_allclose(fit.coefficients[fit.spans[0]].reshape(4, 2), expected, atol=0.05)
    gains = {
        each.units.rovers: value + penalty(of, each) for value, each in further(of, of.fit(()), places_of(of), [own])
    }
    assert gains[0, 1] == pytest.approx(of.fit((replace(one, course=Course("always")),)).delta_chi2, rel=0.05)


def test_where_noise_is_less_a_law_counts_more(drives: list[Drive]) -> None:
    """Its size, and what is left of the readings, are the same."""
    sums = [each.sums() for each in drives]
    quiet = [replace(each, reductions=np.array([1.0, 1.0, 4.0])) for each in sums]
    one = term(WAVE, Course("always"), rovers=(0, 1))
    plain, counted = (fleet_equations(each, ROVER, range(5), GROUPS, "rover") for each in (sums, quiet))
    fit, again = plain.fit((one,)), counted.fit((one,))
    np.testing.assert_allclose(again.coefficients[-2:], fit.coefficients[-2:], atol=0.005)
    np.testing.assert_allclose(np.diag(again.covariance)[-2:], np.diag(fit.covariance)[-2:] / 4, rtol=0.1)
    assert again.delta_chi2 == pytest.approx(4 * fit.delta_chi2, rel=0.1)
    np.testing.assert_allclose(counted.squares(fit), plain.squares(fit), rtol=1e-9)
    np.testing.assert_allclose(counted.products(1, 0, [1, 3]), sums[1].gram[0][np.ix_([1, 3], [1, 3])], rtol=1e-9)


def test_a_law_that_counts_more_takes_up_nothing_of_what_others_explain(drives: list[Drive]) -> None:
    """Of readings that another law, or what a recording shows by itself, explains whole, it has nothing."""
    exact = [Drive(each.columns.copy(), np.zeros_like(each.residual)) for each in drives]
    for each in exact:
        each.columns[3] += 0.3 * each.columns[1]
        each.residual[:] = 0.5 * each.columns[1]
    sums = [replace(each.sums(), reductions=np.array([1.0, 1.0, 30.0])) for each in exact]
    of = fleet_equations(sums, ROVER, range(5), GROUPS, "rover")
    drag, wave = (term(each, Course("always"), rovers=(0, 1)) for each in (DRAG, WAVE))
    fit, alone = of.fit((drag, wave)), of.fit((drag,))
    np.testing.assert_allclose(fit.coefficients[-3:], [0.5, 0.0, 0.0], atol=0.02)
    assert fit.delta_chi2 == pytest.approx(alone.delta_chi2, rel=0.02)
    of_wave = [gain for gain, each in further(of, alone, places_of(of)) if each.name == wave.name]
    assert max(of_wave, default=0.0) < 0.01 * alone.delta_chi2
    # What one recording shows by itself, and no other recording of its rover has.
    sums[1], sums[3] = replace(sums[1], own=((1,),)), replace(sums[3], moment=np.zeros_like(sums[3].moment))
    shown = fleet_equations(sums, ROVER, range(5), GROUPS, "rover")
    without = shown.explained(shown.fit(()), [(1, 0)])
    with_wave = shown.fit((term(WAVE, Course("always"), rovers=(1,)),))
    assert shown.explained(with_wave, [(1, 0)]) == pytest.approx(without, rel=0.02)
