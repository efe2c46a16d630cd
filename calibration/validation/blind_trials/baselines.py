"""Baselines on the same two files: PySINDy, stepwise BIC, lasso with stability selection, LISDD.

    python -m regolithd.calibration.validation.blind_trials.baselines RECORDING SIM.toml OUT.json

Each is given a library of columns: for every effect that can be named the usual term of a textbook, for effects on one
wheel a column for each wheel, with onset and order of the ripple already determined by a search. The parameters of the
base simulation (gain, cohesion, friction angle) are always in the model and are no names. The answer of a tool is the
set of names of the columns that it selects; LISDD selects one for each region in which the simulation fails.
"""

from __future__ import annotations

import json
import sys
import time
import tomllib
import warnings
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from regolithd.calibration.validation.blind_trials.recordings.files import COLUMNS
from regolithd.calibration.validation.blind_trials.recordings.ground import Ground, TorqueTable
from regolithd.calibration.validation.blind_trials.recordings.traverse import FORE_AFT
from regolithd.calibration.validation.lisdd import lisdd

if TYPE_CHECKING:
    from collections.abc import Callable

Array = NDArray[np.float64]

BLOCK_S = 30.0
"""Length of the blocks that stability selection draws, longer than the noise's correlation time [s]."""
COVARIATES = ("t_s", "load_N", "pitch_rad", "roll_rad", "yaw_rate_rad_s", "motor_temperature_degC")
"""Columns of the recording over which LISDD looks for regions, beside speed and slip."""


@dataclass(frozen=True)
class Regression:
    """A regression: residual [A] (rows,), columns of unit rms (rows, columns), their names, each row's block.

    `tangents` are the derivatives with respect to the base parameters [A], shape (rows, 3); `covariates` are by name.
    """

    residual: Array
    columns: Array
    names: tuple[str, ...]
    block: NDArray[np.int64]
    tangents: Array
    covariates: dict[str, Array]

    @cached_property
    def projected(self) -> Regression:
        """The same with the tangents projected out of residual and columns, which have unit rms again."""
        basis = np.linalg.qr(self.tangents)[0]
        columns = self.columns - basis @ (basis.T @ self.columns)
        residual = self.residual - basis @ (basis.T @ self.residual)
        return replace(self, residual=residual, columns=of_unit_rms(columns))


def of_unit_rms(columns: Array) -> Array:
    """Return the columns over their root mean squares."""
    return np.asarray(columns / (np.sqrt(np.mean(columns**2, axis=0)) + 1e-15))


def read_recording(path: Path) -> dict[str, Array]:
    """Return the recording's columns, each of shape (time, 6)."""
    table = np.loadtxt(path, delimiter=",", skiprows=1)
    return {name: column.reshape(-1, 6) for name, column in zip(COLUMNS, table.T, strict=True)}


def ground_of(tables: dict[str, Any]) -> Ground:
    """Return wheel and soil of SIM.toml."""
    soil, wheel = tables["soil"], tables["wheel"]
    return Ground(
        cohesion_Pa=soil["cohesion_Pa"],
        friction_angle_rad=np.radians(soil["friction_angle_deg"]),
        shear_modulus_m=soil["shear_modulus_m"],
        stiffness=1000 * (soil["k_c_kN"] / wheel["width_m"] + soil["k_phi_kN"]),
        exponent=soil["sinkage_exponent"],
        radius_m=wheel["radius_m"],
        width_m=wheel["width_m"],
    )


