"""Parameters that are known together: well in combinations, and perhaps hardly each by itself."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, TypeAlias

import numpy as np
from numpy.typing import NDArray

if TYPE_CHECKING:
    from regolithd.calibration.mismatch.problem.prior import Prior

Array = NDArray[np.float64]
Known: TypeAlias = Mapping[str, tuple[float, float]]
"""Mean and standard deviation of parameters, by their names."""


@dataclass(frozen=True, eq=False)
class KnownTogether:
    """A normal density of several parameters, as independent ones: x = mean + L z (Cholesky).

    In the place of each parameter stands what it is if those before it are at their means, mean + L_jj z_j: it has the
    parameter's unit, and a prior of its own.

    Attributes
    ----------
    names: of the parameters
    mean: of each, in its unit, shape (parameter,)
    factor: L, lower-triangular, shape (parameter, parameter)
    """

    names: tuple[str, ...]
    mean: Array
    factor: Array

    @classmethod
    def of(cls, names: tuple[str, ...], mean: Array, covariance: Array) -> KnownTogether:
        """Return the density of a mean and a covariance, which must be positive definite."""
        return cls(names, mean, np.asarray(np.linalg.cholesky(covariance), np.float64))

    def priors(self, stated: Mapping[str, Prior]) -> dict[str, Prior]:
        """Return the priors of what stands in the place of the parameters, with all other stated ones.

        None of them is told: what they move by is no parameter's value.
        """
        known = zip(self.names, self.mean.tolist(), np.diag(self.factor).tolist(), strict=True)
        return {**stated, **{name: replace(stated[name], value=at, std=std, told=False) for name, at, std in known}}

    def values(self, independent: Mapping[str, float]) -> dict[str, float]:
        """Return the values of the parameters for those of what stands in their place."""
        away = [independent[name] - at for name, at in zip(self.names, self.mean.tolist(), strict=True)]
        mixed = self._mixed()
        found = {
            name: at + sum(float(mixed[row, place]) * shift for place, shift in enumerate(away[: row + 1]))
            for row, (name, at) in enumerate(zip(self.names, self.mean.tolist(), strict=True))
        }
        return {**independent, **found}

    def information(self, names: tuple[str, ...], matrix: Array, vector: Array) -> tuple[Array, Array]:
        """Return what readings know of the parameters from what they know of that which stands in their place.

        Parameters
        ----------
        names: of matrix and vector; a parameter that is none of the known ones stands for itself
        matrix, vector: M and v of the log likelihood −½ uᵀ M u + vᵀ u, of what stands in the parameters' place
        """
        own = [row for row, name in enumerate(names) if name in self.names]
        of = [self.names.index(names[row]) for row in own]
        back, at = np.eye(len(names)), np.zeros(len(names))
        back[np.ix_(own, own)] = np.linalg.inv(self._mixed())[np.ix_(of, of)]
        at[own] = self.mean[of]
        moved = back.T @ matrix @ back
        return moved, back.T @ (vector - matrix @ at) + moved @ at

    def _mixed(self) -> Array:
        """Return L with a diagonal of 1: the shifts of parameters for those of what stands in their place."""
        return np.asarray(self.factor / np.diag(self.factor), np.float64)
