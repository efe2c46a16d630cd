"""Figures of the evaluation for `docs/`: errors, coverage, one window, alarm delays, drivetrain calibration."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import matplotlib as mpl
import numpy as np

from regolithd.calibration.parameters import SOILS, Drivetrain, Rover, Wheel
from regolithd.calibration.posterior import simulated_rovers
from regolithd.calibration.posterior.window import CalibrationUncertainty, reduce_windows
from regolithd.calibration.terrain.soils import draw_soils, soils_from
from regolithd.calibration.validation.estimators.errors_and_coverage import NO_LOAD_A
from regolithd.calibration.validation.estimators.simulated_drives import SPEED_M_S
from regolithd.calibration.validation.reproduction.pictures import (
    OURS,
    PAPER,
    SOIL_COLOURS,
    SOIL_MARKERS,
    STYLE,
    figure,
    save,
)

if TYPE_CHECKING:
    from collections.abc import Mapping
    from pathlib import Path

    from matplotlib.axes import Axes
    from numpy.typing import NDArray

    from regolithd.calibration.posterior.estimator import PosteriorEstimator
    from regolithd.calibration.terrain.soils import Soils

    Array = NDArray[np.float64]

OFFSET: Any = {"textcoords": "offset points", "fontsize": 10}
TRUTH = "sandy-loam"
"""The soil of `one_sample`."""
CLASSICAL, SINGLE, SOIL_KNOWN = "#b08d57", "#e59866", "#922b21"


def errors(found: Mapping[str, float], path: Path) -> None:
    """Draw the root-mean-square errors of c and φ, method by method."""
    bars = [
        ("prior mean, without data", "window_prior_mean", "#d5d8dc"),
        ("paper's network, 10 s × 6 wheels", "window_paper", PAPER),
        ("least squares, z and K given, 10 s × 6 wheels", "window_least_squares", CLASSICAL),
        ("posterior, one instant of one wheel", "instant_posterior", SINGLE),
        ("posterior, 10 s × 6 wheels", "window_posterior", OURS),
        ("the same, soil class known", "told_window_posterior", SOIL_KNOWN),
    ]
    with mpl.rc_context(STYLE):
        made = figure(11, 3.6)
        panels = made.subplots(1, 2, sharey=True)
        for panel, key, unit, scale in (
            (panels[0], "rmse_cohesion_Pa", "error of c (kPa, r.m.s.)", 1e-3),
            (panels[1], "rmse_friction_angle_deg", "error of φ (°, r.m.s.)", 1.0),
        ):
            values = [scale * found[f"{name}_{key}"] for _, name, _ in bars]
            drawn = panel.barh([label for label, _, _ in bars], values, color=[colour for _, _, colour in bars])
            panel.bar_label(drawn, fmt="%.2f" if scale < 1 else "%.1f", padding=3)
            panel.set_xlabel(unit)
        panels[0].invert_yaxis()
        made.suptitle(
            f"{found['rovers']:.0f} rovers on held-out soils, noise of the paper's Table 4", x=0.01, ha="left"
        )
        save(made, path)


def calibration(found: Mapping[str, float], ranks: Array, path: Path) -> None:
    """Draw the rank histograms, and the coverage over all rovers and in each true class, known and not."""
    targets = ("cohesion", "friction_angle", "margin")
    with mpl.rc_context(STYLE):
        made = figure(11, 6.4)
        panels = made.subplots(2, 3)
        for column, (target, label) in enumerate(zip(targets, ("c", "φ", "drawbar margin"), strict=True)):
            _ranks(panels[0, column], ranks[:, column], label)
            _coverage(panels[1, column], found, target)
        panels[0, 0].set_ylabel("rovers")
        panels[1, 0].set_ylabel("coverage (%)")
        handles, labels = panels[1, 2].get_legend_handles_labels()
        made.legend(handles, labels, loc="outside lower left", ncols=3, fontsize=9.5)
        save(made, path)


def _ranks(panel: Axes, ranks: Array, label: str) -> None:
    panel.hist(ranks, bins=20, range=(0, 1), color=OURS, alpha=0.8)
    expected = len(ranks) / 20
    panel.axhspan(expected - 2 * expected**0.5, expected + 2 * expected**0.5, color="black", alpha=0.15)
    panel.set(title=label, xlabel="rank of the truth in the posterior")


def _coverage(panel: Axes, found: Mapping[str, float], target: str) -> None:
    names = ["", *SOILS]
    for name, colour, fill, label in (
        ("window", PAPER, "none", "class not known"),
        ("told_window", OURS, OURS, "class known"),
    ):
        for level, marker in ((50, "o"), (90, "s")):
            values = [100 * found[f"{name}_coverage_{level}_{target}{'_' + each if each else ''}"] for each in names]
            style: dict[str, Any] = {
                "color": colour,
                "markerfacecolor": fill,
                "markeredgewidth": 1.5,
                "label": f"{label}, {level} %",
            }
            panel.plot(range(len(names)), values, marker, markersize=6, **style)
    for level, legend in ((50, "expected (ranks: ± 2 standard errors; coverage: ± 2 %)"), (90, None)):
        panel.axhspan(level - 2, level + 2, color="black", alpha=0.15, label=legend)
    panel.set_xticks(range(len(names)), ["all", *(each.replace("-", "\n") for each in SOILS)], fontsize=9.5)
    panel.set_ylim(0, 102)


def one_sample(estimator: PosteriorEstimator, path: Path, seed: int = 3) -> None:
    """Draw the posterior of `TRUTH` from one instant of one wheel, and from ten seconds of six wheels."""
    rng = np.random.default_rng(seed)
    wheel, drivetrain = Wheel(), Drivetrain()
    known = CalibrationUncertainty().deviations()
    rovers = simulated_rovers.draw_rovers(1, rng, known, no_load_A=NO_LOAD_A)
    soils = soils_from([SOILS[TRUTH]], wheel.width_m)
    rovers = simulated_rovers.SimulatedRovers(
        soils=soils,
        nearest_class=np.array([1]),
        load_N=np.array([[47.0, 52, 49, 46, 51, 48]]),
        slip=np.full((1, 6), 0.025),
        no_load_A=rovers.no_load_A,
        gain_error=rovers.gain_error,
        no_load_error_A=rovers.no_load_error_A,
        slip_error=0 * rovers.slip_error,
        uncertainty=known,
    )
    measured = simulated_rovers.simulate_measurements(
        rovers, simulated_rovers.table_4_noise(1), 20, rng, drivetrain, wheel
    )
    single = measured.load_N[:, :1].copy()
    single[..., [0, 1, 2, 3, 5]] = np.nan
    one = reduce_windows(single, measured.slip[:, :1], measured.torque_Nm[:, :1], known, wheel.radius_m)
    many = reduce_windows(measured.load_N, measured.slip, measured.torque_Nm, known, wheel.radius_m)
    prior, _ = draw_soils(4000, rng)
    with mpl.rc_context(STYLE):
        made = figure(11, 4.4)
        panels = made.subplots(1, 2, sharex=True, sharey=True)
        for panel, windows, colour, title in (
            (panels[0], one, SINGLE, "one instant of one wheel"),
            (panels[1], many, OURS, "ten seconds of six wheels"),
        ):
            _scatter(panel, prior, estimator.mixtures(windows).sample(3000, rng)[0], colour)
            panel.set(title=title, xlabel="c (kPa)", xlim=(0, 11), ylim=(4, 43))
        panels[0].set_ylabel("φ (°)")
        panels[1].legend(loc="upper left", bbox_to_anchor=(1, 1))
        save(made, path)


def _scatter(panel: Axes, prior: Soils, samples: Array, colour: str) -> None:
    """Draw samples of prior and posterior, the classes of Table 1, and the truth (sandy loam)."""
    panel.plot(prior.cohesion_Pa / 1e3, prior.friction_angle_deg, ".", color="#d5d8dc", markersize=2, label="prior")
    panel.plot(
        samples[:, 0] / 1e3,
        np.degrees(samples[:, 1]),
        ".",
        color=colour,
        markersize=3,
        alpha=0.5,
        label="posterior",
    )
    for (name, soil), shade, marker in zip(SOILS.items(), SOIL_COLOURS, SOIL_MARKERS, strict=True):
        if name == TRUTH:
            continue
        panel.plot(
            soil.cohesion_Pa / 1e3,
            soil.friction_angle_deg,
            marker,
            color=shade,
            linestyle="none",
            markersize=8,
            markeredgecolor="white",
            label=name,
        )
    truth = SOILS[TRUTH]
    panel.plot(
        truth.cohesion_Pa / 1e3, truth.friction_angle_deg, "*", color="black", markersize=16, label=f"truth: {TRUTH}"
    )


def alarm(delays: Mapping[str, Array], path: Path) -> None:
    """Draw the share of rovers with an alarm against the delay."""
    lines: list[tuple[str, str, dict[str, Any]]] = [
        ("cusum_delay", "CUSUM, white noise", {"color": OURS}),
        ("cusum_delay_correlated", "CUSUM, noise correlated over 0.5 s", {"color": OURS, "linestyle": "--"}),
        ("paper_instant_delay", "paper's network: fall of c", {"color": "#bdc3c7"}),
        ("paper_10_s_delay", "paper's network: fall of 10 s mean", {"color": PAPER}),
        ("paper_shift_delay", "paper's network: shift of 10 s mean", {"color": PAPER, "linestyle": "--"}),
        ("paper_shift_delay_flat", "the same, level ground", {"color": "#2c3e50", "linestyle": "--"}),
    ]
    with mpl.rc_context(STYLE):
        made = figure(11, 4.9)
        panels = made.subplots(1, 2, sharey=True)
        for panel, suffix, title in (
            (panels[0], "", "all six wheels at once"),
            (panels[1], "_by_axle", "axle after axle, at 2.2 cm/s"),
        ):
            for key, label, style in lines:
                name = key.replace("_delay", f"_delay{suffix}")
                values = np.sort(delays[f"alarm_{name}"])
                share = 100 * np.arange(1, len(values) + 1) / len(values)
                reached = np.isfinite(values)
                panel.step(
                    [0, *values[reached], 120],
                    [0, *share[reached], share[reached].max(initial=0.0)],
                    where="post",
                    label=label if reached.any() else f"{label}: never",
                    **style,
                )
            panel.set(title=title, xlabel="seconds since the front axle met LETE sand", xlim=(0, 90), ylim=(0, 102))
        for axle, name in ((1, "middle axle"), (2, "rear axle")):
            crossing_s = axle * Rover().wheelbase_m / 2 / SPEED_M_S
            panels[1].axvline(crossing_s, color="black", linewidth=0.8, linestyle=":")
            panels[1].annotate(name, (crossing_s, 101), (-3, 0), ha="right", va="top", rotation=90, **OFFSET)
        panels[0].set_ylabel("rovers with an alarm (%)")
        made.legend(*panels[1].get_legend_handles_labels(), loc="outside lower left", ncols=3, fontsize=10)
        made.suptitle("Sandy loam to LETE sand, 35 % current noise, 2 Hz, one false alarm in 8 h", x=0.01, ha="left")
        save(made, path)


def drivetrain(found: Mapping[str, float], path: Path) -> None:
    """Draw error and coverage of c with a no-load current of 37 mA, calibrated and not."""
    names = {
        "calibrated": "wheels-up calibration",
        "uncalibrated": "none: no-load current attributed to the soil",
        "uncalibrated_and_doubted": "none, stated uncertainty 10 mA",
    }
    with mpl.rc_context(STYLE):
        made = figure(9, 2.6)
        panels = made.subplots(1, 2, sharey=True)
        for panel, key, label, scale in (
            (panels[0], "rmse_cohesion_Pa", "error of c (kPa, r.m.s.)", 1e-3),
            (panels[1], "coverage_90", "coverage of the 90 % interval (%)", 100.0),
        ):
            values = [scale * found[f"drivetrain_{name}_{key}"] for name in names]
            drawn = panel.barh(list(names.values()), values, color=[OURS, PAPER, CLASSICAL])
            panel.bar_label(drawn, fmt="%.2f" if scale < 1 else "%.0f", padding=3)
            panel.set_xlabel(label)
        panels[0].invert_yaxis()
        save(made, path)
