"""An answer with everything in it, and evidence without chance, for the tests of the report."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from regolithd.calibration.mismatch.answer import (
    Answer,
    Curve,
    Effect,
    Evidence,
    FitImprovement,
    Indistinguishable,
    Parameter,
    Sensitivity,
    Unexplained,
)
from regolithd.calibration.mismatch.inference.findings import Findings
from regolithd.calibration.mismatch.report.template import Provenance

FROM = Provenance("drive.csv", "SIM.toml", "ab" * 32, "cd" * 32, "regolithd mismatch drive.csv --simulation SIM.toml")
WORN = Effect(
    name="bearing-drag",
    channel="motor_current_A",
    wheels=(4,),
    covariate="time",
    onset_s=612.0,
    equation="Δy = y_b g(t − t_0) sign(ω)",
    statement="drag on wheel 4 from 612 s on",
    parameters={"drag_current": Parameter(0.0077, 0.0071, 0.0083, "A"), "onset_s": Parameter(612.0, 590.0, 630.0, "s")},
    rmse_before=0.0069,
    rmse_after=0.0048,
)
VISCOUS = replace(
    WORN,
    name="viscous-friction",
    wheels=(1, 2, 3, 4, 5, 6),
    covariate="wheel_speed",
    onset_s=None,
    equation="Δy = k |ω|^p",
    parameters={"size": Parameter(4e-5, 3.5e-5, 4.5e-5, "A s/rad")},
    rmse_before=0.0048,
    rmse_after=0.0049,
)


def evidence(duration_s: float) -> Evidence:
    """Return a recording of six wheels without chance: waves of different frequency on each wheel."""
    count, blocks = 120, 12
    time_s = np.linspace(0.0, duration_s, count)
    wheel = np.arange(1, 7)
    wave = 0.07 + 0.02 * np.sin(time_s[:, None] * wheel / duration_s * 6)
    wave[7, 2] = np.nan
    at = (np.arange(blocks) + 0.5) * duration_s / blocks
    before = 4 * np.sin(np.arange(blocks)[:, None] * wheel / 7)
    before[3, 2] = np.nan
    grid = np.linspace(0.0, duration_s, 9)
    drag = Curve("time", "drag", grid, 1e-5 * grid, 1e-6 * grid, 1e-4 + 0 * grid, (4,))
    low, width = np.linspace(-3e-3, 3e-3, 9), 2e-4 + 0 * grid
    speed = Curve("wheel_speed", "viscous", np.linspace(-0.4, 0.4, 9), low, 0 * grid, width, (1, 2))
    return Evidence(
        channel="motor_current_A",
        unit="A",
        time_s=time_s,
        wheels=tuple(wheel.tolist()),
        measured=wave,
        before=0.1 * wave,
        after=0.02 * wave,
        map_time_s=at,
        map_before=before,
        map_after=before / 4,
        curves=(drag, speed),
        values={},
        contributions=(),
    )


ANSWER = Answer(
    "missing-physics",
    (WORN, VISCOUS),
    (Unexplained("motor_current_A", (1, 2), "voltage", 0.0, 1800.0, 0.1),),
    (Indistinguishable(("coulomb-friction", "viscous-friction"), "Drive a staircase."),),
    (
        Sensitivity("coulomb-friction", "motor_current_A", float("inf"), "A"),
        Sensitivity("rotor-inertia", "motor_current_A", 0.0123, "A s²/rad"),
    ),
    FitImprovement("motor_current_A", 0.0061, 0.0049, 0.0048),
    notes=("bus_voltage_V was never measured.",),
)
FINDINGS = Findings(
    verdict=ANSWER.verdict,
    effects=ANSWER.effects,
    changes=ANSWER.changes,
    unexplained=ANSWER.unexplained,
    parameters=ANSWER.parameters,
    left_out=ANSWER.left_out,
    notes=ANSWER.notes,
)
CONSISTENT = Answer(
    "consistent", (), (), (), ANSWER.sensitivity, FitImprovement("motor_current_A", 0.0061, 0.0061, 0.006)
)
