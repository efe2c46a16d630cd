"""`regolithd bench` and `regolithd bench-fault` as processes, on an in-process bus."""

from __future__ import annotations

import json
import signal
import subprocess
import sys
from contextlib import contextmanager
from typing import TYPE_CHECKING

import pytest

if TYPE_CHECKING:
    from collections.abc import Iterator
    from pathlib import Path


def command(*arguments: str) -> list[str]:
    """Return a command line of regolithd."""
    return [sys.executable, "-m", "regolithd", *arguments]


@contextmanager
def bench(*options: str, channel: str = "bench") -> Iterator[subprocess.Popen[str]]:
    """Run the virtual rover on an in-process bus; yield its process once it is ready."""
    line = command("bench", "--interface", "virtual", "--channel", channel, *options)
    with subprocess.Popen(line, stdout=subprocess.PIPE, text=True) as process:
        try:
            assert process.stdout is not None
            assert process.stdout.readline().startswith("ready: 14 nodes on virtual")
            yield process
        finally:
            process.kill()


def inject(control: Path, *fault: str) -> subprocess.CompletedProcess[str]:
    """Run `regolithd bench-fault`."""
    line = command("bench-fault", "--control", str(control), *fault)
    return subprocess.run(line, capture_output=True, text=True, check=False, timeout=60)


@pytest.mark.parametrize("end", [signal.SIGTERM, signal.SIGINT])
def test_faults_are_injected_and_counters_printed(tmp_path: Path, end: signal.Signals) -> None:
    """The control socket is this user's alone, and SIGTERM or SIGINT ends the bench cleanly with its counters."""
    control = tmp_path / "bench.sock"
    with bench("--control", str(control)) as process:
        assert control.stat().st_mode & 0o777 == 0o600
        assert inject(control, "reset", "3").stdout == "ok\n"
        refused = inject(control, "off", "99")
        assert refused.returncode == 1
        assert "there is no node 99" in refused.stdout
        assert "silent N" in inject(control, "help").stdout
        process.send_signal(end)
        output, _ = process.communicate(timeout=60)
        assert process.returncode == 0
    counts = json.loads(output.splitlines()[-1])
    assert counts["3"]["boot_up"] >= 1
    assert not control.exists()


def test_a_control_socket_has_one_owner(tmp_path: Path) -> None:
    """A second bench is refused while the first runs, and replaces the socket of a killed one."""
    control = tmp_path / "bench.sock"
    with bench("--control", str(control)):
        line = command("bench", "--interface", "virtual", "--channel", "x", "--control", str(control))
        second = subprocess.run(line, capture_output=True, text=True, check=False, timeout=60)
        assert second.returncode == 1
        assert "listens there already" in second.stderr
    assert control.exists()
    with bench("--control", str(control)):
        assert inject(control, "counts").returncode == 0


def test_without_a_running_bench_the_remedy_is_printed(tmp_path: Path) -> None:
    """`bench-fault` fails and asks whether `regolithd bench` is running."""
    answer = inject(tmp_path / "nothing.sock", "off", "3")
    assert answer.returncode == 1
    assert "Is `regolithd bench` running" in answer.stdout


@pytest.mark.parametrize(
    ("options", "message"),
    [
        (["--soil", "cheese"], "no soil is called 'cheese'"),
        (["--scenario", "no-such-file.toml"], "No such file"),
    ],
)
def test_an_invalid_scenario_is_refused(options: list[str], message: str) -> None:
    """The exit status is 78, and the error names the problem."""
    line = command("bench", "--interface", "virtual", *options)
    ended = subprocess.run(line, capture_output=True, text=True, check=False, timeout=60)
    assert ended.returncode == 78
    assert message in ended.stderr


def test_the_nodes_may_be_those_of_a_rover_toml(tmp_path: Path) -> None:
    """With `--config` the bench simulates the nodes of that file."""
    config = tmp_path / "rover.toml"
    config.write_text("[nodes]\nmotors = [31, 32, 33, 34, 35, 36]\n")
    line = command("bench", "--interface", "virtual", "--config", str(config), "--seconds", "0.2")
    line += ["--control", str(tmp_path / "bench.sock")]
    ended = subprocess.run(line, capture_output=True, text=True, check=False, timeout=60)
    assert ended.stdout.startswith("ready: 12 nodes")
    assert json.loads(ended.stdout.splitlines()[-1])["31"] == {"boot_up": 1}


def test_the_duration_may_be_limited(tmp_path: Path) -> None:
    """With `--seconds` the bench ends by itself, also with options for soil, seed and noise."""
    options = ["--soil", "lete-sand", "--soil", "clayey-soil", "--seed", "5", "--no-noise", "--seconds", "0.2"]
    with bench(*options, "--control", str(tmp_path / "bench.sock")) as process:
        output, _ = process.communicate(timeout=60)
        assert process.returncode == 0
    assert json.loads(output)["11"] == {"boot_up": 1}


def test_some_nodes_may_be_real(tmp_path: Path) -> None:
    """`--nodes` simulates these alone; a node that the configuration does not have is an error with status 78."""
    line = command("bench", "--interface", "virtual", "--channel", "mixed", "--control", str(tmp_path / "mixed.sock"))
    done = subprocess.run(
        [*line, "--nodes", "11-16,21,22", "--seconds", "0.2"], capture_output=True, text=True, check=True, timeout=60
    )
    assert done.stdout.startswith("ready: 8 nodes on virtual mixed")
    for nodes, said in (("11-99", "there is no node 17"), ("eleven", "expected node-IDs and ranges")):
        wrong = subprocess.run([*line, "--nodes", nodes], capture_output=True, text=True, check=False, timeout=60)
        assert wrong.returncode == 78
        assert said in wrong.stderr


def test_a_brake_loads_a_real_motor_alone(tmp_path: Path) -> None:
    """The brake of a virtual motor is left alone, and one that does not answer is named."""
    config = tmp_path / "rover.toml"
    config.write_text("[brakes.31]\nwheel = 1\n[brakes.32]\nwheel = 2\n")
    line = command("bench", "--interface", "virtual", "--channel", "brake", "--control", str(tmp_path / "brake.sock"))
    line += ["--config", str(config), "--nodes", "2,11-16", "--seconds", "2"]
    ended = subprocess.run(line, capture_output=True, text=True, check=True, timeout=60)
    left_alone, absent = ended.stderr.splitlines()
    assert left_alone == "brake: node 32 is left alone: the motor of wheel 2 is virtual"
    assert absent.startswith("brake: node 31, object 0x1000:00: no answer within 1 s")
