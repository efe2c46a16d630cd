"""A fleet of robot arms with two joints each: a simulation, and recordings that conceal friction."""

from __future__ import annotations

from datetime import UTC, datetime, timedelta
from functools import partial
from hashlib import sha256
from pathlib import Path
from typing import TYPE_CHECKING, Any, ClassVar

import numpy as np
import pyarrow as pa
import pyarrow.csv

from regolithd.calibration.mismatch import Member, Prior, Simulation, load_simulation, read_recording

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from numpy.typing import NDArray

    from regolithd.calibration.mismatch import Candidate

    Array = NDArray[np.float64]

JOINTS = ("elbow", "wrist")
FIRST = datetime(2026, 3, 1, 8, 0, tzinfo=UTC)
DAYS_APART = 7
GEAR, RIPPLES = 20.0, 2
"""Turns of a motor for one of its joint, and cycles of its ripple in a turn."""
FEW = frozenset({"coulomb-friction", "viscous-friction", "cold-lubricant-friction", "bearing-drag"})


class Arm(Simulation):
    """Two joints whose torque is inertia × acceleration."""

    channel, unit = "torque_Nm", "N·m"
    wheel_column = "axis"
    inputs = ("acceleration_rad_s2",)
    parameters: ClassVar = {"inertia_kg_m2": Prior(0.5, 0.02, "kg·m²")}

    def predict(self, inputs: Mapping[str, Array], values: Mapping[str, float]) -> Array:
        """Return the torque."""
        return values["inertia_kg_m2"] * inputs["acceleration_rad_s2"]

    def covariates(self, inputs: Mapping[str, Array]) -> dict[str, Array]:
        """Return what friction follows."""
        return {"wheel_speed": inputs["speed_rad_s"], "time": inputs["t_s"]}

    def candidates(self, library: Sequence[Candidate]) -> Sequence[Candidate]:
        """Return friction alone, to be quick."""
        return [candidate for candidate in library if candidate.name in FEW]


class ArmWithAngle(Arm):
    """The same with the motors' angles, of which friction may be a ripple."""

    inputs = ("acceleration_rad_s2", "motor_rad")

    def covariates(self, inputs: Mapping[str, Array]) -> dict[str, Array]:
        """Return what friction follows."""
        of_motor = {"wheel_angle": inputs["motor_rad"], "wheel_speed": GEAR * inputs["speed_rad_s"]}
        return {**super().covariates(inputs), **of_motor}

    def candidates(self, library: Sequence[Candidate]) -> Sequence[Candidate]:
        """Return friction and ripple."""
        return [candidate for candidate in library if candidate.name in {*FEW, "wheel-angle-ripple"}]


def columns(
    seed: int, coulomb: Sequence[float] = (0.0, 0.0), viscous: float = 0.0, ripple: float = 0.0, hump: float = 0.0
) -> dict[str, NDArray[Any]]:
    """Return one recording: half a minute, with the Coulomb friction of each joint, and viscous friction of both.

    The ripple has `RIPPLES` cycles a turn, at one phase in all recordings of a motor. The hump is a drag at one speed
    alone, of which the library has no law.
    """
    rng, time_s = np.random.default_rng(seed), 0.05 * np.arange(600)
    made: dict[str, list[NDArray[Any]]] = {}
    for axis, drag in zip(JOINTS, coulomb, strict=True):
        speed = np.sin((0.7 + 0.02 * (seed % 7)) * time_s) + 0.6 * np.sin(1.9 * time_s + rng.uniform(0, 6))
        acceleration = np.gradient(speed, time_s)
        angle = seed + GEAR * 0.05 * np.cumsum(speed)
        torque = 0.5 * acceleration + drag * np.sign(speed) + viscous * speed
        torque += ripple * np.cos(RIPPLES * angle + JOINTS.index(axis))
        torque += hump * np.sign(speed) * np.exp(-(((np.abs(speed) - 0.8) / 0.2) ** 2))
        rows = {
            "t_s": time_s,
            "axis": np.full(len(time_s), axis),
            "speed_rad_s": speed,
            "acceleration_rad_s2": acceleration,
            "motor_rad": angle,
            "torque_Nm": torque + rng.normal(0, 0.15, len(time_s)),
        }
        for name, values in rows.items():
            made.setdefault(name, []).append(values)
    return {name: np.concatenate(values) for name, values in made.items()}


def write_simulation(folder: Path, model: str = "Arm") -> Path:
    """Write a SIM.toml that names a class of this file, for processes that know nothing of these tests."""
    path = folder / "SIM.toml"
    here = Path(__file__).resolve().parent
    path.write_text(f'[simulation]\nmodel = "fleet_arm:{model}"\npath = "{here}"\n', encoding="utf-8")
    return path


def write_recording(path: Path, content: Mapping[str, NDArray[Any]], **more: object) -> Path:
    """Write a recording as CSV, with further columns of one value each."""
    path.parent.mkdir(parents=True, exist_ok=True)
    rows = len(content["t_s"])
    pyarrow.csv.write_csv(pa.table({**content, **{name: [value] * rows for name, value in more.items()}}), path)
    return path


def season(folder: Path, rovers: Mapping[str, Sequence[Mapping[str, Any]]]) -> list[Member]:
    """Write the recordings of each rover, a week apart, with what each conceals; return them as members of a fleet."""
    found = []
    for place, (rover, drives) in enumerate(rovers.items()):
        for number, concealed in enumerate(drives):
            begins = FIRST + timedelta(days=DAYS_APART * number, hours=place)
            path = folder / rover / f"{begins:%Y%m%dT%H%M%SZ}.csv"
            write_recording(path, columns(100 * place + number, **concealed))
            digest = sha256(path.read_bytes()).hexdigest()
            read = partial(read_recording, path, unit="axis")
            found.append(Member(f"{rover}/{path.name}", rover, begins, read, digest))
    return found


def loader(folder: Path) -> partial[Simulation]:
    """Return what loads the simulation, here or in another process."""
    return partial(load_simulation, write_simulation(folder))
