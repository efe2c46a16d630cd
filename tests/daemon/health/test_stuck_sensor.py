"""A sensor whose reading no longer changes is detected, and no other."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
import pytest

from regolithd.daemon.health.stuck_sensor import StuckSensorDetector
from regolithd.daemon.pipeline.snapshot import QUANTITIES, ROW, Snapshot
from regolithd.drivers.devices.load_cell import LOAD
from regolithd.drivers.devices.motor_controller import MOTOR_CURRENT, MOTOR_SPEED

if TYPE_CHECKING:
    from regolithd.drivers.devices.device import Quantity


def snapshots(
    rate_Hz: float,
    seconds: float,
    *,
    frozen: tuple[int, ...] = (),
    speed: float = 400.0,
    noise: float = 0.3,
    seed: int = 5,
) -> list[Snapshot]:
    """Return a drive on which the readings of some load cells (1–6) do not change."""
    rng = np.random.default_rng(seed)
    made = []
    for k in range(int(rate_Hz * seconds)):
        values = np.full((len(QUANTITIES), 6), np.nan)
        values[ROW[MOTOR_SPEED]] = speed
        values[ROW[MOTOR_CURRENT]] = np.round(0.07 * (1 + noise * rng.standard_normal(6)), 3)
        values[ROW[LOAD]] = np.round(49 * (1 + noise / 3 * rng.standard_normal(6)), 2)
        values[ROW[LOAD], [wheel - 1 for wheel in frozen]] = 48.23
        made.append(Snapshot(k, round(k * 1e9 / rate_Hz), values))
    return made


def watch(*drives: list[Snapshot]) -> tuple[tuple[Quantity, int], ...]:
    """Return the sensors that are stuck at the end."""
    watching = StuckSensorDetector()
    for drive in drives:
        for snapshot in drive:
            watching.step(snapshot)
    return watching.stuck


@pytest.mark.parametrize("rate_Hz", [2.0, 10.0, 100.0])
def test_a_load_that_stays_the_same_is_stuck(rate_Hz: float) -> None:
    """One or two constant load cells are stuck after 20 snapshots and 5 s, whichever is longer."""
    assert watch(snapshots(rate_Hz, 12, frozen=(3,))) == ((LOAD, 3),)
    assert watch(snapshots(rate_Hz, 12, frozen=(2, 6))) == ((LOAD, 2), (LOAD, 6))
    assert watch(snapshots(rate_Hz, 4.9, frozen=(3,))) == ()


def test_at_a_slow_sync_twenty_repetitions_are_awaited() -> None:
    """At 2 Hz, five seconds are ten readings, which may be equal by chance."""
    assert watch(snapshots(2.0, 10, frozen=(3,))) == ()
    assert watch(snapshots(2.0, 10.5, frozen=(3,))) == ((LOAD, 3),)


def test_it_is_over_with_the_first_reading_that_differs() -> None:
    """The first reading that differs ends the detection."""
    assert watch(snapshots(10, 12, frozen=(3,)), snapshots(10, 0.3, seed=6)) == ()


@pytest.mark.parametrize("seed", range(20))
def test_an_ordinary_drive_has_no_stuck_sensor(seed: int) -> None:
    """Ten minutes at 10 Hz with noise of one digit give no detection."""
    assert watch(snapshots(10, 30, noise=0.0005, seed=seed)) == ()


def test_who_stands_or_has_no_noise_at_all_is_not_stuck() -> None:
    """Constant readings are not judged while the wheels stand still, or when all of them are constant."""
    assert watch(snapshots(10, 12, frozen=(3,), speed=0.0)) == ()
    assert watch(snapshots(10, 12, noise=0.0)) == ()


def test_what_is_not_measured_is_not_stuck() -> None:
    """NaN does not count as a constant reading, and a gap restarts the count."""
    drive = snapshots(10, 12, frozen=(3,))
    for snapshot in drive[::40]:
        snapshot.values[ROW[LOAD], 2] = np.nan
    assert watch(drive) == ()
