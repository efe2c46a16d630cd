"""The tools that people reach for first, on the same two files: PySINDy, stepwise BIC, lasso with stability selection.

    python -m regolithd.calibration.validation.blind_trials.baselines RECORDING SIM.toml OUT.json

Each is given a fair library: for every name of the contract the columns that an engineer would write down, those of the
one-wheel effects once a wheel, the onset and the ripple's order already found for it by a search. The base simulation's
own parameters (gain, cohesion, friction angle) are always in the model and never count as a name. What a tool selects
is read as the names of its columns.
"""

from __future__ import annotations

import json
import sys
import time
import tomllib
import warnings
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from regolithd.calibration.validation.blind_trials.drive import FORE_AFT
from regolithd.calibration.validation.blind_trials.files import COLUMNS
from regolithd.calibration.validation.blind_trials.ground import Ground, TorqueTable

if TYPE_CHECKING:
    from collections.abc import Callable

Array = NDArray[np.float64]

BLOCK_S = 30.0
"""Length of the blocks that stability selection draws, so that noise within one stays together."""


@dataclass(frozen=True)
class Problem:
    """A regression: residual [A] (rows,), columns (rows, columns) of unit rms, a name for each, and each row's block.

    Residual and columns have the base parameters' tangents projected out.
    """

    residual: Array
    columns: Array
    names: tuple[str, ...]
    block: NDArray[np.int64]


def read_recording(path: Path) -> dict[str, Array]:
    """Return the recording's columns, each of shape (time, 6)."""
    table = np.loadtxt(path, delimiter=",", skiprows=1)
    return {name: column.reshape(-1, 6) for name, column in zip(COLUMNS, table.T, strict=True)}


def ground_of(tables: dict[str, Any]) -> Ground:
    """Return the stated soil under the stated wheel."""
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


