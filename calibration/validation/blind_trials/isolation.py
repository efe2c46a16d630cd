"""Run a program that must not see the truth.

The truth lives in the memory of this process alone until the answer is in. Where the kernel grants user and process
namespaces, the solver is process 1 of its own: it finds no other process, so neither this one's memory nor the seed on
its command line. Elsewhere it is an ordinary child, and `describe` says so.
"""

from __future__ import annotations

import functools
import os
import shutil
import subprocess
import sys
from pathlib import Path
from typing import TYPE_CHECKING

import regolithd
from regolithd.calibration.validation.blind_trials.errors import SolverError

if TYPE_CHECKING:
    from collections.abc import Sequence

ALONE = ("unshare", "--user", "--map-root-user", "--pid", "--fork", "--kill-child", "--mount-proc")
KEPT = ("PATH", "HOME", "LANG", "LC_ALL", "VIRTUAL_ENV", "TMPDIR")


@functools.cache
def can_be_alone() -> bool:
    """Return whether a program can be given a process namespace of its own here."""
    if shutil.which(ALONE[0]) is None:
        return False
    tried = subprocess.run([*ALONE, "true"], capture_output=True, check=False)  # noqa: S603  # a constant
    return tried.returncode == 0


def describe() -> str:
    """Return one sentence on what keeps the solver from the truth."""
    if can_be_alone():
        return "the truth stays in this process's memory; the solver runs in a process namespace of its own"
    return (
        "the truth stays in this process's memory; the solver is an ordinary child (this kernel grants no namespaces)"
    )


def environment(threads: int) -> dict[str, str]:
    """Return what the solver may know of its surroundings: where Python is, and how many threads to use."""
    kept = {name: os.environ[name] for name in KEPT if name in os.environ}
    limits = dict.fromkeys(("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"), str(threads))
    project = str(Path(regolithd.__file__).parent.parent)
    return {**kept, **limits, "PYTHONPATH": project, "PATH": f"{Path(sys.executable).parent}:{kept.get('PATH', '')}"}


def run_alone(command: Sequence[str], folder: Path, *, threads: int, timeout_s: float) -> None:
    """Run a command in the folder, where it cannot see the truth.

    Raises
    ------
    SolverError
        When it fails or takes too long; with the last lines that it wrote.
    """
    full = [*(ALONE if can_be_alone() else ()), *command]
    try:
        done = subprocess.run(  # noqa: S603  # the user's own choice of solver
            full, cwd=folder, env=environment(threads), capture_output=True, text=True, timeout=timeout_s, check=False
        )
    except subprocess.TimeoutExpired as error:
        raise SolverError(f"no answer within {timeout_s:.0f} s") from error
    if done.returncode != 0:
        raise SolverError("\n".join(done.stderr.strip().splitlines()[-6:]) or f"exit status {done.returncode}")
