"""Run the tests marked `vcan` or `systemd` in a User Mode Linux guest each, and report them under their own names.

The marked tests are moved to the end of the run. The first of them boots its guest (`with-vcan`; `with-systemd` when
the run begins), in which one nested pytest runs all of them and writes each report as a line of JSON. The outer pytest
reads these lines and reports them as if it had run the tests itself. Inside the guest, or where this kernel has the
links, the tests run directly.
"""

from __future__ import annotations

import json
import os
import shutil
import subprocess
import sys
import time
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any

import pytest

if TYPE_CHECKING:
    from collections.abc import Iterator

HERE = Path(__file__).parent
INSIDE = "BENCH_GUEST"
REPORTS = "BENCH_REPORTS"
NO_REPORT_TIMEOUT_s = 600
"""A guest counts as hung after this time without a report: longer than its boot and the longest test's time limit."""
WITH_WHEELS = '"$0" "$1" && exec env PIP_NO_INDEX=1 PIP_FIND_LINKS="$1" "${@:2}"'
REMEDIES = {
    "vcan": "apt-get install user-mode-linux iproute2 kmod hostname (Debian), or root on a kernel that has vcan",
    "systemd": "apt-get install user-mode-linux iproute2 kmod hostname systemd (Debian; Ubuntu has no user-mode-linux)",
}


def links_are_up() -> bool:
    """Return whether this kernel has both vcan links, and they are up."""
    flags = [Path("/sys/class/net", link, "flags") for link in ("vcan0", "vcan1")]
    return all(flag.exists() and int(flag.read_text(), 16) & 1 for flag in flags)


def guest_of(item: pytest.Item) -> str | None:
    """Return the guest that a test needs; None if it needs none or already runs in it."""
    if os.environ.get(INSIDE):
        return None
    if item.get_closest_marker("systemd"):
        return "systemd"
    if item.get_closest_marker("vcan") and not links_are_up():
        return "vcan"
    return None


def why_not(guest: str) -> str | None:
    """Return why a guest cannot run on this machine, and the remedy; None if it can."""
    if shutil.which("linux.uml") and shutil.which("ip") and Path("/usr/lib/uml/modules").is_dir():
        return None
    if guest == "vcan" and shutil.which("ip"):
        tried = subprocess.run(
            [HERE / "with-vcan", "true"], env={**os.environ, "VCAN_MODE": "native"}, check=False, capture_output=True
        )
        if tried.returncode == 0:
            return None
    return f"no {guest} here: {REMEDIES[guest]}"


@dataclass
class Guest:
    """One nested pytest inside a guest, and its reports so far."""

    name: str
    folder: Path
    node_ids: list[str]
    root: Path
    process: subprocess.Popen[bytes] | None = None
    offset: int = 0
    reports: dict[str, list[dict[str, Any]]] = field(default_factory=dict)
    finished: set[str] = field(default_factory=set)

    def start(self) -> None:
        """Boot the guest with a nested pytest as its command."""
        selection = self.folder / "selection"
        selection.write_text("".join(f"{node_id}\n" for node_id in self.node_ids))
        lines = self.folder / "reports"
        lines.touch()
        pytest_command = [sys.executable, "-m", "pytest", "-p", "no:cacheprovider", "--durations=0", f"@{selection}"]
        command: list[str | Path] = [HERE / f"with-{self.name}", *pytest_command]
        if self.name == "systemd":  # it runs `make install` and has no network
            collect, wheels = self.root / ".ci/wheelhouse", self.root / "build/wheelhouse"
            command = ["bash", "-c", WITH_WHEELS, collect, wheels, *command]
        inside = {INSIDE: self.name, REPORTS: str(lines), "BENCH_SHARED": str(self.folder)}
        with (self.folder / "output").open("wb") as output:
            self.process = subprocess.Popen(
                command,
                cwd=self.root,
                env={**os.environ, **inside},
                stdin=subprocess.DEVNULL,
                stdout=output,
                stderr=subprocess.STDOUT,
            )

    def runs(self) -> bool:
        """Return whether the guest is up."""
        return self.process is not None and self.process.poll() is None

    def wait_for(self, node_id: str) -> bool:
        """Read reports until a test is finished; return false if the guest ended or hung before."""
        last_report = time.monotonic()
        while node_id not in self.finished:
            ended = not self.runs()
            if self.read():
                last_report = time.monotonic()
            elif ended or time.monotonic() - last_report > NO_REPORT_TIMEOUT_s:
                return False
            else:
                time.sleep(0.1)
        return True

    def read(self) -> bool:
        """Read the lines that were written since the last call; return whether there were any."""
        with (self.folder / "reports").open("rb") as file:
            file.seek(self.offset)
            *lines, _ = file.read().split(b"\n")  # the last may be incomplete
        self.offset += sum(len(line) + 1 for line in lines)
        for line in lines:
            message = json.loads(line)
            if "finished" in message:
                self.finished.add(message["finished"])
            else:
                self.reports.setdefault(message["nodeid"], []).append(message)
        return bool(lines)

    def output(self) -> str:
        """Return the end of the guest's output."""
        return (self.folder / "output").read_text(errors="replace")[-8000:]

    def stop(self) -> None:
        """Terminate the guest; kill it after 20 s."""
        if self.process is None:
            return
        self.process.terminate()
        try:
            self.process.wait(20)
        except subprocess.TimeoutExpired:
            self.process.kill()
            self.process.wait()


