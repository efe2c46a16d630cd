"""LISDD: localised, identifiable sparse discovery of discrepancy (Wang, arXiv 2606.23215), from its description.

The published summary says what is done, in this order: the known physics is fitted on a regime that is found to be
clean; regimes whose residual energy is too large are flagged by a calibrated statistic; for each flagged regime one
term is chosen from a library by its error on held-out rows, all terms being tried; a sample-split F-test confirms it;
and the false-discovery rate over several regimes is controlled. The full text was not at hand. What the summary leaves
open is chosen here so as to serve the method, and is the same for every case:

- The regimes are twenty bins of equal count of each covariate. The covariate whose bins differ most is taken first.
- The clean regime begins as the half of the rows with the smallest residuals of a fit by least absolute deviations. It
  is then the bins whose energy is below its quantile, and the physics is fitted on them until the bins stay the same.
- A bin's statistic is Σ r² over the noise variance of the clean bins: chi-squared where the noise is white.
- Neighbouring flagged bins are one region. Its rows are split at random: a third fits a term, a third chooses it, and a
  third tests it. Bins and regions are selected by Benjamini and Hochberg's procedure.
- Further regions are looked for over the other covariates, without the rows of those found.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy import stats

Array = NDArray[np.float64]
Mask = NDArray[np.bool_]

BINS = 20
FALSE_DISCOVERY_RATE = 0.05
MOST_FITS = 20
"""Fits of the physics until the clean bins stay the same."""
MOST_COVARIATES = 2
FEWEST_ROWS = 30
"""Rows of a region that is tested: ten for each third."""


@dataclass(frozen=True, eq=False)
class Found:
    """The parameters from the clean regime, the rows in which the law fails, and the terms confirmed there.

    `terms` are columns of the library, one for each region.
    """

    parameters: Array
    failing: Mask
    terms: tuple[int, ...]


def lisdd(
    tangents: Array, reading: Array, covariates: dict[str, Array], library: Array | None = None, seed: int = 0
) -> Found:
    """Run the procedure; `tangents` is ∂reading/∂parameter, shape (row, parameter).

    The library has shape (row, term); without one it is powers of the covariates.
    """
    rng = np.random.default_rng(seed)
    library = _library(covariates) if library is None else library
    failing = np.zeros(len(reading), np.bool_)
    terms: tuple[int, ...] = ()
    left = dict(covariates)
    parameters = _robust(tangents, reading)
    for _ in range(MOST_COVARIATES):
        tried = {name: _regimes(tangents, reading, values, failing) for name, values in left.items()}
        name = max(tried, key=lambda each: tried[each].contrast)
        regimes = tried.pop(name)
        del left[name]
        parameters = regimes.parameters
        confirmed = _confirmed(reading - tangents @ parameters, library, regimes, rng)
        if not confirmed:
            break
        failing |= np.any([region.rows for region in confirmed], axis=0)
        terms += tuple(region.term for region in confirmed)
        parameters = _fitted(tangents, reading, ~failing)
    return Found(parameters, failing, terms)


@dataclass(frozen=True, eq=False)
class _Regimes:
    """Each row's bin of one covariate, the flagged bins, the physics fitted on the others, and how much bins differ."""

    bins: NDArray[np.int64]
    flagged: Mask
    parameters: Array
    contrast: float


def _regimes(tangents: Array, reading: Array, values: Array, known: Mask) -> _Regimes:
    """Find the clean bins of a covariate and flag the others; rows that are known to fail are left out."""
    edges = np.quantile(values, np.linspace(0, 1, BINS + 1)[1:-1])
    bins = np.searchsorted(edges, values)
    kept = ~known
    off = np.abs(reading - tangents @ _robust(tangents[kept], reading[kept]))
    clean = kept & (off <= np.median(off[kept]))
    parameters = _fitted(tangents, reading, clean)
    variance = _variance(np.where(kept, reading - tangents @ parameters, np.nan))
    flagged = np.zeros(BINS, np.bool_)
    energy = np.zeros(BINS)
    for _ in range(MOST_FITS):
        residual = reading - tangents @ parameters
        count = np.bincount(bins[kept], minlength=BINS)
        energy = np.bincount(bins[kept], residual[kept] ** 2, BINS) / variance
        now = _discoveries(stats.chi2.sf(energy, np.maximum(count, 1)))
        clean = kept & ~now[bins]
        if np.array_equal(now, flagged) or clean.sum() < FEWEST_ROWS:
            break
        flagged = now
        parameters = _fitted(tangents, reading, clean)
        variance = float(np.mean((reading - tangents @ parameters)[clean] ** 2))
    count = np.maximum(np.bincount(bins[kept], minlength=BINS), 1)
    contrast = float(np.max((energy - count) / np.sqrt(2 * count)))
    return _Regimes(bins, flagged, parameters, contrast)


