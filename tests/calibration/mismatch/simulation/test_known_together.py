"""Parameters that are known in combinations, as independent ones."""

from __future__ import annotations

import numpy as np
import pytest

from regolithd.calibration.mismatch import Prior
from regolithd.calibration.mismatch.simulation.known_together import KnownTogether

MEAN = np.array([9.0, 4.5])
COVARIANCE = np.array([[0.09, -0.027], [-0.027, 0.01]])
STATED = {"glide": Prior(4.0, 0.2), "area": Prior(8.0, 0.5, "m²", bounds=(1.0, 20.0)), "mass": Prior(22.0, 2.0, "kg")}


@pytest.fixture
def known() -> KnownTogether:
    """Return area and glide, of which the product is known better than each."""
    return KnownTogether.of(("area", "glide"), MEAN, COVARIANCE)


def test_each_has_the_spread_that_it_has_beside_those_before_it(known: KnownTogether) -> None:
    """The variance of the second beside the first is C22 - C12² / C11; unit, bounds and the other parameter stay."""
    priors = known.priors(STATED)
    assert list(priors) == list(STATED)
    assert (priors["area"].value, priors["area"].std) == (9.0, pytest.approx(0.3))
    assert (priors["glide"].value, priors["glide"].std) == (4.5, pytest.approx((0.01 - 0.027**2 / 0.09) ** 0.5))
    assert (priors["area"].unit, priors["area"].bounds) == ("m²", (1.0, 20.0))
    assert priors["mass"] is STATED["mass"]
    assert not priors["area"].told


def test_independent_draws_make_the_density(known: KnownTogether) -> None:
    """Mean and covariance of the parameters, of a hundred thousand draws."""
    random, priors = np.random.default_rng(3), known.priors(STATED)
    drawn = {name: random.normal(priors[name].value, priors[name].std, 100_000) for name in known.names}
    values = known.values({**drawn, "mass": 20.0})  # type: ignore[dict-item]
    assert values["mass"] == 20.0
    found = np.array([values[name] for name in known.names])
    np.testing.assert_allclose(found.mean(axis=1), MEAN, atol=0.003)
    np.testing.assert_allclose(np.cov(found), COVARIANCE, atol=0.001)


def test_what_readings_know_is_told_of_the_parameters(known: KnownTogether) -> None:
    """The log likelihood is the same at the same values, but for a constant; the parameters in another order."""
    names, matrix, vector = ("glide", "area"), np.array([[50.0, 8.0], [8.0, 30.0]]), np.array([260.0, 310.0])
    moved, along = known.information(names, matrix, vector)

    def difference(independent: np.ndarray) -> float:
        values = known.values(dict(zip(names, independent.tolist(), strict=True)))
        at = np.array([values[name] for name in names])
        return float(
            -at @ moved @ at / 2 + along @ at - (-independent @ matrix @ independent / 2 + vector @ independent)
        )

    there = difference(np.array([4.5, 9.0]))
    assert difference(np.array([4.7, 8.6])) == pytest.approx(there)
    assert difference(np.array([3.0, 12.0])) == pytest.approx(there)


def test_a_parameter_that_is_not_known_together_stands_for_itself(known: KnownTogether) -> None:
    """As one that another channel holds at a bound; what is known of the others is as without it."""
    names, matrix, vector = ("glide", "mass", "area"), np.diag([50.0, 2.0, 30.0]), np.array([260.0, 44.0, 310.0])
    moved, along = known.information(names, matrix, vector)
    at = [0, 2]
    alone = known.information(("glide", "area"), matrix[np.ix_(at, at)], vector[at])
    np.testing.assert_allclose(moved[np.ix_(at, at)], alone[0])
    np.testing.assert_allclose(along[at], alone[1])
    np.testing.assert_allclose(moved[1], [0.0, 2.0, 0.0])
    assert along[1] == pytest.approx(44.0)
