"""EMCY error codes."""

from __future__ import annotations

from hypothesis import given
from hypothesis import strategies as st

from regolithd.drivers.canopen.emcy import error_text
from regolithd.drivers.devices.motor_controller import MOTOR_CONTROLLER


def test_an_error_code_has_the_most_specific_text() -> None:
    """The manufacturer's text of a code is preferred to CiA 301's, and that to the text of its class."""
    assert "undervoltage" in error_text(0x3220, MOTOR_CONTROLLER.error_texts)
    assert error_text(0x3220) == "voltage inside the device"
    assert "heartbeat" in error_text(0x8130)
    assert error_text(0x5001) == "device hardware"
    assert error_text(0xA000) == "reserved error class"
    assert error_text(0x0000) == "no error, or an error is reset"


@given(st.integers(0, 0xFFFF))
def test_every_error_code_has_a_text(code: int) -> None:
    """There is a text for each of the 65 536 codes."""
    assert error_text(code)
    assert error_text(code, MOTOR_CONTROLLER.error_texts)
