"""Smooth terms: piecewise linear functions of a covariate, and sines over time, that stand for no known physics."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from regolithd.calibration.mismatch.candidates.late_columns import as_shown
from regolithd.calibration.mismatch.candidates.motion import along_motion
from regolithd.calibration.mismatch.candidates.reversal import reversal_of
from regolithd.calibration.mismatch.problem.covariates import names_of_prediction
from regolithd.calibration.mismatch.problem.inputs.errors_in_variables import known_mean
from regolithd.calibration.mismatch.regression.group import Group
from regolithd.calibration.mismatch.signal.hat_basis import FEWEST_KNOTS, hat_functions
from regolithd.calibration.mismatch.signal.noise_models.spectrum import padded_length, power_of_sums

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence

    from regolithd.calibration.mismatch.candidates.candidate import Sharing
    from regolithd.calibration.mismatch.problem.problem import Problem
    from regolithd.calibration.mismatch.regression.design_matrix import DesignMatrix
    from regolithd.calibration.mismatch.regression.group import Term

Array = NDArray[np.float64]

WITHOUT_SMOOTH_TERM = frozenset({"direction", "wheel_angle", "wheel_acceleration"})
"""Covariates of two values, without bound, or with their own candidates alone."""
OF_THE_WAY = frozenset({"place", "position"})
"""Covariates that are another name of the time where the machine never returns."""
LEAST_PASSES = 3.0
"""Length of the way over its range, from which a place is more than another name of the time (a choice)."""
SAME_COURSE = 0.999
"""Correlation of two covariates above which they are one quantity (a choice: a thousandth of the power differs)."""
PERIODIC, PERIODIC_OFFSET = "drag, periodic", "offset, periodic"
"""Couplings of a sine over time, or over a covariate: along the motion, and whatever the motion."""
EACH_WAY = "each way"
"""Coupling of what is a function of the speed with its sign, and neither a drag nor an offset."""
SINES = frozenset({PERIODIC, PERIODIC_OFFSET})
"""Both."""
FEWEST_CYCLES, MOST_CYCLES = 2.5, 24.0
"""Cycles of a sine over a covariate's range: fewer are followed by the knots of its smooth term (a choice: three knots
a cycle), and more are seldom passed slowly enough (a choice)."""
LEAST_SHARE = 0.1
"""Share of what the parameters leave that such a sine has to explain (a choice: a tenth of the mean reading beside a
noise of three tenths; less is also what a controller that follows the noise of the reading gives)."""
USUAL = (0.005, 0.995)
"""Quantiles of a covariate between which its range is (a choice)."""
PLACES = 512
"""Places of that range at which a residual is summed (a choice: twenty a cycle)."""


def with_smooth_terms(design: DesignMatrix) -> DesignMatrix:
    """Add, for each covariate, smooth terms that act as drag, as an offset, and in proportion to the prediction.

    And a constant share of the prediction on one wheel.
    """
    problem = design.problem
    couplings = couplings_of(problem)
    for name, values in problem.covariates.items():
        if has_smooth_term(problem, name) and varies_with_time(problem, values):
            hats = hat_functions(as_followed(name, values), problem.mask, problem.thresholds.curve_knots)
            for coupling, factor, sharing in (
                _ways_to_act(problem, name, couplings) if len(hats) >= FEWEST_KNOTS else ()
            ):
                design = with_group(design, name, [hat * factor for hat in hats], coupling, sharing)
    design = _with_constant_share(design, couplings["gain"])
    speed = problem.covariates.get("wheel_speed")
    if speed is not None and np.nanmin(speed) < 0:
        # What acts one way only is neither a drag nor an offset.
        hats = hat_functions(speed, problem.mask, problem.thresholds.curve_knots)
        design = with_group(design, "wheel_speed", hats, EACH_WAY)
    coupling = "drag" if "drag" in couplings else "offset"
    hats = hat_functions(problem.covariates["time"], problem.mask, problem.thresholds.time_knots)
    return with_group(design, "time", [hat * couplings[coupling] for hat in hats], coupling)


def as_followed(covariate: str, values: Array) -> Array:
    """Return values of a covariate as a smooth term follows them: of a speed, how large it is."""
    return np.abs(values) if covariate == "wheel_speed" else values


def follows_size(covariate: str, coupling: str) -> bool:
    """Return whether a smooth term follows how large a covariate is, whatever its sign."""
    return covariate == "wheel_speed" and coupling != EACH_WAY


def _with_constant_share(design: DesignMatrix, prediction: Array) -> DesignMatrix:
    """Add a constant share of the prediction on one wheel of several, as of a sensor whose scale is wrong.

    It is over the size of the prediction, and pays for one wheel alone as a law does. Of all wheels the parameters hold
    it; where the zero of the column means nothing, it has no meaning.
    """
    problem = design.problem
    over = [name for name in names_of_prediction(problem.simulation.channel) if name in problem.covariates]
    if len(problem.mask.T) == 1 or problem.arbitrary_zero or not over or over[0] in problem.fed_back:
        return design
    return with_group(design, over[0], [prediction], "gain", ("one",), problem.thresholds.single_wheel_penalty)


def has_smooth_term(problem: Problem, covariate: str) -> bool:
    """Return whether a curve over a covariate may explain something.

    Over the way only where the machine returns; over a position only where no other covariate has the same course.
    """
    if covariate in WITHOUT_SMOOTH_TERM | problem.fed_back:
        return False
    values = problem.covariates[covariate]
    if covariate in OF_THE_WAY and not any(map(_returns, values.T)):
        return False
    others = problem.covariates.keys() - {"position", "wheel_angle"} if covariate == "position" else ()
    return not any(same_course(values, problem.covariates[other], problem.mask) for other in others)


def _returns(way: Array) -> bool:
    """Return whether a way (time,) is at least `LEAST_PASSES` times as long as its range."""
    known = way[np.isfinite(way)]
    return bool(known.size) and float(np.sum(np.abs(np.diff(known)))) >= LEAST_PASSES * float(np.ptp(known)) > 0


def same_course(one: Array, other: Array, mask: NDArray[np.bool_]) -> bool:
    """Return whether two covariates (time, wheel) differ by a factor and a constant alone, on each wheel."""
    for first, second, rows in zip(one.T, other.T, mask.T, strict=True):
        known = rows & np.isfinite(first) & np.isfinite(second)
        pair = np.stack((first[known], second[known]))
        if known.sum() < 2 or np.any(np.ptp(pair, axis=1) == 0) or abs(np.corrcoef(pair)[0, 1]) <= SAME_COURSE:
            return False
    return True


def same_covariate(problem: Problem, one: str, other: str, wheels: Sequence[int]) -> bool:
    """Return whether two covariates are the same on these wheels: by name, or by course, as an angle is a position."""
    if one == other:
        return True
    if one not in problem.covariates or other not in problem.covariates:
        return False
    on = list(wheels)
    return same_course(problem.covariates[one][:, on], problem.covariates[other][:, on], problem.mask[:, on])


def couplings_of(problem: Problem) -> dict[str, Array]:
    """Return the factors, shape (time, wheel), by which a smooth function may act on the prediction."""
    found = {
        "offset": np.ones(problem.mask.shape),
        "gain": problem.filled - (_mean_prediction(problem) if problem.arbitrary_zero else 0.0),
    }
    if "direction" in problem.covariates:
        found["drag"] = motion_of(problem)
    return found


def _mean_prediction(problem: Problem) -> Array:
    """Return the mean of what is predicted of the compared readings of each wheel, 0 where none is compared."""
    return known_mean(np.where(problem.mask, problem.prediction, np.nan))


def is_constant(term: Term) -> bool:
    """Return whether a smooth term is one number: a constant share of the prediction."""
    return not term.group.named and term.group.region is None and len(term.group.columns) == 1


def acting(problem: Problem, covariate: str, coupling: str) -> tuple[Array, Array]:
    """Return a covariate as its smooth term has it, and the factor by which that acts, shape (time, wheel) each."""
    values = problem.covariates[covariate]
    if coupling == EACH_WAY:
        return values, np.ones(values.shape)
    values = as_followed(covariate, values)
    couplings = couplings_of(problem)
    if coupling in couplings:
        return values, couplings[coupling]
    return values, motion_of(problem) * problem.contrasts(covariate)[coupling.removeprefix("drag, ")]


def motion_of(problem: Problem) -> Array:
    """Return by what a drag acts along the motion, shape (time, wheel): a step at standstill, or as friction reverses.

    A law that reverses as the machine does would else have that alone to gain beside a curve. 1 without a direction.
    """
    if "direction" not in problem.covariates:
        return np.ones(problem.mask.shape)
    return problem.once("motion", lambda: along_motion(problem, reversal_of(problem)))


def _ways_to_act(
    problem: Problem, covariate: str, couplings: dict[str, Array]
) -> Iterator[tuple[str, Array, tuple[Sharing, ...]]]:
    """Yield coupling, factor and sharing: on all or on one wheel, and oppositely on two parts of the machine."""
    for coupling, factor in couplings.items():
        yield coupling, factor, ("all", "one")
    for name, contrast in problem.contrasts(covariate).items():
        yield f"drag, {name}", motion_of(problem) * contrast, ("all",)


def with_group(
    design: DesignMatrix,
    covariate: str,
    columns: Sequence[Array],
    coupling: str,
    sharing: tuple[Sharing, ...] = ("all", "one"),
    selection_penalty: float = 0.0,
    period: float | None = None,
) -> DesignMatrix:
    """Add columns of either sign as one group, with the period that they have in common."""
    design, places = design.extended(as_shown(design.problem, columns))
    if not places:
        return design
    group = Group(
        name=covariate,
        columns=places,
        signs=(0,) * len(places),
        sharing=sharing,
        selection_penalty=selection_penalty,
        coupling=coupling,
        period=period,
    )
    return design.with_groups((*design.groups, group))


def varies_with_time(problem: Problem, values: Array) -> bool:
    """Return whether a covariate varies on each wheel: a curve over what hardly does would be a list of wheels."""
    known = values[problem.mask & np.isfinite(values)]
    return problem.variance_within(values) >= problem.thresholds.least_variance_within * float(np.var(known))


def with_periodic_terms(design: DesignMatrix, residual: Array) -> DesignMatrix:
    """Add the strongest sines in a residual [time, wheel], over time and over covariates."""
    return _with_sines_over_covariates(_with_sines_over_time(design, residual), residual)


def curves_over_time(design: DesignMatrix) -> list[Group]:
    """Return the groups of smooth terms over time, without sines."""
    over_time = (group for group in design.groups if group.name == "time" and not group.named)
    return [group for group in over_time if group.coupling not in SINES]


def _with_sines_over_time(design: DesignMatrix, residual: Array) -> DesignMatrix:
    """Add the strongest sines over time, which act against the motion or whatever it is: of all wheels, and of each."""
    problem, limits = design.problem, design.problem.thresholds
    along = motion_of(problem)
    couplings = {PERIODIC: along}
    if np.any(along[problem.mask] > 0) and np.any(along[problem.mask] < 0):
        couplings[PERIODIC_OFFSET] = np.ones(problem.mask.shape)
    time_s, step_s = problem.time_s[:, 0], problem.recording.step_s
    lowest_Hz, highest_Hz = limits.fewest_periods / problem.length_s, 1 / (limits.shortest_period * step_s)
    if lowest_Hz >= highest_Hz:
        return design
    place = np.rint(time_s / step_s).astype(np.int64)
    length = padded_length(int(place[-1]))
    frequency_Hz = np.fft.rfftfreq(length, step_s)
    searched = (frequency_Hz >= lowest_Hz) & (frequency_Hz <= highest_Hz)
    # As many frequencies were open to choice as the recording resolves.
    selection_penalty = 2 * float(np.log(problem.length_s * highest_Hz))
    for coupling, factor in couplings.items():
        power = np.stack([power_of_sums(place, values, length) for values in (residual * factor * problem.mask).T])
        for of_wheels in (power.sum(axis=0), *power):
            period_s = 1 / float(frequency_Hz[np.argmax(np.where(searched, of_wheels, -1.0))])
            phase = 2 * np.pi * problem.time_s / period_s
            sines = [factor * np.cos(phase), factor * np.sin(phase)]
            design = with_group(design, "time", sines, coupling, selection_penalty=selection_penalty, period=period_s)
    return design


def _share_explained(columns: Sequence[Array], values: Array) -> float:
    """Return the share of the power of values (reading,) that columns explain by least squares."""
    matrix = np.stack(columns, axis=1)
    fitted = matrix @ np.linalg.lstsq(matrix, values, rcond=None)[0]
    return float(np.sum(fitted**2) / max(np.sum(values**2), 1e-300))


def _with_sines_over_covariates(design: DesignMatrix, residual: Array) -> DesignMatrix:
    """Add, over each covariate that has a smooth term, the strongest sine that its few knots cannot follow."""
    problem = design.problem
    couplings = {PERIODIC: motion_of(problem)}
    if "direction" in problem.covariates:
        couplings[PERIODIC_OFFSET] = np.ones(problem.mask.shape)
    selection_penalty = 2 * float(np.log(MOST_CYCLES - FEWEST_CYCLES))
    for name, signed in problem.covariates.items():
        if name == "time" or not has_smooth_term(problem, name) or not varies_with_time(problem, signed):
            continue
        values = as_followed(name, signed)
        known = problem.mask & np.isfinite(values)
        low, high = np.quantile(values[known], USUAL)
        if not high > low:
            continue
        share = np.clip((np.where(known, values, low) - low) / (high - low), 0.0, 1.0)
        place = np.rint(PLACES * share).astype(np.int64)
        length = padded_length(PLACES)
        cycles = np.fft.rfftfreq(length, 1 / PLACES)
        searched = (cycles >= FEWEST_CYCLES) & (cycles <= MOST_CYCLES)
        for coupling, factor in couplings.items():
            left = np.where(known, residual * factor, 0.0)
            power = np.sum(
                [power_of_sums(at, of_wheel, length) for at, of_wheel in zip(place.T, left.T, strict=True)], 0
            )
            strongest = float(cycles[np.argmax(np.where(searched, power, -1.0))])
            phase, period = 2 * np.pi * strongest * share, float(high - low) / strongest
            sines = [factor * np.cos(phase), factor * np.sin(phase)]
            if _share_explained([sine[known] for sine in sines], residual[known]) > LEAST_SHARE:
                design = with_group(design, name, sines, coupling, selection_penalty=selection_penalty, period=period)
    return design
