"""Whether the mean of a course of readings switches between two levels: something comes and goes.

A cable that rubs now and then adds the same to each of its spells. The likelihood of that, an autoregression whose mean
is switched by a hidden Markov chain (Hamilton, 1989), is compared with those of noise that does not: a Gaussian
autoregression of any memory, and an autoregression whose size switches. Neither spells of equal length nor few of them
are needed, and noise that is as slow as the spells has its own likelihood. Other wheels tell how much slow noise there
is: that one wheel has far more of it than its peers is less probable than that it has spells.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from regolithd.calibration.mismatch.signal.intermittency.markov_chain import MarkovChains
from regolithd.calibration.mismatch.signal.intermittency.means import block_means
from regolithd.calibration.mismatch.signal.noise_models.noise_spectrum import (
    Bands,
    cosine_transform,
    likeliest_powers,
    minus_two_log_likelihood,
    spectra_of,
)
from regolithd.calibration.mismatch.thresholds import THRESHOLDS, Thresholds

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

Array = NDArray[np.float64]

BLOCKS = (600, 150)
"""Blocks of readings into which a course is divided: short spells show in many, and long ones above the noise of few (a
choice: the likelihood of 600 takes some milliseconds)."""
HIGHEST_ORDER = 6
"""Order of the noise's autoregression, at most (a choice: over blocks, which have little memory left)."""
FREE = 3
"""Numbers that either kind of switching has beyond an autoregression, each a unit of log likelihood (Akaike, 1974)."""
WANDERING_NUMBERS = 2
"""Numbers that noise which wanders has beyond white noise: its share and its time."""
HIGHEST_CORRELATION = 0.98
"""From one block to the next, of the noise beside the spells (a choice: what is slower is no noise)."""
LEAST_NOISE = 0.1
"""Share of the variance that is noise, at least (a choice: larger steps are found as curves over time)."""

AMPLITUDES, SHARES, DURATIONS = (0.7, 1.1, 1.5, 1.8), (0.08, 0.2, 0.35, 0.5), (4.0, 10.0, 25.0)
"""Grid of the second level above or below the first [standard deviations of the course], of the share of the time and
of the mean duration [blocks] of a spell; refined about its best."""
RATIOS, RATIO_SHARES, RATIO_DURATIONS = (1.7, 2.5, 4.0), (0.1, 0.25, 0.5, 0.75), (3.0, 8.0, 25.0)
"""The same of noise whose size switches by a ratio."""
REFINEMENTS = (1.0, 0.5)
"""Steps about the best of a grid, in its own steps."""
MOST_BY_REFINEMENT = 6.0
"""Log likelihood that a refinement adds at most (a choice: in 400 courses it added up to 4)."""
STEPS = (0.2, 0.3, 0.45)
"""Steps of a grid for its refinement, in logarithms."""
LARGEST_SHARE, SHORTEST, LONGEST = 0.6, 3.0, 200.0
"""Limits of refined shares and durations [blocks]: a spell is no single block, which is an outlier."""
FEWEST_PEERS = 2
"""Peers below which they say nothing: a scatter needs two."""


@dataclass(frozen=True, eq=False)
class SwitchingMean:
    """Two levels of a course's mean.

    Attributes
    ----------
    block: readings in a block
    amplitude: the second level above the first
    share, duration: of the time, and mean duration of a spell [blocks], in which the second level holds
    gain: twice the logarithm of the likelihood ratio to noise alone, less what the free numbers cost
    """

    block: int
    amplitude: float
    share: float
    duration: float
    gain: float

    @property
    def power(self) -> float:
        """Variance that the switching adds to the course."""
        return self.amplitude**2 * self.share * (1 - self.share)

    def acting(self, course: Array) -> Array:
        """Return the probability that the second level holds in each block of the course, shape (block,)."""
        values, size = _standardised(block_means(course, self.block))
        model = np.array([[self.amplitude / size, self.share, self.duration]])
        _, chains, first, after = _switching_densities(values, model)
        return chains.second_state(first, after)


