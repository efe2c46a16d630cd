"""Runs a solver in isolation from the truth.

Until the answer is written the truth exists only in the memory of this process. If the kernel permits user and PID
namespaces, the solver runs as process 1 of its own PID namespace: it sees no other process, so it can read neither this
one's memory nor the seed on its command line. Otherwise it is an ordinary child process, which `describe` states.
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

NAMESPACE_COMMAND = ("unshare", "--user", "--map-root-user", "--pid", "--fork", "--kill-child", "--mount-proc")
INHERITED_VARIABLES = ("PATH", "HOME", "LANG", "LC_ALL", "VIRTUAL_ENV", "TMPDIR")


@functools.cache
def namespaces_available() -> bool:
    """Return whether this kernel permits a PID namespace for a child process."""
    if shutil.which(NAMESPACE_COMMAND[0]) is None:
        return False
    tried = subprocess.run([*NAMESPACE_COMMAND, "true"], capture_output=True, check=False)  # noqa: S603  # a constant
    return tried.returncode == 0


def describe() -> str:
    """Return one sentence that states how the solver is isolated from the truth."""
    if namespaces_available():
        return "the truth stays in this process's memory; the solver runs in its own PID namespace"
    return "the truth stays in this process's memory; the solver is an ordinary child process (no PID namespaces here)"


def environment(threads: int) -> dict[str, str]:
    """Return the environment of the solver: paths, locale, and the number of threads."""
    kept = {name: os.environ[name] for name in INHERITED_VARIABLES if name in os.environ}
    limits = dict.fromkeys(("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"), str(threads))
    project = str(Path(regolithd.__file__).parent.parent)
    return {**kept, **limits, "PYTHONPATH": project, "PATH": f"{Path(sys.executable).parent}:{kept.get('PATH', '')}"}


def run_isolated(command: Sequence[str], folder: Path, *, threads: int, timeout_s: float) -> None:
    """Run a command in a folder, isolated from the truth.

    Raises
    ------
    SolverError
        The command failed or exceeded the timeout; the message has the last lines of its standard error.
    """
    full = [*(NAMESPACE_COMMAND if namespaces_available() else ()), *command]
    try:
        done = subprocess.run(  # noqa: S603  # the user's own choice of solver
            full, cwd=folder, env=environment(threads), capture_output=True, text=True, timeout=timeout_s, check=False
        )
    except subprocess.TimeoutExpired as error:
        raise SolverError(f"no answer within {timeout_s:.0f} s") from error
    if done.returncode != 0:
        raise SolverError("\n".join(done.stderr.strip().splitlines()[-6:]) or f"exit status {done.returncode}")
