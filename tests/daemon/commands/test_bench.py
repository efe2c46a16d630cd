"""`regolithd bench` runs the virtual rover, obeys `regolithd bench-fault`, and says at its end what it did."""

from __future__ import annotations

import json
import os
import signal
import subprocess
import sys
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING

import pytest

if TYPE_CHECKING:
    from collections.abc import Iterator

ROOT = Path(__file__).resolve().parents[3]
ENVIRONMENT = os.environ | {"PYTHONPATH": str(ROOT)}


def command(*words: str) -> list[str]:
    """Return a command line of regolithd."""
    return [sys.executable, "-m", "regolithd", *words]


@contextmanager
def bench(*options: str, channel: str = "bench") -> Iterator[subprocess.Popen[str]]:
    """Run the rover on a bus of its own process, until it is ready."""
    line = command("bench", "--interface", "virtual", "--channel", channel, *options)
    with subprocess.Popen(line, stdout=subprocess.PIPE, text=True, env=ENVIRONMENT) as process:
        try:
            assert process.stdout is not None
            assert process.stdout.readline().startswith("ready: 14 nodes on virtual")
            yield process
        finally:
            process.kill()


def fault(control: Path, *words: str) -> subprocess.CompletedProcess[str]:
    """Command the rover."""
    line = command("bench-fault", "--control", str(control), *words)
    return subprocess.run(line, capture_output=True, text=True, env=ENVIRONMENT, check=False, timeout=60)


@pytest.mark.parametrize("end", [signal.SIGTERM, signal.SIGINT])
def test_it_obeys_and_counts(tmp_path: Path, end: signal.Signals) -> None:
    """Commands come through a socket of this user alone; either signal ends it cleanly, with its counts."""
    control = tmp_path / "bench.sock"
    with bench("--control", str(control)) as process:
        assert control.stat().st_mode & 0o777 == 0o600
        assert fault(control, "reset", "3").stdout == "ok\n"
        refused = fault(control, "off", "99")
        assert refused.returncode == 1
        assert "there is no node 99" in refused.stdout
        assert "silent N" in fault(control, "help").stdout
        process.send_signal(end)
        output, _ = process.communicate(timeout=60)
        assert process.returncode == 0
    counts = json.loads(output.splitlines()[-1])
    assert counts["3"]["boot_up"] >= 1
    assert not control.exists()


def test_two_do_not_share_a_socket(tmp_path: Path) -> None:
    """The second one says so; what a killed one leaves behind is in nobody's way."""
    control = tmp_path / "bench.sock"
    with bench("--control", str(control)):
        line = command("bench", "--interface", "virtual", "--channel", "x", "--control", str(control))
        second = subprocess.run(line, capture_output=True, text=True, env=ENVIRONMENT, check=False, timeout=60)
        assert second.returncode == 1
        assert "listens there already" in second.stderr
    assert control.exists()
    with bench("--control", str(control)):
        assert fault(control, "counts").returncode == 0


def test_nobody_listens(tmp_path: Path) -> None:
    """`bench-fault` says what to do."""
    answer = fault(tmp_path / "nothing.sock", "off", "3")
    assert answer.returncode == 1
    assert "Is `regolithd bench` running" in answer.stdout


@pytest.mark.parametrize(
    ("options", "said"),
    [
        (["--soil", "cheese"], "no soil is called 'cheese'"),
        (["--scenario", "no-such-file.toml"], "No such file"),
    ],
)
def test_a_wrong_scenario_is_told(options: list[str], said: str) -> None:
    """Exit 78, as for any configuration."""
    line = command("bench", "--interface", "virtual", *options)
    ended = subprocess.run(line, capture_output=True, text=True, env=ENVIRONMENT, check=False, timeout=60)
    assert ended.returncode == 78
    assert said in ended.stderr


def test_it_may_have_other_nodes(tmp_path: Path) -> None:
    """Those of a rover.toml."""
    config = tmp_path / "rover.toml"
    config.write_text("[nodes]\nmotors = [31, 32, 33, 34, 35, 36]\n")
    line = command("bench", "--interface", "virtual", "--config", str(config), "--seconds", "0.2")
    line += ["--control", str(tmp_path / "bench.sock")]
    ended = subprocess.run(line, capture_output=True, text=True, env=ENVIRONMENT, check=False, timeout=60)
    assert ended.stdout.startswith("ready: 12 nodes")
    assert json.loads(ended.stdout.splitlines()[-1])["31"] == {"boot_up": 1}


def test_it_ends_by_itself(tmp_path: Path) -> None:
    """With `--seconds`, on the soils that it was given."""
    options = ["--soil", "lete-sand", "--soil", "clayey-soil", "--seed", "5", "--no-noise", "--seconds", "0.2"]
    with bench(*options, "--control", str(tmp_path / "bench.sock")) as process:
        output, _ = process.communicate(timeout=60)
        assert process.returncode == 0
    assert json.loads(output)["11"] == {"boot_up": 1}
