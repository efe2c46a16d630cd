"""Kills, flipped bits, babbling nodes and replay on a small scale; `make holds` has the figures."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import pytest
from babble import BUS_SPEED, counted, run_babble
from broker import mosquitto_program
from flipped_bits import flip_all, flip_bits
from replayed_day import replay_day

HERE = Path(__file__).parent


def test_no_kill_loses_or_alters_a_stored_message(tmp_path: Path) -> None:
    """After each of 30 kills at random moments, all that waits is there, in order."""
    # In a process of its own: it forks, which is not safe where another test has loaded JAX and its threads.
    script = (
        "import sys; from pathlib import Path; from kill_points import kill_points; "
        "found = kill_points(Path(sys.argv[1]), 30, 7); print(found.points, found.stored, found.lost, found.altered)"
    )
    done = subprocess.run(
        [sys.executable, "-c", script, tmp_path], cwd=HERE, capture_output=True, text=True, check=False
    )
    assert done.returncode == 0, done.stderr
    points, stored, lost, altered = map(int, done.stdout.split())
    assert points == 30
    assert stored > 300
    assert (lost, altered) == (0, 0)


def test_no_flipped_bit_is_fatal_or_silent(tmp_path: Path) -> None:
    """In each kind of file a flipped bit is noticed, or nothing differs."""
    results = flip_all(tmp_path, 400, 7)
    assert {name: (found.silent, found.fatal) for name, found in results.items()} == dict.fromkeys(results, (0, 0))
    assert all(found.noticed for found in results.values())


def test_other_content_without_a_word_would_be_counted() -> None:
    """What reads other content and says nothing is silent; an exception is fatal."""

    def read(damaged: bytes) -> bool | None:
        if damaged[0]:
            raise ValueError("not caught")
        return False if damaged[1] else None

    found = flip_bits(bytes(3), 300, 7, read)
    assert found.fatal + found.silent + found.harmless == found.bits == 300
    assert min(found.fatal, found.silent, found.harmless) > 50


@pytest.mark.parametrize(("rate_Hz", "emcy_Hz"), [(10.0, BUS_SPEED), (50.0, 0)], ids=["EMCY", "statusword flips"])
def test_babbling_delays_no_snapshot_and_is_one_alarm(tmp_path: Path, rate_Hz: float, emcy_Hz: float) -> None:
    """At least 99 % of the snapshots arrive within a second; one alarm says that events are summarised."""
    if mosquitto_program() is None:
        pytest.skip("no broker here: apt-get install mosquitto")
    found = run_babble(tmp_path, 4.0, rate_Hz, emcy_Hz, flips=not emcy_Hz)
    assert found.syncs > 10
    assert found.in_time >= 0.99 * found.syncs
    assert found.alarms == 1
    assert found.events < found.disturbances / 2
    assert found.stopped_after_s < 5.0


def test_a_snapshot_that_comes_late_is_not_in_time() -> None:
    """Neither one that is marked late nor one that arrives after a second counts."""
    line = '%d000 regolith/kapvik/snapshot {"time": "1970-01-01T00:00:%02d.000000Z", "late": %s}'
    lines = [line % (5_100_000, 5, "false"), line % (6_100_000, 6, "true"), line % (8_100_000, 7, "false")]
    assert counted("\n".join(lines), [5_000_000, 6_000_000, 7_000_000]) == (1, 0, 0)


def test_a_replayed_log_gives_the_bytes_that_were_published(tmp_path: Path) -> None:
    """Two minutes of driving, with the posterior: every `snapshot` message is the same to the last byte."""
    found = replay_day(tmp_path, 120.0, 2.0, 7)
    assert found.snapshots == found.replayed == 240
    assert found.equal
