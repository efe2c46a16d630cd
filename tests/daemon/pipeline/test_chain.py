"""The chain accepts any frames and counts every reading."""

from collections.abc import Callable

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from regolithd.daemon.config.configuration import Configuration
from regolithd.daemon.pipeline.onnx_models import load_models
from regolithd.daemon.pipeline.pipeline import Chain
from regolithd.daemon.pipeline.snapshot import SlipSource
from regolithd.daemon.publish.encode import encode
from regolithd.drivers.can.frame import Frame

KAPVIK = {
    "nodes": {"inclinometer": 21, "ground_speed": 22, "motor_diagnostics": True},
    "drivetrain": {"no_load_current_A": 0.037, "no_load_current_std_A": 0.001},
}
NODES = (*range(1, 7), *range(11, 17), 21, 22)
IDENTIFIERS = st.sampled_from([0x080, 0x080, 0x080, *(base + node for base in (0x180, 0x280) for node in NODES)])
MODELS = load_models(Configuration.model_validate(KAPVIK))


@st.composite
def traffic(draw: st.DrawFn) -> list[Frame]:
    """Draw frames that are mostly like the rover's, with any content, at times that mostly increase."""
    now, frames = 10**18, []
    for _ in range(draw(st.integers(0, 120))):
        now += draw(st.sampled_from([1000, 100_000, 10_000_000, 500_000_000, -1_000_000_000, 10**12]))
        can_id = draw(IDENTIFIERS | st.integers(0, 0x7FF))
        length = 0 if can_id == 0x080 else draw(st.sampled_from([8, 8, 8, 6, 5]) | st.integers(0, 8))
        extreme = draw(st.sampled_from([None, b"\x00", b"\xff", b"\x7f", b"\x80"]))
        data = extreme * length if extreme else draw(st.binary(min_size=length, max_size=length))
        frames.append(Frame(now, can_id, data))
    return frames


@settings(max_examples=60, deadline=None, suppress_health_check=[HealthCheck.too_slow])
@given(traffic())
def test_no_frame_makes_it_raise_and_every_reading_is_accounted_for(frames: list[Frame]) -> None:
    """Any content, order and clock jumps give one estimate for each snapshot, which can be encoded."""
    chain = Chain(Configuration.model_validate(KAPVIK), MODELS)
    estimates = chain.feed(frames)
    counters = chain.acquisition.counters
    assert counters.snapshots == len(estimates)
    for estimate in estimates:
        snapshot, wheels = encode(estimate, "fuzz")
        assert snapshot.startswith(b"{")
        assert len(wheels) == 6
        assert not (estimate.valid & np.isnan(estimate.cohesion_Pa)).any()


def test_slip_is_measured_configured_or_none(drive: Callable, configuration: Configuration) -> None:
    """It is measured with ground speed, configured without, and none where the wheel stands still."""
    models = load_models(configuration)
    rolling = Chain(configuration, models).feed(drive().frames(10))[-1]
    assert set(rolling.slip_source) == {SlipSource.MEASURED}
    rolled_m_s = 0.075 * 3915 * 2 * np.pi / 60 / 1400
    assert rolling.slip == pytest.approx([1 - 0.02145 / rolled_m_s] * 6)

    blind = Chain(configuration, models).feed(drive(nodes_silent=frozenset({22})).frames(10))[-1]
    assert set(blind.slip_source) == {SlipSource.CONFIGURED}
    assert blind.slip.tolist() == [0.025] * 6
    assert blind.valid.all()

    def stopped(frame: Frame) -> Frame:
        return frame._replace(data=frame.data[:4] + bytes(4)) if 0x181 <= frame.can_id <= 0x186 else frame

    standing = Chain(configuration, models).feed([stopped(frame) for frame in drive().frames(10)])[-1]
    assert set(standing.slip_source) == {SlipSource.NONE}
    assert not standing.valid.any()
    assert np.isnan(standing.slip).all()


def test_backward_is_as_forward_with_the_signs_turned(drive: Callable, configuration: Configuration) -> None:
    """Torque changes its sign; slip, cohesion and friction angle do not."""
    models = load_models(configuration)

    def turned(frame: Frame) -> Frame:
        if 0x181 <= frame.can_id <= 0x186:
            current, speed = np.frombuffer(frame.data[2:4], "<i2")[0], np.frombuffer(frame.data[4:], "<i4")[0]
            return frame._replace(data=frame.data[:2] + np.int16(-current).tobytes() + np.int32(-speed).tobytes())
        if frame.can_id == 0x196:
            return frame._replace(data=np.int32(-np.frombuffer(frame.data[:4], "<i4")[0]).tobytes() + b"\0")
        return frame

    forward = Chain(configuration, models).feed(drive().frames(20))[-1]
    backward = Chain(configuration, models).feed([turned(frame) for frame in drive().frames(20)])[-1]
    np.testing.assert_allclose(backward.wheel_torque_Nm, -forward.wheel_torque_Nm)
    np.testing.assert_allclose(backward.smoothed_torque_Nm, -forward.smoothed_torque_Nm)
    np.testing.assert_allclose(backward.slip, forward.slip)
    np.testing.assert_allclose(backward.cohesion_Pa, forward.cohesion_Pa)
