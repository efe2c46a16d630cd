"""Threads of the linear algebra: one, for each command that compares."""

from __future__ import annotations

import os
import subprocess
import sys

import pytest

CALLS = {
    "mismatch": ["mismatch", "no.csv", "--simulation", "no.toml"],
    "monitor": ["monitor", "no.csv", "--simulation", "no.toml"],
    "compare": ["compare", "--config", "no.toml"],
}


@pytest.mark.parametrize(
    ("command", "stated", "expected"),
    [("mismatch", None, "1"), ("mismatch", "3", "3"), ("monitor", None, "1"), ("compare", None, "1")],
)
def test_linear_algebra_has_one_thread_unless_its_user_says_otherwise(
    command: str, stated: str | None, expected: str
) -> None:
    """It is told before NumPy is loaded, which reads it then."""
    asked = {name: value for name, value in os.environ.items() if name != "OPENBLAS_NUM_THREADS"}
    code = (
        "import os, sys; from regolithd.daemon.cli import app; print('numpy' in sys.modules)\n"
        f"try: app({CALLS[command]!r}, standalone_mode=False)\n"
        "finally: print('numpy' in sys.modules, os.environ['OPENBLAS_NUM_THREADS'])"
    )
    done = subprocess.run(
        [sys.executable, "-c", code],
        env=asked | ({} if stated is None else {"OPENBLAS_NUM_THREADS": stated}),
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.stdout.split() == ["False", "True", expected], done.stderr