def pose(recording: dict[str, Array], tables: dict[str, Any]) -> Problem:
    """Return the regression that all peers are given."""
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
    tangents = np.column_stack([column[moving] for column in (base, stronger, steeper)])
    per_newton = current(ground, load + 1) - base
    library = write_library(
        recording, speed=speed, slip=slip, base=base, per_newton=per_newton, residual=np.where(moving, residual, 0.0)
    )
    names = tuple(name for name, _ in library)
    columns = np.column_stack([np.broadcast_to(column, base.shape)[moving] for _, column in library])
    outside = np.linalg.qr(tangents)[0]
    columns -= outside @ (outside.T @ columns)
    left = residual[moving] - outside @ (outside.T @ residual[moving])
    columns /= np.sqrt(np.mean(columns**2, axis=0)) + 1e-15
    block = (np.broadcast_to(recording["t_s"], base.shape)[moving] // BLOCK_S).astype(np.int64)
    return Problem(left, columns, names, block)


def write_library(
    recording: dict[str, Array], *, speed: Array, slip: Array, base: Array, per_newton: Array, residual: Array
) -> list[tuple[str, Array]]:
    """Return (name, column of shape (time, 6)) for every name; one-wheel effects have six columns."""
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
    """Return a step in time, at the one of nineteen times at which it takes most from the residual."""
    product, power = np.sum(shape * residual, axis=1), np.sum(shape**2, axis=1)
    ends = t_s[-1, 0] * np.arange(1, 20) / 20
    gains = [product[t_s[:, 0] >= at].sum() ** 2 / (power[t_s[:, 0] >= at].sum() + 1e-15) for at in ends]
    return np.asarray(t_s >= ends[int(np.argmax(gains))], np.float64)


def best_order(t_s: Array, speed: Array, residual: Array) -> int:
    """Return the number of cycles per wheel turn, 1–24, that takes most from the six wheels' residuals."""
    angle = np.cumsum(speed, axis=0) * (t_s[1, 0] - t_s[0, 0])
    power = [np.sum(np.abs(np.sum(residual * np.exp(-1j * order * angle), axis=0)) ** 2) for order in range(1, 25)]
    return 1 + int(np.argmax(power))


def pysindy_aic(problem: Problem) -> set[str]:
    """Return what sequentially thresholded least squares keeps, its threshold chosen by AIC."""
    from pysindy import STLSQ  # noqa: PLC0415  # a peer is loaded when it is its turn

    rows = len(problem.residual)
    scale = float(np.sqrt(np.mean(problem.residual**2)))
    best, chosen = np.inf, np.zeros(len(problem.names), bool)
    for threshold in np.geomspace(0.003, 0.3, 12):
        fit = STLSQ(threshold=threshold, alpha=1e-6, max_iter=20)
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")  # that a threshold removes everything is one of the answers
            fit.fit(problem.columns, problem.residual[:, None] / scale)
        left = problem.residual / scale - problem.columns @ np.ravel(fit.coef_)
        kept = np.ravel(fit.coef_) != 0
        aic = rows * np.log(np.mean(left**2)) + 2 * kept.sum()
        if aic < best:
            best, chosen = aic, kept
    return {name for name, kept in zip(problem.names, chosen, strict=True) if kept}


def stepwise_bic(problem: Problem) -> set[str]:
    """Return what forward selection adds as long as the Bayesian information criterion falls."""
    rows = len(problem.residual)
    gram, towards = problem.columns.T @ problem.columns, problem.columns.T @ problem.residual
    total = float(problem.residual @ problem.residual)
    chosen: list[int] = []
    best = rows * np.log(total / rows)
    while len(chosen) < len(problem.names):
        tried = []
        for extra in (j for j in range(len(problem.names)) if j not in chosen):
            at = [*chosen, extra]
            fitted = np.linalg.lstsq(gram[np.ix_(at, at)], towards[at], rcond=1e-10)[0]
            left = max(total - float(fitted @ towards[at]), 1e-30)
            tried.append((rows * np.log(left / rows) + len(at) * np.log(rows), extra))
        bic, extra = min(tried)
        if bic >= best:
            break
        best, chosen = bic, [*chosen, extra]
    return {problem.names[j] for j in chosen}


def lasso_stability(problem: Problem, *, draws: int = 60, first: int = 6, often: float = 0.8) -> set[str]:
    """Return what is among the first columns of the lasso's path in most random halves of the 30 s blocks."""
    from sklearn.linear_model import lars_path_gram  # noqa: PLC0415  # a peer is loaded when it is its turn

    blocks = np.unique(problem.block)
    parts = [problem.block == block for block in blocks]
    grams = np.array([problem.columns[part].T @ problem.columns[part] for part in parts])
    towards = np.array([problem.columns[part].T @ problem.residual[part] for part in parts])
    rng, seen = np.random.default_rng(0), np.zeros(len(problem.names))
    for _ in range(draws):
        half = rng.permutation(len(blocks))[: len(blocks) // 2]
        rows = sum(int(parts[at].sum()) for at in half)
        _, active, _ = lars_path_gram(
            towards[half].sum(axis=0), grams[half].sum(axis=0), n_samples=rows, max_iter=first, method="lasso"
        )
        seen[list(active)] += 1
    return {name for name, share in zip(problem.names, seen / draws, strict=True) if share >= often}


PEERS: dict[str, Callable[[Problem], set[str]]] = {
    "pysindy-stlsq-aic": pysindy_aic,
    "stepwise-bic": stepwise_bic,
    "lasso-stability-selection": lasso_stability,
}
"""Who else answers."""


def main(recording: str, simulation: str, out: str) -> None:
    """Let every peer answer one trial."""
    problem = pose(read_recording(Path(recording)), tomllib.loads(Path(simulation).read_text()))
    said = {}
    for name, peer in PEERS.items():
        started = time.perf_counter()
        names = sorted(peer(problem))
        said[name] = {"names": names, "seconds": time.perf_counter() - started}
    Path(out).write_text(json.dumps(said))


if __name__ == "__main__":
    main(*sys.argv[1:])
