"""Other methods on the same two parts of a recording: each models the residual from the covariates.

Each method gets what the comparison gets, without the candidates: the residual of the calibrated simulation, and all
covariates but time, with direction and acceleration among them. Its library is the polynomials of degree 3. Beyond the
range of a covariate that it has seen, a method is asked at the end of that range.

pip install 'regolithd[peers]'
"""

from __future__ import annotations

import warnings
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

if TYPE_CHECKING:
    from collections.abc import Callable

Array = NDArray[np.float64]

DEGREE = 3
MOST_ROWS, MOST_GP_ROWS = 4000, 600
"""Rows that a method is given at most, evenly chosen: more do not change the fits, and a Gaussian process is cubic."""
THRESHOLDS = (0.001, 0.003, 0.01, 0.03, 0.1, 0.3)
"""Thresholds of PySINDy, in units of the residual; the one that is best on the last fifth of the rows is taken."""


def polynomials(features: Array) -> Array:
    """Return all products of at most `DEGREE` features, with a constant, shape (rows, terms)."""
    from sklearn.preprocessing import PolynomialFeatures  # noqa: PLC0415  # an optional package

    return np.asarray(PolynomialFeatures(DEGREE).fit_transform(features))


def pysindy(features: Array, residual: Array) -> Callable[[Array], Array]:
    """Return the model of sequentially thresholded least squares."""
    import pysindy  # noqa: PLC0415

    library = polynomials(features)
    kept = int(0.8 * len(residual))
    order = np.random.default_rng(0).permutation(len(residual))
    fit_on, choose_on = order[:kept], order[kept:]

    def coefficients(threshold: float, rows: NDArray[np.int64]) -> Array:
        optimizer = pysindy.STLSQ(threshold=threshold, alpha=1e-3)
        return np.ravel(optimizer.fit(library[rows], residual[rows, None]).coef_)

    errors = [
        float(np.mean((residual[choose_on] - library[choose_on] @ coefficients(t, fit_on)) ** 2)) for t in THRESHOLDS
    ]
    found = coefficients(THRESHOLDS[int(np.argmin(errors))], order)
    return lambda rows: polynomials(rows) @ found


def frols(features: Array, residual: Array) -> Callable[[Array], Array]:
    """Return the model of forward regression with orthogonal least squares, without lags: a static model."""
    from sysidentpy.basis_function import Polynomial  # noqa: PLC0415
    from sysidentpy.model_structure_selection import FROLS  # noqa: PLC0415
    from sysidentpy.parameter_estimation import LeastSquares  # noqa: PLC0415

    inputs = features.shape[1]
    model = FROLS(
        model_type="NFIR",
        xlag=[[1]] * inputs if inputs > 1 else 1,
        ylag=1,
        basis_function=Polynomial(degree=DEGREE),
        estimator=LeastSquares(),
        order_selection=True,
        n_info_values=15,
        info_criteria="bic",
    )
    # Its smallest lag is one row: the output is given a row later than the input that it belongs to.
    model.fit(X=_one_more(features), y=np.concatenate([[0.0], residual])[:, None])
    return lambda rows: np.ravel(model.predict(X=_one_more(rows), y=np.zeros((len(rows) + 1, 1))))[1:]


def _one_more(rows: Array) -> Array:
    return np.concatenate([rows, rows[-1:]])


def stepwise(features: Array, residual: Array) -> Callable[[Array], Array]:
    """Return the least-squares model whose terms forward selection by the BIC has chosen."""
    library = polynomials(features)
    chosen: list[int] = []
    best = len(residual) * np.log(np.mean(residual**2))
    while True:
        scores = {k: _bic(library[:, [*chosen, k]], residual) for k in range(library.shape[1]) if k not in chosen}
        term = min(scores, key=scores.__getitem__, default=-1)
        if term < 0 or scores[term] >= best:
            break
        best = scores[term]
        chosen.append(term)
    found = np.linalg.lstsq(library[:, chosen], residual, rcond=None)[0]
    return lambda rows: polynomials(rows)[:, chosen] @ found


def _bic(columns: Array, residual: Array) -> float:
    found = np.linalg.lstsq(columns, residual, rcond=None)[0]
    count = len(residual)
    return float(count * np.log(np.mean((residual - columns @ found) ** 2)) + columns.shape[1] * np.log(count))


def gaussian_process(features: Array, residual: Array) -> Callable[[Array], Array]:
    """Return the mean of a Gaussian process with one length for each covariate, and white noise."""
    from sklearn.gaussian_process import GaussianProcessRegressor  # noqa: PLC0415
    from sklearn.gaussian_process.kernels import RBF, ConstantKernel, WhiteKernel  # noqa: PLC0415

    rows = evenly(len(residual), MOST_GP_ROWS)
    kernel = ConstantKernel(1.0) * RBF(np.ones(features.shape[1])) + WhiteKernel(0.1)
    model = GaussianProcessRegressor(kernel, random_state=0).fit(features[rows], residual[rows])
    return lambda new: np.asarray(model.predict(new))


def evenly(count: int, most: int) -> NDArray[np.int64]:
    """Return at most `most` of `count` rows, evenly spread."""
    return np.unique(np.linspace(0, count - 1, min(count, most)).astype(np.int64))


METHODS = {
    "PySINDy": pysindy,
    "FROLS": frols,
    "stepwise BIC": stepwise,
    "Gaussian process": gaussian_process,
}


def predicted_residual(method: str, seen: tuple[Array, Array], features: Array) -> Array | str:
    """Return a method's residual on unseen rows, or why there is none.

    Parameters
    ----------
    seen: features (rows, covariates) and residual (rows,) of the compared part
    features: of the unseen part
    """
    rows = evenly(len(seen[1]), MOST_ROWS)
    centre, spread = seen[0].mean(axis=0), seen[0].std(axis=0)
    spread = np.where(spread > 0, spread, 1.0)
    size = float(seen[1].std()) or 1.0
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            model = METHODS[method]((seen[0][rows] - centre) / spread, seen[1][rows] / size)
            within = np.clip(features, seen[0].min(axis=0), seen[0].max(axis=0))
            return np.asarray(model((within - centre) / spread)) * size
    except ImportError as error:
        return f"{error.name} is not installed: pip install 'regolithd[peers]'"