@dataclass(frozen=True, eq=False)
class _Region:
    """Rows of neighbouring flagged bins, the term of the library that describes them best, and its F-test's level."""

    rows: Mask
    term: int
    level: float


def _confirmed(residual: Array, library: Array, regimes: _Regimes, rng: np.random.Generator) -> list[_Region]:
    """Return those regions in which a term of the library passes the F-test."""
    regions = [np.isin(regimes.bins, run) for run in _runs(regimes.flagged)]
    tested = [
        _Region(rows, *_tested(residual[rows], library[rows], rng)) for rows in regions if rows.sum() >= FEWEST_ROWS
    ]
    sure = _discoveries(np.array([region.level for region in tested]))
    return [region for region, discovered in zip(tested, sure, strict=True) if discovered]


def _tested(residual: Array, library: Array, rng: np.random.Generator) -> tuple[int, float]:
    """Return the term that does best on held-out rows, and the level of its F-test on others."""
    third = rng.permutation(len(residual)) % 3
    fit, held, test = (third == part for part in range(3))
    factors = np.sum(library[fit] * residual[fit, None], axis=0) / np.maximum(np.sum(library[fit] ** 2, axis=0), 1e-12)
    errors = np.sum((residual[held, None] - library[held] * factors) ** 2, axis=0)
    best = int(np.argmin(errors))
    term = library[test, best]
    factor = float(term @ residual[test]) / max(float(term @ term), 1e-12)
    after = float(np.sum((residual[test] - factor * term) ** 2))
    before = float(np.sum(residual[test] ** 2))
    rows = int(test.sum())
    return best, float(stats.f.sf((before - after) / (after / (rows - 1)), 1, rows - 1))


def _library(covariates: dict[str, Array]) -> Array:
    """Return a constant, and each covariate's value, square, cube, magnitude and sign, shape (row, term)."""
    columns = [np.ones(len(next(iter(covariates.values()))))]
    for values in covariates.values():
        scaled = values / np.std(values)
        columns += [scaled, scaled**2, scaled**3, np.abs(scaled), np.sign(scaled)]
    return np.column_stack(columns)


def _robust(tangents: Array, reading: Array) -> Array:
    """Fit by least absolute deviations (iteratively reweighted)."""
    weights: Array = np.ones(len(reading))
    parameters: Array = np.zeros(tangents.shape[1])
    for _ in range(MOST_FITS):
        parameters = np.asarray(
            np.linalg.lstsq(tangents * weights[:, None], reading * weights, rcond=None)[0], np.float64
        )
        off = np.abs(reading - tangents @ parameters)
        weights = 1 / np.sqrt(np.maximum(off, 1e-3 * np.median(off) + 1e-12))
    return parameters


def _fitted(tangents: Array, reading: Array, rows: Mask) -> Array:
    return np.asarray(np.linalg.lstsq(tangents[rows], reading[rows], rcond=None)[0])


def _variance(residual: Array) -> float:
    """Return a robust variance: from the median absolute deviation."""
    return float((1.4826 * np.nanmedian(np.abs(residual))) ** 2)


def _discoveries(levels: Array) -> Mask:
    """Return which tests are discoveries (Benjamini and Hochberg, 1995)."""
    order = np.argsort(levels)
    passed = np.flatnonzero(levels[order] <= FALSE_DISCOVERY_RATE * np.arange(1, len(levels) + 1) / len(levels))
    found = np.zeros(len(levels), np.bool_)
    if passed.size:
        found[order[: passed[-1] + 1]] = True
    return found


def _runs(flagged: Mask) -> list[NDArray[np.int64]]:
    """Return the runs of neighbouring flagged bins."""
    places = np.flatnonzero(flagged)
    return [run for run in np.split(places, np.flatnonzero(np.diff(places) > 1) + 1) if run.size]
