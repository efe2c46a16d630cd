"""The data classes of one SYNC: which row each quantity is, what is valid, and that nothing can be changed."""

import dataclasses

import numpy as np
import pytest

from regolithd.daemon.pipeline.snapshot import (
    ROW,
    WHEELS,
    AcquisitionCounters,
    Estimate,
    SlipSource,
    Snapshot,
    SoilChange,
)
from regolithd.drivers.devices.ground_speed import GROUND_SPEED
from regolithd.drivers.devices.load_cell import LOAD
from regolithd.drivers.devices.motor_controller import MOTOR_CURRENT, MOTOR_SPEED
from regolithd.drivers.devices.registry import QUANTITIES

VALUES = np.arange(len(QUANTITIES) * WHEELS, dtype=float).reshape(len(QUANTITIES), WHEELS)


def estimate(snapshot: Snapshot) -> Estimate:
    """Return an estimate whose second input is outside the training range on wheel 3."""
    nothing = np.full(WHEELS, np.nan)
    outside = np.zeros((2, WHEELS), bool)
    outside[1, 2] = True
    return Estimate(
        snapshot=snapshot,
        wheel_torque_Nm=nothing,
        smoothed_torque_Nm=nothing,
        smoothed_load_N=nothing,
        slip=nothing,
        slip_source=(SlipSource.NONE,) * WHEELS,
        cohesion_Pa=nothing,
        friction_angle_rad=nothing,
        valid=np.zeros(WHEELS, bool),
        input_names=("load_N", "slip"),
        outside=outside,
        model_version="test-1",
    )


def test_every_quantity_is_the_row_of_its_place_in_the_registry() -> None:
    """A snapshot is indexed by quantity, in the order of the registry."""
    snapshot = Snapshot(0, 0, VALUES)
    for row, quantity in enumerate(QUANTITIES):
        np.testing.assert_array_equal(snapshot[quantity], VALUES[row])


def test_each_property_is_its_quantity() -> None:
    """The four properties that the pipeline uses return the rows of their quantities."""
    snapshot = Snapshot(0, 0, VALUES)
    for values, quantity in (
        (snapshot.motor_current_A, MOTOR_CURRENT),
        (snapshot.motor_speed_rad_s, MOTOR_SPEED),
        (snapshot.load_N, LOAD),
        (snapshot.ground_speed_m_s, GROUND_SPEED),
    ):
        np.testing.assert_array_equal(values, VALUES[ROW[quantity]])


@pytest.mark.parametrize("quantity", QUANTITIES, ids=str)
def test_a_wheel_is_valid_unless_current_speed_or_load_is_missing(quantity: object) -> None:
    """Any other quantity may be missing."""
    values = VALUES.copy()
    values[ROW[quantity], 3] = np.nan  # type: ignore[index]
    needed = quantity in (MOTOR_CURRENT, MOTOR_SPEED, LOAD)
    assert Snapshot(0, 0, values).valid.tolist() == [True, True, True, not needed, True, True]


@pytest.mark.parametrize(
    "made", [Snapshot(0, 0, VALUES), estimate(Snapshot(0, 0, VALUES))], ids=["snapshot", "estimate"]
)
def test_snapshots_and_estimates_cannot_be_changed_and_are_equal_to_themselves_alone(made: object) -> None:
    """They hold arrays, whose comparison is not one truth value, and are handed from task to task."""
    name = dataclasses.fields(made)[0].name  # type: ignore[arg-type]
    with pytest.raises(dataclasses.FrozenInstanceError):
        setattr(made, name, None)
    assert not hasattr(made, "__dict__")
    assert made != dataclasses.replace(made)  # type: ignore[type-var]
    assert len({made, dataclasses.replace(made)}) == 2  # type: ignore[type-var]


def test_a_soil_change_cannot_be_changed() -> None:
    """It is published and recorded by different tasks."""
    change = SoilChange(alarm=None, fall=None)  # type: ignore[arg-type]
    with pytest.raises(dataclasses.FrozenInstanceError):
        change.fall = None  # type: ignore[misc]
    assert not hasattr(change, "__dict__")


def test_every_count_of_readings_begins_at_zero() -> None:
    """Nothing has been received when a run begins."""
    counters = AcquisitionCounters()
    assert set(dataclasses.astuple(counters)) == {0}
    with pytest.raises(dataclasses.FrozenInstanceError):
        counters.late = 1  # type: ignore[misc]


def test_the_inputs_outside_the_training_range_are_named_for_each_wheel() -> None:
    """The names are in the order of the network's inputs."""
    made = estimate(Snapshot(0, 0, VALUES))
    assert made.outside_inputs == [(), (), ("slip",), (), (), ()]
