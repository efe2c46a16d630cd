"""The limits of each key of `rover.toml`, and the texts that say how to correct a mistake."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest
from pydantic import ValidationError

from regolithd.daemon.config.configuration import MASTER_NODE, Configuration
from regolithd.daemon.config.reader import (
    EXIT_STATUS,
    ConfigurationError,
    line_of,
    parse_configuration,
    read_configuration,
)

# Table, key, values that are just allowed, values that are just refused.
LIMITS: list[tuple[str, str, tuple[Any, ...], tuple[Any, ...]]] = [
    ("rover", "name", ("a", "A_z-9" * 12), ("", "a b", "a/b", "x" * 65)),
    ("rover", "mass_kg", (0.1, 1000), (0.09, -1.0, 1001, 30_000)),
    ("rover", "wheelbase_m", (0.05, 5), (0.049, 5.1, 650)),
    ("rover", "track_m", (0.05, 5), (0.049, 5.1, 550)),
    ("wheel", "radius_m", (0.005, 0.5), (0.0049, 0.51, 75, 0.00075)),
    ("wheel", "radius_std_m", (0, 0.1), (-0.001, 0.11)),
    ("wheel", "width_m", (0.005, 0.5), (0.0049, 0.51, 70)),
    ("drivetrain", "torque_constant_Nm_per_A", (0.0005, 2), (0.0004, 2.1, 23.4)),
    ("drivetrain", "planetary_ratio", (0.01, 10_000), (0.009, 10_001)),
    ("drivetrain", "harmonic_ratio", (0.01, 10_000), (0.009, 10_001)),
    ("drivetrain", "harmonic_efficiency", (0.001, 1), (0, 1.01, 70)),
    ("drivetrain", "gain_relative_std", (0, 10), (-0.1, 10.1)),
    ("drivetrain", "no_load_current_A", (0, 5, [0, 1, 2, 3, 4, 5]), (-0.01, 5.1, [10, 11, 12, 13, 14, 15])),
    ("drivetrain", "no_load_current_std_A", (0, 5), (-0.01, 5.1)),
    ("drivetrain", "viscous_current_A_s_per_rad", (0, 0.1), (-0.01, 0.11)),
    ("drivetrain", "gain_factor", (0.01, 100), (0.009, 101)),
    ("drivetrain", "gain_factor_std", (0, 10), (-0.1, 10.1)),
    ("drivetrain", "load_loss_per_Nm", (-10, 10), (-10.1, 10.1)),
    ("drivetrain", "load_loss_std_per_Nm", (0, 10), (-0.1, 10.1)),
    ("load_cells", "zero_N", (-10_000, 10_000), (-10_001, 10_001)),
    ("load_cells", "zero_std_N", (0, 10_000), (-0.1, 10_001)),
    ("load_cells", "span", (0.01, 100), (0.009, 101)),
    ("load_cells", "span_std", (0, 10), (-0.1, 10.1)),
    ("bus", "channel", ("c",), ("",)),
    ("bus", "bitrate", (10_000, 20_000, 50_000, 125_000, 250_000, 500_000, 800_000, 1_000_000), (0, 9_999, 100_000)),
    ("sync", "rate_Hz", (1, 200), (0.99, 200.1)),
    ("nodes", "inclinometer", (1, 126), (0, 127)),
    ("nodes", "motors", ([1, 2, 3, 4, 5, 6],), ([1, 2, 3, 4, 5], [1, 2, 3, 4, 5, 6, 7])),
    ("nodes", "mirrored_wheels", ([], [1, 6]), ([0], [7])),
    ("nodes", "heartbeat_ms", (20, 10_000), (19, 10_001)),
    ("nodes", "heartbeat_timeout_ms", (50, 30_000), (49, 30_001)),
    ("slip", "constant", (-0.99, 0.99), (-1, 1)),
    ("slip", "standstill_rad_s", (0.0001, 5), (0, 5.1, 50)),
    ("smoothing", "window_s", (0, 60), (-0.1, 60.1)),
    ("smoothing", "threshold", (0, 10), (-0.1, 10.1)),
    ("smoothing", "time_constant_s", (0, 60), (-0.1, 60.1)),
    ("posterior", "window_s", (0.5, 20), (0.49, 20.1)),
    ("posterior", "soil", ("lete-sand", "sandy-loam", "clayey-soil", "medium-soil"), ("sand",)),
    ("change", "threshold", (3, 100), (2.9, 100.1)),
    ("recording", "limit_MB", (1, 1e8), (0.9, 1.1e8)),
    ("recording", "file_minutes", (0.1, 1440), (0.09, 1441)),
    ("mqtt", "host", ("h",), ("",)),
    ("mqtt", "port", (1, 65_535), (0, 65_536)),
    ("mqtt", "prefix", ("a", "a/b"), ("", "a/", "a#", "+/a", "a b")),
    ("mqtt", "keepalive_s", (2, 3600), (1, 3601)),
    ("mqtt", "spool_limit_MB", (0.01, 1e6), (0, 1.1e6)),
    ("control", "speed_limit_m_s", (0.0001, 2), (0, 2.1, 22)),
    ("control", "distance_limit_m", (0.001, 100_000), (0, 100_001)),
]


@pytest.mark.parametrize(("table", "key", "allowed", "refused"), LIMITS, ids=[f"{row[0]}.{row[1]}" for row in LIMITS])
def test_a_key_has_its_limits(table: str, key: str, allowed: tuple[Any, ...], refused: tuple[Any, ...]) -> None:
    """The outermost allowed values are accepted, the next ones are not."""
    for value in allowed:
        Configuration.model_validate({table: {key: value}})
    for value in refused:
        with pytest.raises(ValidationError):
            Configuration.model_validate({table: {key: value}})


def test_the_default_nodes() -> None:
    """Motors 1 to 6, load cells 11 to 16 on wheels 0 to 5; body sensors only where given; the master is 127."""
    found = [(node.node_id, node.kind, node.wheel, node.required) for node in Configuration().described()]
    assert found == [(1 + k, "motor", k, True) for k in range(6)] + [(11 + k, "load-cell", k, True) for k in range(6)]
    nodes = Configuration.model_validate({"nodes": {"inclinometer": 30, "ground_speed": 31}}).nodes
    body = [
        (node.node_id, node.kind, node.wheel, node.required) for node in Configuration(nodes=nodes).described()[12:]
    ]
    assert sorted(body) == [(30, "inclinometer", None, False), (31, "ground-speed", None, False)]
    assert [key for key, _ in nodes.by_key()][5:7] == ["motors[5]", "load_cells[0]"]
    assert MASTER_NODE == 127


def test_the_body_is_that_of_the_rover_table() -> None:
    """Mass and dimensions go to the simulation unchanged."""
    body = Configuration.model_validate({"rover": {"mass_kg": 11.0, "wheelbase_m": 0.5, "track_m": 0.4}}).rover.body
    assert (body.mass_kg, body.wheelbase_m, body.track_m) == (11.0, 0.5, 0.4)


def problems(text: str) -> list[str]:
    """Return every problem of a configuration, as a line of text."""
    with pytest.raises(ConfigurationError) as caught:
        parse_configuration(text, Path("rover.toml"))
    assert str(caught.value).splitlines() == [str(problem) for problem in caught.value.problems]
    return [str(problem) for problem in caught.value.problems]


@pytest.mark.parametrize(
    ("text", "problem"),
    [
        (
            "[nodes]\nheartbeat_ms = 300\nheartbeat_timeout_ms = 599\n",
            (
                "rover.toml:3: nodes.heartbeat_timeout_ms: expected at least twice heartbeat_ms (600), found 599. "
                "One late heartbeat would count as a lost node: raise it."
            ),
        ),
        (
            '[mqtt]\npassword_file = "x"\n',
            (
                "rover.toml:1: mqtt.username: expected a name beside password_file, found nothing. "
                "Set it, or remove password_file."
            ),
        ),
        (
            "[nodes]\ninclinometer = 11\n",
            (
                "rover.toml:2: nodes.inclinometer: expected a node id of its own, found 11, which is load_cells[0]'s. "
                "Give every node its own id."
            ),
        ),
        (
            "[mqtt]\nport = 0\n",
            ("rover.toml:2: mqtt.port: expected 1 to 65535, found 0. Change it, or leave it out for 1883."),
        ),
        (
            '[estimator]\nmodel = 3\n[mqtt]\n\n"username" = 4\n',
            "rover.toml:5: mqtt.username: expected a text in quotes, found 4. Change it, or leave it out for none.",
        ),
        ("wheel = 3\n", "rover.toml:1: wheel: expected a table, found 3. Change it."),
        (
            "[sync]\nzebra = 1\n",
            "rover.toml:2: sync.zebra: expected a key that [sync] has (rate_Hz), found zebra. Remove it.",
        ),
    ],
)
def test_a_mistake_is_one_line_with_place_and_remedy(text: str, problem: str) -> None:
    """File, line, key, the expected and the found value, and what to do."""
    assert problem in problems(text)


def test_a_timeout_of_twice_the_heartbeat_is_enough() -> None:
    """Tables that are valid together are no problem, and a user name without a password file is none either."""
    text = '[nodes]\nheartbeat_ms = 300\nheartbeat_timeout_ms = 600\n[mqtt]\nusername = "x"\n'
    assert parse_configuration(text, Path("rover.toml")).nodes.heartbeat_timeout_ms == 600


@pytest.mark.parametrize(
    ("data", "said"),
    [
        (b"\xff\xfe[\0", "{path}: encoding: expected UTF-8, found UTF-16. Save the file as UTF-8."),
        (
            '[rover]\n# Räder\nname = "x"\n'.encode("latin-1"),
            "{path}:2: encoding: expected UTF-8, found byte 0xE4, which is ä in Latin-1. Save the file as UTF-8.",
        ),
    ],
)
def test_a_file_in_another_encoding_is_one_problem(tmp_path: Path, data: bytes, said: str) -> None:
    """The encoding, or the line and the character, is named, and the exit status is EX_CONFIG."""
    path = tmp_path / "rover.toml"
    path.write_bytes(data)
    with pytest.raises(ConfigurationError) as caught:
        read_configuration(path)
    assert [str(problem) for problem in caught.value.problems] == [said.format(path=path)]
    assert EXIT_STATUS == 78


def test_a_byte_order_mark_is_no_mistake(tmp_path: Path) -> None:
    """Windows' editors write one; lines are counted all the same."""
    path = tmp_path / "rover.toml"
    path.write_text('[rover]\nname = "mine"\n', encoding="utf-8-sig")
    assert read_configuration(path).rover.name == "mine"


@pytest.mark.parametrize(
    ("location", "line"),
    [
        (["sync"], 1),
        (["sync", "rate_Hz"], 3),
        (["sync", "absent"], 1),
        (["nodes", "motors[3]"], 6),
        (["nodes", "rate_Hz"], 4),
        (["absent"], None),
        (["absent", "key"], None),
        ([], None),
    ],
)
def test_the_line_of_a_key_is_its_own_or_its_table_s(location: list[str], line: int | None) -> None:
    """Lines count from 1; a key of the same name in another table is not taken."""
    text = '[sync]\n# rate_Hz = 1\nrate_Hz = 2\n[ nodes ]\n# here\n"motors" = [1]\n'
    assert line_of(text, location) == line