class Guests:
    """Plugin of the outer pytest: moves the marked tests to the end and replays their guest's reports."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        self.guests: dict[str, Guest] = {}
        self.missing: dict[str, str] = {}

    @pytest.hookimpl(trylast=True)
    def pytest_collection_modifyitems(self, items: list[pytest.Item]) -> None:
        """Sort the tests of each guest together, after all others."""
        items.sort(key=lambda item: {None: 0, "vcan": 1, "systemd": 2}[guest_of(item)])
        for item in items:
            if guest_of(item):
                item.add_marker(pytest.mark.timeout(0), append=False)  # the nested run has the time limit

    @pytest.hookimpl(tryfirst=True)
    def pytest_runtestloop(self, session: pytest.Session) -> None:
        """Boot systemd's guest at once: it installs on a second processor while the other tests run."""
        first = next((item for item in session.items if guest_of(item) == "systemd"), None)
        if first and not session.config.option.collectonly:
            self.guest_for(first)

    def guest_for(self, item: pytest.Item) -> Guest | None:
        """Return the running guest of a test, booted if it is the first to need it; None if there can be none."""
        name = guest_of(item)
        assert name is not None
        if name in self.missing:
            return None
        if name not in self.guests:
            if reason := why_not(name):
                self.missing[name] = reason
                return None
            folder = self.folder / f"{name}-{len(list(self.folder.iterdir()))}"
            folder.mkdir(parents=True)
            others = item.session.items[item.session.items.index(item) :]
            node_ids = [other.nodeid for other in others if guest_of(other) == name]
            self.guests[name] = Guest(name, folder, node_ids, item.config.rootpath)
            self.guests[name].start()
        return self.guests[name]

    @pytest.hookimpl(tryfirst=True)
    def pytest_runtest_protocol(self, item: pytest.Item) -> bool | None:
        """Report a test that runs in a guest."""
        if guest_of(item) is None:
            return None
        item.ihook.pytest_runtest_logstart(nodeid=item.nodeid, location=item.location)
        for report in self.outcome(item):
            item.ihook.pytest_runtest_logreport(report=report)
        item.ihook.pytest_runtest_logfinish(nodeid=item.nodeid, location=item.location)
        return True

    def outcome(self, item: pytest.Item) -> Iterator[pytest.TestReport]:
        """Yield a test's reports: the guest's, or one that says why there are none."""
        guest = self.guest_for(item)
        if guest is None:
            yield absent(item, self.missing[str(guest_of(item))])
            return
        complete = guest.wait_for(item.nodeid)
        for message in guest.reports.get(item.nodeid, []):
            report = item.config.hook.pytest_report_from_serializable(config=item.config, data=message)
            if isinstance(report.longrepr, list):  # place and reason of a skip: JSON has no tuples
                report.longrepr = tuple(report.longrepr)
            yield report
        if not complete:
            how = f"reported nothing for {NO_REPORT_TIMEOUT_s} s" if guest.runs() else "ended"
            guest.stop()
            if guest.finished:  # this test ended it: the remaining tests get a new guest
                del self.guests[guest.name]
            text = f"the {guest.name} guest {how} before this test was done; it printed:\n{guest.output()}"
            yield pytest.TestReport(item.nodeid, item.location, {}, "failed", text, "call")

    def pytest_sessionfinish(self) -> None:
        """Stop all guests."""
        for guest in self.guests.values():
            guest.stop()


def absent(item: pytest.Item, reason: str) -> pytest.TestReport:
    """Report a test that cannot run here: skipped, but failed in continuous integration."""
    if os.environ.get("CI"):
        return pytest.TestReport(
            item.nodeid, item.location, {}, "failed", f"skipped, which CI does not allow: {reason}", "setup"
        )
    where = (str(item.path), item.location[1] or 0, f"Skipped: {reason}")
    return pytest.TestReport(item.nodeid, item.location, {}, "skipped", where, "setup")


class Reporter:
    """Plugin of the nested pytest: writes every report as a line of JSON, flushed to the host."""

    def __init__(self, config: pytest.Config, path: Path) -> None:
        self.config = config
        self.lines = path.open("a")

    def write(self, message: dict[str, Any]) -> None:
        """Append one line; without fsync the guest's kernel would buffer it."""
        self.lines.write(json.dumps(message) + "\n")
        self.lines.flush()
        os.fsync(self.lines.fileno())

    def pytest_runtest_logreport(self, report: pytest.TestReport) -> None:
        """Write the report of one phase."""
        self.write(self.config.hook.pytest_report_to_serializable(config=self.config, report=report))

    def pytest_runtest_logfinish(self, nodeid: str) -> None:
        """Write that a test is finished."""
        self.write({"finished": nodeid})
