"""Fixtures and rules for all tests.

Markers: `vcan` – on a kernel with vcan0 and vcan1; `systemd` – where systemd is process 1 (`tests/bench/guests.py`).
Fixtures: `shared_folder`, `mosquitto`, `free_port`.
A skip is a failure in continuous integration (CI=true): only `shared_folder` may be absent there, as no package has it.
"""

from __future__ import annotations

import os
from pathlib import Path
from typing import TYPE_CHECKING

import pytest
from broker import Mosquitto, mosquitto_program, unused_port
from guests import REPORTS, Guests, Reporter
from hypothesis import HealthCheck, settings

if TYPE_CHECKING:
    from collections.abc import Generator, Iterator

ROOT = Path(__file__).resolve().parent.parent
SHARED_IS_ABSENT = "recordings of others are not part of this repository: put the folder `shared` beside the checkout"

# Examples have no time limit of their own: on a busy machine it would be exceeded.
settings.register_profile("regolithd", settings.default, deadline=None, suppress_health_check=[HealthCheck.too_slow])
settings.load_profile("regolithd")


LONGEST = ("tests/system/", "tests/test_house.py", "tests/docs/")
"""Where the longest tests are: they begin first, so that at the end no process waits for another's."""


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """Put the longest tests first; each file's stay together."""
    items.sort(key=lambda item: not item.nodeid.startswith(LONGEST))


def pytest_configure(config: pytest.Config) -> None:
    """Register the nested pytest's plugin inside a guest."""
    if path := os.environ.get(REPORTS):
        config.pluginmanager.register(Reporter(config, Path(path)))


@pytest.hookimpl(trylast=True)
def pytest_sessionstart(session: pytest.Session) -> None:
    """Register the outer pytest's plugin, with a folder among pytest's temporary ones, which it cleans up."""
    if not os.environ.get(REPORTS):
        factory: pytest.TempPathFactory = session.config._tmp_path_factory  # type: ignore[attr-defined]
        session.config.pluginmanager.register(Guests(factory.mktemp("guests")))


@pytest.hookimpl(wrapper=True)
def pytest_runtest_makereport(call: pytest.CallInfo[None]) -> Generator[None, pytest.TestReport, pytest.TestReport]:
    """Report a skip as a failure where CI is set."""
    report = yield
    if os.environ.get("CI") and report.skipped and not hasattr(report, "wasxfail") and call.excinfo is not None:
        reason = str(call.excinfo.value)
        if reason != SHARED_IS_ABSENT:
            report.outcome = "failed"
            report.longrepr = f"skipped, which CI does not allow: {reason}"
    return report


@pytest.fixture(scope="session")
def shared_folder() -> Path:
    """The folder of recordings and reference values that are not part of the repository, beside the checkout."""
    folder = ROOT.parent / "shared"
    if not folder.is_dir():
        pytest.skip(SHARED_IS_ABSENT)
    return folder


@pytest.fixture
def free_port() -> int:
    """An unused TCP port of the loopback interface."""
    return unused_port()


@pytest.fixture
def mosquitto(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Mosquitto]:
    """A running broker without access control; see `Mosquitto` for its methods."""
    if mosquitto_program() is None:
        pytest.skip("no broker here: apt-get install mosquitto")
    broker = Mosquitto(tmp_path_factory.mktemp("mosquitto"))
    broker.start()
    try:
        yield broker
    finally:
        broker.stop()
