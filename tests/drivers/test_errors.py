"""The error messages and the documented tree of the drivers' exceptions."""

from __future__ import annotations

import builtins
import re

from regolithd.drivers import errors
from regolithd.drivers.errors import BusDownError, DriverError, SdoTimeoutError


def test_a_message_says_where_what_and_the_cure() -> None:
    """In that order, and only what is known."""
    error = SdoTimeoutError("no answer within 0.5 s", node_id=3, index=0x1018, subindex=1, cure="Is it powered?")
    assert str(error) == "node 3, object 0x1018:01: no answer within 0.5 s. Is it powered?"
    assert str(BusDownError("vcan0: cannot send")) == "vcan0: cannot send"


def test_the_tree_that_is_drawn_is_the_tree_that_is() -> None:
    """Each error of the module stands in its docstring, is a `DriverError`, and the standard error drawn beside it."""
    for name, error in vars(errors).items():
        if not (isinstance(error, type) and issubclass(error, DriverError)):
            continue
        found = re.search(rf"^[ │├└─]*{name}(?: \((\w+)\))?(?:  |$)", errors.__doc__ or "", re.MULTILINE)
        assert found, f"{name} is not drawn"
        if found[1]:
            assert issubclass(error, getattr(builtins, found[1])), found[0]
