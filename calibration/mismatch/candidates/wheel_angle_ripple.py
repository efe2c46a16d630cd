"""Ripple that is periodic in the wheel's angle: grousers, gear teeth, an eccentric wheel."""

from __future__ import annotations

from functools import cache
from typing import TYPE_CHECKING, ClassVar

import numpy as np

from regolithd.calibration.mismatch.candidates.candidate import Array, Candidate, Coefficient, Shape
from regolithd.calibration.mismatch.candidates.late_columns import as_shown, columns_of
from regolithd.calibration.mismatch.candidates.responses import Responses
from regolithd.calibration.mismatch.problem.covariates import angle_is_recorded
from regolithd.calibration.mismatch.signal.chi_squared import quantile
from regolithd.calibration.mismatch.signal.intermittency.means import running_mean
from regolithd.calibration.mismatch.signal.noise_models.spectrum import padded_length, power_of_sums
from regolithd.calibration.mismatch.signal.phase import shifted_to

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from numpy.typing import NDArray

    from regolithd.calibration.mismatch.problem.problem import Problem

BINS_PER_CYCLE = 4
"""Least angle bins, for the spectrum, in a cycle of the highest order that is looked at."""
FORMS = {
    "drag": "along the motion",
    "torque": "whatever the motion",
    "load": "in proportion to the prediction",
    "turning": "in motion, whatever its direction",
}
"""Names of the ripples, in the answer, by what the sine is a factor of: the direction, 1, the relative prediction, and
the direction's magnitude: the cogging torque of a motor acts at standstill, too, the blade forces of a fan do not."""
LEAST_AT_REST = 0.01
"""Share of the readings that are at rest, from which it is asked whether a ripple acts there (a choice)."""
LOWEST_ORDER, HIGHEST_ORDER = 0.9, 64
"""Cycles per turn (a choice: above any number of grousers; ripples of single teeth are faster than the readings)."""
LAGS = (0.0, -0.5, 0.5)
"""Lags of the angle in readings that are tried first: a speed may be of the instant, or a mean before or after it."""
LAG_STEPS = (0.25, 0.125, 0.0625)
"""Then, about the best, in readings: a reading of the speed may be a part of a step apart from that of the channel."""
OVERSAMPLING = 10.0
"""Factor on the number of resolved lines (a choice): a line's power is a sum of two squares for each wheel, and the
largest of these sums exceeds the 2 ln of their number that is charged."""
SIDE_BAND = (0.1, 1.5)
"""Distance in orders of the neighbours that tell the noise around a line (a choice: beyond its width, before the next
order)."""
LEAST_CYCLES = 4.0
"""Cycles within the range of angles that were met: of fewer, a sine is a curve over position (a choice)."""
READINGS_PER_CYCLE = 2.5
"""Least readings in a cycle (Nyquist: 2): with fewer, a constant drag is an alias of a ripple of high order."""
RESOLVED_SHARE = 0.25
"""Share of the readings in motion that must resolve an order so (a choice). An alias has another order at each speed:
what a quarter of the readings resolves is no alias, and the others may tell of it too."""
MOST_CYCLES = 4.0
"""Most cycles between two readings, on average, up to which orders are looked at (a choice: the spectrum's length is in
proportion, and an angle is seldom known better)."""
SLOW_READINGS = 9
"""Readings whose mean is slow, and no part of a ripple that turns on between readings (a choice)."""
NEIGHBOURS = 8
"""Whole orders on each side of one that tell the noise around it (a choice: noise is much the same there)."""
MEDIAN_OF_TWO = 2 * float(np.log(2))
"""Median of χ² with two degrees of freedom."""
ROUNDING = 1e-9
"""Share of the largest residual below which a difference is rounding."""
NONE = 1e-4
"""Share of the largest amplitude below which a wheel has none: what draws add to a coefficient of 0."""
ALIAS_SHARE = 0.7
"""Share of a line's power from which another line may be the true one of which it is an alias (a choice: at one speed
both are equal, and of noise the largest of thousands are nearly so)."""
ALIAS_DISTANCE = 0.5
"""Distance in orders from which a line is another one (a choice: above a line's width, below one cycle a turn)."""


