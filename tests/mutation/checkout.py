"""A copy of the checkout to mutate, and pytest in it with limits of CPU time."""

from __future__ import annotations

import contextlib
import functools
import json
import os
import re
import select
import shutil
import signal
import subprocess
import sys
import venv
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from collections.abc import Iterable, Iterator, Mapping

CLOCK_TIMEOUT_S = 7200.0
"""Time on the clock after which a run is ended without a result: far beyond every limit of CPU time."""
ENDED = -1000
"""Status of a run that was ended after that time."""
NO_TEST, USAGE_ERROR = 5, 4
"""pytest's exit statuses where every test is left out, and where a test is not found."""


@dataclass(frozen=True)
class Run:
    """What became of a run of pytest.

    Attributes
    ----------
    status: pytest's exit status; minus the signal that ended it
    output: what it printed
    ended: whether it was ended after `CLOCK_TIMEOUT_S`
    """

    status: int
    output: str
    ended: bool = False

    @property
    def passed(self) -> bool:
        """Whether every test passed."""
        return self.status in {0, NO_TEST}

    @property
    def cpu_exceeded(self) -> bool:
        """Whether the process used more CPU time than it had."""
        return self.status in {-signal.SIGXCPU, -signal.SIGKILL} and not self.ended

    @property
    def timed_out(self) -> bool:
        """Whether a test waited for too long, which a busy machine may have caused."""
        return self.ended or "Timeout (>" in self.output

    @property
    def failed(self) -> tuple[str, ...]:
        """Names of the tests that pytest's summary lists as failed."""
        return tuple(re.findall(r"^(?:FAILED|ERROR) (.+?::.+?)(?: - |$)", self.output, flags=re.MULTILINE))


@dataclass(frozen=True)
class Checkout:
    """A copy of the tracked files, with an environment that imports the copy."""

    root: Path

    @property
    def python(self) -> Path:
        """The environment's interpreter."""
        return self.root / ".venv" / "bin" / "python"

    @property
    def _original(self) -> Path:
        """Where the text of a file is while a mutant is in its place."""
        return self.root / ".original.json"

    @contextlib.contextmanager
    def changed(self, file: str, text: str) -> Iterator[None]:
        """Give a file another text until the context ends."""
        path = self.root / file
        times = path.stat()
        self._original.write_text(json.dumps([file, path.read_text(), times.st_mtime_ns]))
        path.write_text(text)
        try:
            yield
        finally:
            self.restore()

    def restore(self) -> None:
        """Put back what was changed, also by a run that was killed."""
        if self._original.exists():
            file, text, changed_ns = json.loads(self._original.read_text())
            (self.root / file).write_text(text)
            os.utime(self.root / file, ns=(changed_ns, changed_ns))  # so that its compiled form is valid again
            self._original.unlink()

    def pytest(self, arguments: Iterable[str], cpu_s: int, environment: Mapping[str, str] | None = None) -> Run:
        """Run pytest; `cpu_s` limits the CPU time of each of its processes."""
        output = self.root / ".pytest-output.txt"
        output.unlink(missing_ok=True)
        order = {
            "arguments": ["-p", "no:cacheprovider", "-q", "-m", "not vcan and not systemd", *arguments],
            "cpu_s": cpu_s,
            "environment": dict(environment or {}),
            "output": str(output),
        }
        status = _status(_server(self.python, self.root), json.dumps(order))
        return Run(status, output.read_text(errors="replace") if output.exists() else "", ended=status == ENDED)


@functools.cache
def _server(python: Path, root: Path) -> subprocess.Popen[str]:
    """Start the process whose forks run pytest; it ends with this one, which closes its input."""
    return subprocess.Popen(
        [str(python), str(Path(__file__).with_name("fork_server.py"))],
        cwd=root,
        env=os.environ | {"OPENBLAS_NUM_THREADS": "1", "CI": "", "COLUMNS": "400"},
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        text=True,
    )


def _status(server: subprocess.Popen[str], order: str) -> int:
    """Return the exit status of a run, or minus the signal that ended it."""
    assert server.stdin
    assert server.stdout
    server.stdin.write(order + "\n")
    server.stdin.flush()
    pid = int(json.loads(server.stdout.readline())["pid"])
    ended, _, _ = select.select([server.stdout], [], [], CLOCK_TIMEOUT_S)
    with contextlib.suppress(ProcessLookupError):  # also what the run has left behind
        os.killpg(pid, signal.SIGKILL)
    status = int(json.loads(server.stdout.readline())["status"])
    return status if ended else ENDED


def renew_tests(source: Path, copy: Checkout) -> list[str]:
    """Copy what is new or changed among the tests, and nothing else; return the names of these files."""
    listed = subprocess.run(["git", "ls-files", "tests"], cwd=source, check=True, capture_output=True, text=True)
    changed = [name for name in listed.stdout.split() if not _same(source / name, copy.root / name)]
    for name in changed:
        (copy.root / name).parent.mkdir(parents=True, exist_ok=True)
        shutil.copy2(source / name, copy.root / name, follow_symlinks=False)
    return changed


def _same(one: Path, other: Path) -> bool:
    return other.is_file() and one.read_bytes() == other.read_bytes()


def copy_of(source: Path, folder: Path) -> Checkout:
    """Copy the tracked files of a checkout, and make an environment that imports the copy; nothing, if it is there."""
    made = Checkout(folder)
    ready = folder / ".venv" / "copy.ready"
    if ready.exists():
        made.restore()
        return made
    listed = subprocess.run(["git", "ls-files"], cwd=source, check=True, capture_output=True, text=True)
    for name in listed.stdout.split():
        (folder / name).parent.mkdir(parents=True, exist_ok=True)
        shutil.copy2(source / name, folder / name, follow_symlinks=False)
    venv.create(folder / ".venv", with_pip=False)
    (packages,) = (folder / ".venv" / "lib").glob("python*/site-packages")
    paths = [str(folder / "src"), *(path for path in sys.path if path.endswith("site-packages"))]
    (packages / "copy.pth").write_text("\n".join(paths) + "\n")
    ready.touch()
    return made