def regression_of(recording: dict[str, Array], tables: dict[str, Any]) -> Regression:
    """Return the regression that all baselines are given."""
    drivetrain = tables["drivetrain"]
    gears = drivetrain["planetary_ratio"] * drivetrain["harmonic_ratio"]
    loss = drivetrain["planetary_efficiency"] * drivetrain["harmonic_efficiency"]
    gain = drivetrain["torque_constant_Nm_per_A"] * gears * loss
    ground = ground_of(tables)
    speed = recording["motor_speed_rad_s"] / gears
    moving = np.abs(speed) > 0.05
    with np.errstate(divide="ignore", invalid="ignore"):
        slip = np.where(moving, 1 - recording["ground_speed_m_s"] / (ground.radius_m * speed), 0.0)
    load, sign = recording["load_N"], np.sign(speed)

    def current(soil: Ground, newtons: Array) -> Array:
        return sign * TorqueTable(soil)(newtons, slip) / gain

    base = current(ground, load)
    stronger = current(replace(ground, cohesion_Pa=1.02 * ground.cohesion_Pa), load) - base
    steeper = current(replace(ground, friction_angle_rad=1.02 * ground.friction_angle_rad), load) - base
    residual = recording["motor_current_A"] - base
    per_newton = current(ground, load + 1) - base
    library = write_library(
        recording, speed=speed, slip=slip, base=base, per_newton=per_newton, residual=np.where(moving, residual, 0.0)
    )
    names = tuple(name for name, _ in library)
    covariates = {name: recording[name] for name in COVARIATES} | {"speed": speed, "slip": slip}
    return Regression(
        residual=residual[moving],
        columns=of_unit_rms(_rows([column for _, column in library], moving)),
        names=names,
        block=(recording["t_s"][moving] // BLOCK_S).astype(np.int64),
        tangents=_rows([base, stronger, steeper], moving),
        covariates={name: values[moving] for name, values in covariates.items()},
    )


def _rows(columns: list[Array], moving: NDArray[np.bool_]) -> Array:
    """Return columns of shape (time, 6), or that broadcast to it, at the rows that move, shape (rows, columns)."""
    return np.column_stack([np.broadcast_to(column, moving.shape)[moving] for column in columns])


def write_library(
    recording: dict[str, Array], *, speed: Array, slip: Array, base: Array, per_newton: Array, residual: Array
) -> list[tuple[str, Array]]:
    """Return (name, column of shape (time, 6)) for every name; effects on one wheel have six columns."""
    t_s, sign = recording["t_s"], np.sign(speed)
    warm, slow = recording["motor_temperature_degC"], np.abs(speed)
    rows = 1 - FORE_AFT[None, :]
    shared = [
        ("coulomb-friction", sign),
        ("viscous-friction", speed),
        ("stribeck-friction", sign * np.exp(-slow / 0.1)),
        ("cold-lubricant-friction", sign * np.exp(-warm / 20)),
        ("load-dependent-efficiency", base * np.abs(base)),
        ("torque-constant-temperature", base * (warm - 20)),
        ("rotor-inertia", np.gradient(speed, t_s[:, 0], axis=0)),
        ("grade-resistance", np.sin(recording["pitch_rad"])),
        ("turning-resistance", sign * np.abs(recording["yaw_rate_rad_s"])),
        ("slip-sinkage", base * slip),
        ("multi-pass-compaction", base * np.where(sign >= 0, rows, 2 - rows)),
        ("soil-transition", base * best_step(t_s, base, residual)),
    ]
    each = np.eye(6)[:, None, :]
    drift = [("load-cell-drift", per_newton * t_s * wheel) for wheel in each]
    bias = [("current-sensor-bias", wheel * np.ones_like(t_s)) for wheel in each]
    worn = [("bearing-drag", sign * wheel * best_step(t_s, sign * wheel, residual)) for wheel in each]
    order = best_order(t_s, speed, residual)
    angle = order * np.cumsum(speed, axis=0) * (t_s[1, 0] - t_s[0, 0])
    waves = [("wheel-angle-ripple", wave(angle) * wheel) for wave in (np.sin, np.cos) for wheel in each]
    return [*shared, *drift, *bias, *worn, *waves]


def best_step(t_s: Array, shape: Array, residual: Array) -> Array:
    """Return a step in time at that of nineteen times at which it reduces the residual most."""
    product, power = np.sum(shape * residual, axis=1), np.sum(shape**2, axis=1)
    ends = t_s[-1, 0] * np.arange(1, 20) / 20
    gains = [product[t_s[:, 0] >= at].sum() ** 2 / (power[t_s[:, 0] >= at].sum() + 1e-15) for at in ends]
    return np.asarray(t_s >= ends[int(np.argmax(gains))], np.float64)


def best_order(t_s: Array, speed: Array, residual: Array) -> int:
    """Return the number of cycles per wheel turn, 1–24, with the largest power in the six wheels' residuals."""
    angle = np.cumsum(speed, axis=0) * (t_s[1, 0] - t_s[0, 0])
    power = [np.sum(np.abs(np.sum(residual * np.exp(-1j * order * angle), axis=0)) ** 2) for order in range(1, 25)]
    return 1 + int(np.argmax(power))


def pysindy_aic(regression: Regression) -> set[str]:
    """Return the names that sequentially thresholded least squares keeps, with the threshold of the lowest AIC."""
    from pysindy import STLSQ  # noqa: PLC0415  # loaded only when this baseline runs

    regression = regression.projected
    rows = len(regression.residual)
    scale = float(np.sqrt(np.mean(regression.residual**2)))
    best, chosen = np.inf, np.zeros(len(regression.names), bool)
    for threshold in np.geomspace(0.003, 0.3, 12):
        fit = STLSQ(threshold=threshold, alpha=1e-6, max_iter=20)
        with warnings.catch_warnings():
            warnings.simplefilter(
                "ignore"
            )  # pysindy warns when a threshold removes every term, which is a valid result here
            fit.fit(regression.columns, regression.residual[:, None] / scale)
        left = regression.residual / scale - regression.columns @ np.ravel(fit.coef_)
        kept = np.ravel(fit.coef_) != 0
        aic = rows * np.log(np.mean(left**2)) + 2 * kept.sum()
        if aic < best:
            best, chosen = aic, kept
    return {name for name, kept in zip(regression.names, chosen, strict=True) if kept}


def stepwise_bic(regression: Regression) -> set[str]:
    """Return the names that forward selection adds while the Bayesian information criterion decreases."""
    regression = regression.projected
    rows = len(regression.residual)
    gram, towards = regression.columns.T @ regression.columns, regression.columns.T @ regression.residual
    total = float(regression.residual @ regression.residual)
    chosen: list[int] = []
    best = rows * np.log(total / rows)
    while len(chosen) < len(regression.names):
        tried = []
        for extra in (j for j in range(len(regression.names)) if j not in chosen):
            at = [*chosen, extra]
            fitted = np.linalg.lstsq(gram[np.ix_(at, at)], towards[at], rcond=1e-10)[0]
            left = max(total - float(fitted @ towards[at]), 1e-30)
            tried.append((rows * np.log(left / rows) + len(at) * np.log(rows), extra))
        bic, extra = min(tried)
        if bic >= best:
            break
        best, chosen = bic, [*chosen, extra]
    return {regression.names[j] for j in chosen}


def lasso_stability(regression: Regression, *, draws: int = 60, first: int = 6, often: float = 0.8) -> set[str]:
    """Return the names among the first columns of the lasso path in at least `often` of random halves of the blocks."""
    from sklearn.linear_model import lars_path_gram  # noqa: PLC0415  # loaded only when this baseline runs

    regression = regression.projected
    blocks = np.unique(regression.block)
    parts = [regression.block == block for block in blocks]
    grams = np.array([regression.columns[part].T @ regression.columns[part] for part in parts])
    towards = np.array([regression.columns[part].T @ regression.residual[part] for part in parts])
    rng, seen = np.random.default_rng(0), np.zeros(len(regression.names))
    for _ in range(draws):
        half = rng.permutation(len(blocks))[: len(blocks) // 2]
        rows = sum(int(parts[at].sum()) for at in half)
        _, active, _ = lars_path_gram(
            towards[half].sum(axis=0), grams[half].sum(axis=0), n_samples=rows, max_iter=first, method="lasso"
        )
        seen[list(active)] += 1
    return {name for name, share in zip(regression.names, seen / draws, strict=True) if share >= often}


def lisdd_terms(regression: Regression) -> set[str]:
    """Return the names of the columns that LISDD selects in the regions where it finds the simulation to fail."""
    found = lisdd(regression.tangents, regression.residual, regression.covariates, regression.columns)
    return {regression.names[term] for term in found.terms}


BASELINES: dict[str, Callable[[Regression], set[str]]] = {
    "pysindy-stlsq-aic": pysindy_aic,
    "stepwise-bic": stepwise_bic,
    "lasso-stability-selection": lasso_stability,
    "lisdd": lisdd_terms,
}
"""The baselines by name."""


def main(recording: str, simulation: str, out: str) -> None:
    """Run every baseline on one trial and write their answers."""
    regression = regression_of(read_recording(Path(recording)), tomllib.loads(Path(simulation).read_text()))
    answers = {}
    for name, baseline in BASELINES.items():
        started = time.perf_counter()
        names = sorted(baseline(regression))
        answers[name] = {"names": names, "seconds": time.perf_counter() - started}
    Path(out).write_text(json.dumps(answers))


if __name__ == "__main__":
    main(*sys.argv[1:])
