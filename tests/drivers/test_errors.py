"""The error messages and the documented tree of the drivers' exceptions."""

from __future__ import annotations

import builtins
import re

from regolithd.drivers import errors
from regolithd.drivers.errors import BusDownError, DriverError, SdoTimeoutError


def test_a_message_has_place_problem_and_remedy() -> None:
    """An error message consists of node and object, what happened, and the remedy, as far as they are known."""
    error = SdoTimeoutError("no answer within 0.5 s", node_id=3, index=0x1018, subindex=1, remedy="Is it powered?")
    assert str(error) == "node 3, object 0x1018:01: no answer within 0.5 s. Is it powered?"
    assert str(BusDownError("vcan0: cannot send")) == "vcan0: cannot send"


def test_the_documented_error_tree_is_complete() -> None:
    """Each error is in the docstring of the module, and derives from the standard error named there."""
    for name, error in vars(errors).items():
        if not (isinstance(error, type) and issubclass(error, DriverError)):
            continue
        found = re.search(rf"^[ │├└─]*{name}(?: \((\w+)\))?(?:  |$)", errors.__doc__ or "", re.MULTILINE)
        assert found, f"{name} is not drawn"
        if found[1]:
            assert issubclass(error, getattr(builtins, found[1])), found[0]