class WheelAngleRipple(Candidate):
    """A sine of the wheel's angle, with or without its first overtone, each wheel with a phase of its own.

    The angle is the integral of `wheel_speed` unless the simulation gives another. Where the speed is in m/s it is the
    travel in m, and a ripple of order n repeats every 2π/n m. A ripple may turn on by more than a cycle between two
    readings: the angle tells its phase at each, and as the speed changes no other order, nor any slow effect, has the
    same phases.

    `amplitude` is that of the fundamental alone: half the distance from trough to crest, its root mean square over the
    wheels that have it; of a ripple in proportion to the prediction, where that is `reference_size`. `relative_size`
    has the overtone in it.
    """

    name = "wheel-angle-ripple"
    covariate = "wheel_angle"
    equation = "Δy = Σ a_k cos(order θ) + b_k sin(order θ), each axis its own a_k, b_k"
    words = "a ripple that is periodic in the {wheel_angle}"
    signature = "a line in the residual's spectrum over wheel angle that stays put when the speed changes"
    experiment = "hold three values of the {wheel_speed}, sampled at four times the ripple's frequency"
    vary: ClassVar = ("wheel_speed",)
    source = "grousers: as many cycles per turn as there are; harmonic drive: two per turn of its wave generator"
    requires = ("wheel_angle", "wheel_speed")
    late_with_channel = False  # its columns are made as shown
    coefficients: ClassVar = (Coefficient("amplitude", "{unit}", 0),)
    sharing: ClassVar = ("all", "one")
    forms = tuple(FORMS.values())
    shape_keys: ClassVar = {
        "order": "cycles per turn",
        "kind": "factor of the sine: `drag` the direction, `torque` 1, `load` the prediction over `reference_size`, "
        "`turning` 1 in motion and 0 at rest",
        "sines": "1 (the fundamental alone) or 2 (with its first overtone)",
        "lag": "readings before each instant of which the angle counts",
        "reference_size": "the predicted channel's mean magnitude in the recording in which it was found",
    }
    free: ClassVar = {"order": (LOWEST_ORDER, HIGHEST_ORDER)}

    def form_of(self, shape: Shape) -> str:
        """Return what the sine is a factor of."""
        return FORMS[str(shape["kind"])]

    def shapes(self, problem: Problem) -> Sequence[Shape]:  # noqa: ARG002
        """Return none: a spectrum of the residual finds the order among thousands at once."""
        return []

    def shape_count(self, problem: Problem) -> float:
        """Return the number of lines that the turned angle can resolve, for each kind, with a factor for safety."""
        turns = float(np.ptp(problem.covariates["wheel_angle"])) / (2 * np.pi)
        return max(OVERSAMPLING * len(_kinds(problem)) * HIGHEST_ORDER * turns, 1.0)

    def propose_shapes(self, problem: Problem, residual: Array) -> Sequence[Shape]:
        """Return the strongest order of each kind, with and without its overtone.

        The order is where the spectrum of the residual over angle has its maximum: among those that the readings
        resolve, and among those beyond if one stands out there.
        """
        found: list[Shape] = []
        fast = _less_slow(problem, residual)
        for kind in _kinds(problem):
            base: Shape = {"kind": kind, "reference_size": problem.mean_size} if kind == "load" else {"kind": kind}
            factor = self._base(problem, base)
            for values, strongest in ((residual, self._strongest), (fast, self._beyond_resolved)):
                weighted = values * factor
                if (order := strongest(problem, weighted)) is not None:
                    line: Shape = {"order": order, **base, "lag": self._lag(problem, weighted, order)}
                    found += [{**line, "sines": sines} for sines in (1.0, 2.0)]
        return found

    def columns(self, problem: Problem, shape: Shape) -> Array:
        """Return cosine and sine for each wheel, then those of the overtone, shape (2 sines wheels, time, wheel).

        Where the predicted channel is late, angle and factor are late, and not the waves: these may turn on by more
        than a cycle between two readings.
        """
        phase = float(shape["order"]) * _angle(problem, float(shape.get("lag", 0.0)))
        (base,) = as_shown(problem, [self._base(problem, shape)])
        wheels, sines = problem.mask.shape[1], int(float(shape["sines"]))
        found = np.zeros((sines, wheels, 2, *problem.mask.shape))
        for sine in range(sines):
            waves = base * np.stack((np.cos((sine + 1) * phase), np.sin((sine + 1) * phase)))
            for k in range(wheels):
                found[sine, k, :, :, k] = waves[:, :, k]
        return found.reshape(-1, *problem.mask.shape)

    def bounds(self, problem: Problem, shape: Shape) -> Mapping[str, tuple[float, float]]:
        """Return the width of a spectral line around the order."""
        width = np.pi / max(float(np.ptp(problem.covariates["wheel_angle"])), 1.0)
        order = float(shape["order"])
        return {"order": (max(order - width, _lowest(problem)), min(order + width, HIGHEST_ORDER))}

    def parameters(self, shape: Shape, values: Sequence[float]) -> dict[str, float]:
        """Return the fundamental's amplitude (root mean square over the wheels that have it) and the order."""
        fundamental = np.asarray(values[: len(values) // int(float(shape["sines"]))])
        amplitudes = np.hypot(fundamental[0::2], fundamental[1::2])
        has = amplitudes > NONE * np.max(amplitudes)  # a wheel that is not of the effect has coefficients of 0
        amplitude = float(np.sqrt(np.mean(amplitudes[has] ** 2))) if has.any() else 0.0
        return {"amplitude": amplitude, "order": float(shape["order"])}

    def coefficients_here(self, problem: Problem, shape: Shape, found: Sequence[float]) -> Sequence[float]:
        """Return the coefficients in the phase that this recording shows, where its angle begins anew."""
        if angle_is_recorded(problem.recording, problem.covariates):
            return found
        residual = np.where(problem.mask, np.nan_to_num(problem.measured - problem.prediction), 0.0)
        of_wheels = self.columns_of_wheels(shape, problem.mask.shape[1])
        shifted = shifted_to(residual, columns_of(problem, self, shape), np.array(found), of_wheels)
        return [float(each) for each in shifted]

    def columns_of_wheels(self, shape: Shape, wheels: int) -> NDArray[np.int64]:
        """Return the places of cosine and sine of each wheel, then those of the overtone."""
        sines = int(float(shape["sines"]))
        places = np.arange(2 * sines * wheels).reshape(sines, wheels, 2)
        return np.ascontiguousarray(places.transpose(1, 0, 2)).reshape(wheels, 2 * sines)

    def responses(self, problem: Problem, residual: Array) -> Responses | None:
        """Return those of whole orders, where the angle was recorded: these alone have one phase in all recordings."""
        if not angle_is_recorded(problem.recording, problem.covariates):
            return None
        kinds = tuple(FORMS) if "direction" in problem.covariates else ("torque",)  # the same in all recordings
        shapes: list[tuple[Shape, ...]] = []
        moments, energies = [], []
        for kind in kinds:
            base: Shape = {"kind": kind, "reference_size": problem.mean_size} if kind == "load" else {"kind": kind}
            moment, energy = self._of_whole_orders(problem, residual, self._base(problem, base))
            # The reference differs from recording to recording.
            by = problem.mean_size if kind == "load" else 1.0
            moments.append(by * moment)
            energies.append(by**2 * energy)
            lines = [{"order": float(order), **base, "lag": 0.0} for order in range(1, HIGHEST_ORDER + 1)]
            shapes += [tuple({**line, "sines": sines} for sines in (1.0, 2.0)) for line in lines]
        return Responses(tuple(shapes), problem.recording.wheels, np.concatenate(moments), np.concatenate(energies))

    def _of_whole_orders(self, problem: Problem, residual: Array, base: Array) -> tuple[Array, Array]:
        """Return moment (order, wheel, 2) and energy (order, wheel) over the noise's variance around each order.

        An order is looked at in the readings that resolve it; its energy is 0 where too few do.
        """
        cycles, orders = _cycles_per_reading(problem), np.arange(1, HIGHEST_ORDER + 1)
        turn, wave = np.exp(1j * _angle(problem, 0.0)), np.ones(problem.mask.shape, np.complex128)
        moment = np.zeros((len(orders), problem.mask.shape[1], 2))
        energy = np.zeros(moment.shape[:2])
        known = np.where(problem.mask & (cycles > 0), base, 0.0)
        for place, order in enumerate(orders):
            wave = wave * turn
            if _lowest(problem) <= order <= _resolved(problem):
                used = np.where(cycles * order * READINGS_PER_CYCLE <= 1, known, 0.0)
                summed = np.sum(used * residual * wave, axis=0)
                moment[place], energy[place] = np.stack((summed.real, summed.imag), axis=1), np.sum(used**2, axis=0) / 2
        variance = _noise_around(np.sum(moment**2, axis=2), energy)
        return moment / variance[:, None, None], energy / variance[:, None]

    def _base(self, problem: Problem, shape: Shape) -> Array:
        """Return the factor of the sine: 1 (torque), the direction, its magnitude, or the relative prediction."""
        if shape["kind"] == "drag":
            return problem.covariates["direction"]
        if shape["kind"] == "turning":
            return np.abs(problem.covariates["direction"])
        if shape["kind"] == "torque":
            return np.ones(problem.mask.shape)
        return problem.filled / float(shape["reference_size"])

    def autocorrelation_time_at(self, problem: Problem, residual: Array, shape: Shape) -> float:
        """Return the residual's power around this order over that of white noise: the autocorrelation time.

        The larger of torque and drag counts for every kind, so that the estimate prefers none.
        """
        kinds = ("drag", "torque") if "direction" in problem.covariates else ("torque",)
        return max(
            self._autocorrelation_time(problem, residual * self._base(problem, {"kind": kind}), float(shape["order"]))
            for kind in kinds
        )

    def _autocorrelation_time(self, problem: Problem, weighted: Array, at: float) -> float:
        order, power = self._spectrum(problem, weighted, _resolved(problem))
        above = order - at
        # Noise has more power at lower orders: the side with more counts.
        sides = [power[(side * above > SIDE_BAND[0]) & (side * above < SIDE_BAND[1])] for side in (-1, 1)]
        # Median of χ² with 2n degrees of freedom over its mean: (1 − 1/9n)³ (Wilson and Hilferty, 1931).
        wheels = max(int(problem.mask.any(axis=0).sum()), 1)
        usual = max((float(np.median(side)) for side in sides if side.size), default=float("inf"))
        return usual / (wheels * (1 - 1 / (9 * wheels)) ** 3)

    def _strongest(self, problem: Problem, weighted: Array) -> float | None:
        """Return the order of the strongest line, each octave of orders looked at in the readings that resolve it.

        What does not resolve an order makes aliases of it: a constant drag at a constant speed is a line then. None
        where no order is resolved.
        """
        lowest, resolved, best = _lowest(problem), _resolved(problem), (-1.0, 0.0)
        if lowest >= resolved:
            return None
        highest, cycles = resolved, _cycles_per_reading(problem)
        while highest > lowest:
            resolving = cycles * highest * READINGS_PER_CYCLE <= 1
            # At rest, the readings of one angle are coherent at every order.
            used = weighted if resolving.all() else np.where(resolving & (cycles > 0), weighted, 0.0)
            order, power = self._spectrum(problem, used, resolved)
            least = lowest if resolving.all() else max(lowest, highest / 2)
            sought = (order >= least) & (order <= highest)
            if sought.any():
                top = int(np.argmax(np.where(sought, power, 0.0)))
                best = max(best, (float(power[top]), float(order[top])))
            highest = least
        return best[1]

    def _beyond_resolved(self, problem: Problem, weighted: Array) -> float | None:
        """Return the order of the strongest line if it is beyond those that the readings resolve, and is no alias.

        An alias has the same phases at one speed. At several, the true order has more power than any of its aliases.
        """
        lowest, resolved = _lowest(problem), _resolved(problem)
        highest = min(HIGHEST_ORDER, MOST_CYCLES / max(float(np.mean(_in_motion(problem))), 1e-9))
        if max(lowest, resolved) >= highest:
            return None
        order, power = self._spectrum(problem, np.where(_cycles_per_reading(problem) > 0, weighted, 0.0), highest)
        power[(order < lowest) | (order > highest)] = 0.0
        top = float(order[np.argmax(power)])
        others = power[np.abs(order - top) > ALIAS_DISTANCE]
        alone = others.size > 0 and float(others.max()) < ALIAS_SHARE * float(power.max())
        return top if top > resolved and alone else None

    def _lag(self, problem: Problem, weighted: Array, order: float) -> float:
        """Return the lag of the angle [readings] at which the line is strongest, 0 where it hardly matters."""
        squares = np.sum(weighted**2, axis=0)

        @cache
        def gain(lag: float) -> float:
            """Return the Δχ² of cosine and sine, in noise as large as what they are fitted to."""
            summed = np.abs(np.sum(weighted * np.exp(1j * order * _angle(problem, lag)), axis=0)) ** 2
            return float(np.sum(2 * summed[squares > 0] / squares[squares > 0]))

        best = max(LAGS, key=gain)
        for step in LAG_STEPS:
            best = max((best, best - step, best + step), key=gain)
        return best if gain(best) > gain(0.0) + quantile(1, problem.thresholds.single_test_level) else 0.0

    def _spectrum(self, problem: Problem, weighted: Array, highest: float) -> tuple[Array, Array]:
        """Return orders and the residual's power at each, summed over the wheels; white noise has 1 on each wheel."""
        angle, per_turn = _angle(problem, 0.0), _bins_per_turn(highest)
        low = np.min(angle, axis=0)
        bins = np.rint((angle - low) * per_turn / (2 * np.pi)).astype(np.int64)
        length = padded_length(int(np.max(bins)))
        power: Array = np.zeros(length // 2 + 1)
        for k in range(angle.shape[1]):
            here = problem.mask[:, k]
            summed = power_of_sums(bins[here, k], weighted[here, k], length)
            power += summed / max(float(np.sum(weighted[here, k] ** 2)), 1e-300)
        order = np.arange(len(power)) * per_turn / length
        return order, power


def _kinds(problem: Problem) -> tuple[str, ...]:
    """Return what the sine may be a factor of in this recording."""
    if "direction" not in problem.covariates:
        return ("torque",)
    at_rest = float(np.mean(problem.covariates["direction"][problem.mask] == 0)) if problem.mask.any() else 0.0
    return ("drag", "torque", "load", *(["turning"] if at_rest > LEAST_AT_REST else []))


def _less_slow(problem: Problem, residual: Array) -> Array:
    """Return a residual (time, wheel) less its running mean over the readings of each wheel."""
    found = np.zeros_like(residual)
    for k, here in enumerate(problem.mask.T):
        values, half = residual[here, k], SLOW_READINGS // 2
        if len(values) > SLOW_READINGS:
            found[here, k] = values - running_mean(np.pad(values, half, mode="edge"), SLOW_READINGS)
    return np.where(np.abs(found) > ROUNDING * np.max(np.abs(residual)), found, 0.0)


def _noise_around(squares: Array, energy: Array) -> Array:
    """Return the variance of noise at each order by its neighbours' median, shape (order,); 1 where there are none.

    `squares` (order, wheel) are of cosine and sine together: of noise, variance times energy times χ² of two degrees.
    """
    share = np.where(energy > 0, squares / np.maximum(energy, 1e-300), np.nan)
    found = np.ones(len(share))
    for place in range(len(share)):
        beside = np.delete(share[max(place - NEIGHBOURS, 0) : place + NEIGHBOURS + 1], min(place, NEIGHBOURS), axis=0)
        if np.isfinite(beside).any():
            found[place] = max(float(np.nanmedian(beside)) / MEDIAN_OF_TWO, 1e-300)
    return found


def _bins_per_turn(highest: float) -> int:
    """Return the angle bins in a turn, a power of two: of what turns fast, few orders are looked at."""
    return int(2 ** np.ceil(np.log2(BINS_PER_CYCLE * min(highest + SIDE_BAND[1], HIGHEST_ORDER))))


def _lowest(problem: Problem) -> float:
    """Return the lowest order of which the machine met enough cycles, of any wheel."""
    turns = float(np.max(np.ptp(problem.covariates["wheel_angle"], axis=0))) / (2 * np.pi)
    return max(LOWEST_ORDER, LEAST_CYCLES / max(turns, 1e-9))


def _resolved(problem: Problem) -> float:
    """Return the highest order with enough readings in a cycle, in the slow part of the motion."""
    slow = float(np.quantile(_in_motion(problem), RESOLVED_SHARE))
    return min(HIGHEST_ORDER, 1 / (READINGS_PER_CYCLE * max(slow, 1e-9)))


def _in_motion(problem: Problem) -> Array:
    """Return the turns between two readings in motion, shape (reading,); 0 where there is no motion."""
    cycles = _cycles_per_reading(problem)[problem.mask]
    return cycles[cycles > 0] if np.any(cycles > 0) else np.zeros(1)


def _cycles_per_reading(problem: Problem) -> Array:
    """Return the turns between two readings, the cycles of order 1, shape (time, wheel)."""
    return np.abs(problem.known("wheel_speed")) * problem.recording.step_s / (2 * np.pi)


def _angle(problem: Problem, lag: float) -> Array:
    """Return the turned angle [rad] `lag` readings before what the predicted channel shows, shape (time, wheel)."""
    angle = problem.covariates["wheel_angle"] - lag * problem.recording.step_s * problem.known("wheel_speed")
    (shown,) = as_shown(problem, [angle])
    return shown
