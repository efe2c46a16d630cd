"""Runs pytest in forks of one process that has imported the libraries: for most mutants that is half of the time.

`python fork_server.py` reads a JSON object per line: `arguments` of pytest, `cpu_s`, `environment`, and `output`, the
path of a file for what it prints. It answers with a line `{"pid": …}` when it has started, and with a line
`{"status": …}` when it has ended: pytest's exit status, or minus the signal. Nothing of the rooms is imported before
the fork, so that each run imports them as they are then.
"""

from __future__ import annotations

import contextlib
import importlib
import json
import os
import resource
import signal
import sys
from pathlib import Path
from typing import Any, NoReturn

LIBRARIES = (
    *("pytest", "_pytest.legacypath", "pytest_asyncio.plugin", "pytest_timeout", "pytest_cov.plugin", "xdist.plugin"),
    *("hypothesis", "numpy", "numpy.ma", "numpy.fft", "numpy.random", "pydantic", "jinja2", "tomlkit"),
    *("scipy.linalg", "scipy.optimize", "scipy.signal", "scipy.sparse.linalg", "scipy.special", "scipy.stats"),
    *("canopen", "can", "aiomqtt", "mcap.reader", "mcap.writer", "rich.console", "rich.live", "typer", "typer.testing"),
)
"""What tests of several files import; one that is not installed is passed over."""
ALREADY_IMPORTED = "ignore::pytest.PytestAssertRewriteWarning"
"""pytest would rewrite the assertions of its own plugins, which is of no use here."""


def main() -> None:
    """Serve until the input ends."""
    for name in LIBRARIES:
        with contextlib.suppress(ImportError):
            importlib.import_module(name)
    with contextlib.suppress(BrokenPipeError, KeyboardInterrupt):
        for line in sys.stdin:
            _serve(line)


def _serve(order: str) -> None:
    """Fork for one run and wait for it; where the caller has gone meanwhile, end the run."""
    pid = os.fork()
    if pid == 0:
        _run(**json.loads(order))
    try:
        print(json.dumps({"pid": pid}), flush=True)
        _, status = os.waitpid(pid, 0)
        print(json.dumps({"status": os.waitstatus_to_exitcode(status)}), flush=True)
    finally:
        with contextlib.suppress(ProcessLookupError):
            os.killpg(pid, signal.SIGKILL)


def _run(arguments: list[str], cpu_s: int, environment: dict[str, str], output: str) -> NoReturn:
    """Be one run of pytest, in a session of its own, so that what it leaves behind can be ended."""
    status: Any = 1
    try:
        os.setsid()
        resource.setrlimit(resource.RLIMIT_CPU, (cpu_s, cpu_s + 5))
        signal.signal(signal.SIGXCPU, signal.SIG_DFL)
        file = os.open(output, os.O_WRONLY | os.O_CREAT | os.O_TRUNC)
        empty = os.open(os.devnull, os.O_RDONLY)
        for number, source in ((0, empty), (1, file), (2, file)):
            os.dup2(source, number)
        os.environ.update(environment)
        sys.path[:0] = [str(Path.cwd()), *filter(None, environment.get("PYTHONPATH", "").split(os.pathsep))]
        sys.argv = ["pytest", *arguments]
        sys.dont_write_bytecode = bool(environment.get("PYTHONDONTWRITEBYTECODE"))
        status = importlib.import_module("pytest").main(["-W", ALREADY_IMPORTED, *arguments])
        sys.stdout.flush()
    finally:
        os._exit(int(status))


if __name__ == "__main__":
    main()