def block_lengths(course: Array) -> set[int]:
    """Return how many readings of a course (reading,) a block has, of each kind."""
    return {max(len(course) // blocks, 1) for blocks in BLOCKS}


def switching_mean(
    course: Array, peers: Sequence[Array] = (), thresholds: Thresholds = THRESHOLDS
) -> SwitchingMean | None:
    """Return the two levels between which the mean of a course (reading,) switches; None: it does not, beyond chance.

    `peers` are courses of other wheels, over the size of their noise as this one.
    """
    if len(course) < thresholds.fewest_blocks or not np.ptp(course) > 0:
        return None
    found = []
    for length in block_lengths(course):
        switching = _switching(block_means(course, length), [block_means(peer, length) for peer in peers], thresholds)
        if switching is not None:
            (amplitude, share, duration), gain = switching
            found.append(SwitchingMean(length, amplitude, share, duration, gain))
    return max(found, key=lambda each: each.gain, default=None)


def gain_as_noise(course: Array, rest: Array) -> float:
    """Return by how much what is left of a course (reading,) is likelier to be noise, in twice the log likelihood."""
    found = []
    for length in block_lengths(course):
        values, size = _standardised(block_means(course, length))
        left = block_means(rest, length)
        found.append(_noise_likelihood((left - left.mean()) / size) - _noise_likelihood(values))
    return 2 * max(found)


def _persistence(values: Array) -> float:
    """Return the correlation of values with the one before."""
    centred = values - values.mean()
    return float(np.clip(centred[:-1] @ centred[1:] / max(float(centred @ centred), 1e-300), 0, HIGHEST_CORRELATION))


def _switching(
    course: Array, peers: Sequence[Array], thresholds: Thresholds
) -> tuple[tuple[float, float, float], float] | None:
    """Return amplitude, share and duration of a switching mean of blocks, and its gain; None: not beyond chance."""
    values, size = _standardised(course)
    unlike = _unlike_peers(peers)

    def likelihood(models: Array) -> Array:
        beside = unlike(size**2 * _noise_variance(models), _noise_correlation(values, models))
        return _switching_likelihood(values, models) - beside - FREE

    def least(of_noise: float) -> float:
        beside = unlike(np.array(size**2), np.array(_persistence(values)))
        return of_noise - float(beside) + thresholds.switching_entry / 2

    amplitudes, needed = (*AMPLITUDES, *(-each for each in AMPLITUDES)), least(_noise_likelihood(values))
    (amplitude, *spells), most = _maximised(likelihood, _grid(amplitudes, SHARES, DURATIONS), needed)
    if most <= needed:
        return None
    resizing = _grid(RATIOS, RATIO_SHARES, RATIO_DURATIONS)
    _, resized = _maximised(lambda models: _resized_likelihood(values, models) - FREE, resizing, -np.inf)
    needed = max(needed, least(resized))
    gain = 2 * (most - needed) + thresholds.switching_entry
    return ((amplitude * size, spells[0], spells[1]), gain) if most > needed else None


def _unlike_peers(peers: Sequence[Array]) -> Callable[[Array, Array], Array]:
    """Return by how much variance and correlation of noise are improbable beside those of peers (block,).

    In log likelihood below the highest. Fewer than `FEWEST_PEERS` say nothing. Logarithms of variances, and Fisher's
    transforms of correlations, scatter at least as those of so many blocks do by chance: with variances of
    2 (1 + ρ²) / (1 − ρ²) over their number (Bartlett, 1946), and of one over it.
    """
    known = [peer for peer in peers if peer.size and np.ptp(peer) > 0]
    if len(known) < FEWEST_PEERS:
        return lambda variance, correlation: np.zeros(np.shape(variance))  # noqa: ARG005  # of both
    correlations, blocks = np.array([_persistence(peer) for peer in known]), np.array([len(peer) for peer in known])
    by_chance = 2 * (1 + correlations**2) / (1 - correlations**2) / blocks
    of_variance = _unlike(np.log([np.var(peer) for peer in known]), float(np.mean(by_chance)))
    of_correlation = _unlike(np.arctanh(correlations), float(np.mean(1 / blocks)))
    return lambda variance, correlation: of_variance(np.log(variance)) + of_correlation(np.arctanh(correlation))


def _unlike(of_peers: Array, least: float) -> Callable[[Array], Array]:
    """Return by how much a value is improbable beside those of peers, which scatter by this variance at least.

    They are normally distributed over wheels, so that another one has Student's distribution (Gelman et al., 2013,
    3.2).
    """
    count, centre = len(of_peers), float(np.mean(of_peers))
    scale = max(float(np.var(of_peers, ddof=1)), least) * (1 + 1 / count) * (count - 1)
    return lambda value: count / 2 * np.log1p((value - centre) ** 2 / scale)


def _standardised(values: Array) -> tuple[Array, float]:
    """Return values of mean 0 and standard deviation 1, and the deviation that they had."""
    size = float(np.std(values)) or 1.0
    return (values - values.mean()) / size, size


def _grid(*axes: tuple[float, ...]) -> Array:
    """Return all combinations, shape (model, axis)."""
    return np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1).reshape(-1, len(axes))


def _maximised(
    likelihood: Callable[[Array], Array], models: Array, needed: float
) -> tuple[tuple[float, float, float], float]:
    """Return the model of the highest log likelihood, from a grid and its refinements, and that likelihood.

    A grid that is far from what is needed is not refined.
    """
    best, highest = models[0], -np.inf
    steps = _grid(*[(-1.0, 0.0, 1.0)] * 3) * STEPS
    for factor in (None, *REFINEMENTS):
        if factor is not None and highest < needed - MOST_BY_REFINEMENT:
            break
        tried = models if factor is None else _limited(best * np.exp(factor * steps))
        found = likelihood(tried)
        if found.max() > highest:
            best, highest = tried[int(np.argmax(found))], float(found.max())
    size, share, duration = best.tolist()
    return (size, share, duration), highest


def _limited(models: Array) -> Array:
    """Return models with shares and durations within their limits."""
    return np.stack(
        (models[:, 0], np.minimum(models[:, 1], LARGEST_SHARE), np.clip(models[:, 2], SHORTEST, LONGEST)), axis=-1
    )


def _noise_likelihood(values: Array) -> float:
    """Return the log likelihood of Gaussian noise: autoregression, or white noise and what wanders about it."""
    return max(_autoregression_likelihood(values), _wandering_likelihood(values))


def _wandering_likelihood(values: Array) -> float:
    """Return Whittle's log likelihood of white noise and one first-order process, less one for each number of that.

    An autoregression would need a coefficient for each block that the mixture remembers.
    """
    bands = Bands.of(len(values))
    power = bands.products(cosine_transform(values[None]))[:, 0, 0]
    white, *processes = bands.shapes
    shapes = np.array([(white, process) for process in processes])
    power, free = (np.tile(each, (len(shapes), 1)) for each in (power, bands.count))
    level = spectra_of(shapes, likeliest_powers(shapes, power, free))
    return -0.5 * float(minus_two_log_likelihood(level, power, free).min()) - WANDERING_NUMBERS


def _autoregression_likelihood(values: Array) -> float:
    """Return the log likelihood of Gaussian noise, of the order with the best AIC, less one for each coefficient."""
    count = len(values)
    lagged = np.stack([values[HIGHEST_ORDER - lag : count - lag] for lag in range(HIGHEST_ORDER + 1)])
    products = lagged @ lagged.T / lagged.shape[1]
    found = []
    for order in range(HIGHEST_ORDER + 1):
        own, across = products[1 : order + 1, 1 : order + 1], products[1 : order + 1, 0]
        left = products[0, 0] - across @ np.linalg.lstsq(own, across, rcond=None)[0] if order else products[0, 0]
        found.append(-0.5 * count * (np.log(max(left, 1e-300)) + 1) - order)
    return float(max(found))


def _noise_variance(models: Array) -> Array:
    """Return the variance that the spells of each model (amplitude, share, duration) leave of 1 to the noise."""
    return np.asarray(np.maximum(1 - _spells_variance(models), LEAST_NOISE))


def _spells_variance(models: Array) -> Array:
    """Return the variance that the spells of each model add, of 1."""
    amplitude, share, _ = models.T
    return np.asarray(amplitude**2 * share * (1 - share))


def _noise_correlation(values: Array, models: Array) -> Array:
    """Return the correlation from one block to the next that the spells of each model leave to the noise."""
    _, share, duration = models.T
    memory = MarkovChains(share, duration).memory
    lagged = float(values[:-1] @ values[1:]) / len(values) - _spells_variance(models) * memory
    return np.asarray(np.clip(lagged / _noise_variance(models), 0, HIGHEST_CORRELATION))


def _switching_likelihood(values: Array, models: Array) -> Array:
    """Return the log likelihood of each model (amplitude, share, duration), shape (model,)."""
    possible, chains, first, after = _switching_densities(values, models)
    return np.where(possible, chains.log_likelihood(first, after), -np.inf)


def _switching_densities(values: Array, models: Array) -> tuple[NDArray[np.bool_], MarkovChains, Array, Array]:
    """Return which models are possible, their chains, and the log densities of the first reading and of the others.

    Variance and correlation of the noise are what the spells leave of those of the course (method of moments).
    """
    amplitude, share, duration = models.T
    chains = MarkovChains(share, duration)
    noise = _noise_variance(models)
    correlation = _noise_correlation(values, models)
    levels = np.stack((-amplitude * share, amplitude * (1 - share)), axis=-1)
    innovation = (noise * (1 - correlation**2))[:, None]
    means = levels.T[None] - correlation * levels.T[:, None]
    new = values[1:] - correlation[:, None] * values[:-1] - means[..., None]
    after = -0.5 * (new**2 / innovation + np.log(innovation))
    first = -0.5 * ((values[0] - levels) ** 2 / noise[:, None] + np.log(noise[:, None]))
    possible = (_spells_variance(models) <= 1 - LEAST_NOISE) & (chains.leaving[0] < 0.5)  # else it is the usual state
    return possible, chains, first, after


def _resized_likelihood(values: Array, models: Array) -> Array:
    """Return the log likelihood of noise whose size switches, of each model (ratio, share, duration), (model,)."""
    ratio, share, duration = models.T
    chains = MarkovChains(share, duration)
    correlation = _persistence(values)
    new = values[1:] - correlation * values[:-1]
    smaller = np.mean(new**2) / (1 - share + share * ratio**2)
    variance = np.stack((smaller, smaller * ratio**2), axis=-1)
    of_state = -0.5 * (new**2 / variance.T[..., None] + np.log(variance.T[..., None]))
    after = np.broadcast_to(of_state, (2, *of_state.shape))
    first = -0.5 * np.full((len(models), 2), values[0] ** 2)
    possible = chains.leaving[0] < 0.5  # else it is the usual state
    return np.where(possible, chains.log_likelihood(first, after), -np.inf)
