"""What is expected and what was found, in the words of who writes `rover.toml`."""

from __future__ import annotations

import math
from pathlib import Path

import pytest
from pydantic import ValidationError

from regolithd.daemon.config.configuration import Configuration
from regolithd.daemon.config.reader import ConfigurationError, parse_configuration
from regolithd.daemon.config.wording import unit_of


def problems(text: str) -> list[str]:
    """Return every problem of a text, without its place."""
    with pytest.raises(ConfigurationError) as caught:
        parse_configuration(text + "\n", Path("rover.toml"))
    return [str(problem).partition(": ")[2] for problem in caught.value.problems]


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("[wheel]\nradius_m = 75", "wheel.radius_m: expected 0.005 to 0.5 m, found 75."),
        ("[wheel]\nradius_m = nan", "wheel.radius_m: expected 0.005 to 0.5 m, found nan."),
        ("[rover]\nmass_kg = 30000", "rover.mass_kg: expected 0.1 to 1000 kg, found 30000."),
        ("[drivetrain]\nno_load_current_A = 10", "drivetrain.no_load_current_A: expected 0 to 5 A, found 10."),
        (
            "[drivetrain]\nno_load_current_A = [0, 0, 0, 12, 0, 0]",
            "drivetrain.no_load_current_A[3]: expected 0 to 5 A, found 12.",
        ),
        ("[control]\nspeed_limit_m_s = 22", "control.speed_limit_m_s: expected 0.0001 to 2 m/s, found 22."),
        ("[recording]\nlimit_MB = inf", "recording.limit_MB: expected 1 to 100000000 MB, found inf."),
        ("[mqtt]\nport = true", "mqtt.port: expected a number, found true."),
        ('[sync]\nrate_Hz = "10"', 'sync.rate_Hz: expected a number, found "10".'),
        ("[mqtt]\ntls = 1", "mqtt.tls: expected true or false, found 1."),
        ('[mqtt]\ntls = "true"', 'mqtt.tls: expected true or false, found "true".'),
        ("[load_cells]\nzero_N = true", "load_cells.zero_N: expected a number, found true."),
        (
            '[load_cells]\nzero_N = [0, "1", 0, 0, 0, 0]',
            'load_cells.zero_N[1]: expected a number, found "1".',
        ),
        (
            "[load_cells]\nzero_N = [0, 0, 0, 0, 0]",
            "load_cells.zero_N: expected 6 values, or one for all, found [0, 0, 0, 0, 0].",
        ),
        ('[load_cells]\nzero_N = "a"', 'load_cells.zero_N: expected a number, or a list of them, found "a".'),
        ("[nodes]\nmotors = 6", "nodes.motors: expected a list, found 6."),
        ("[nodes]\nmotors = [1, 2, 3, 4, 5]", "nodes.motors: expected 6 values, found [1, 2, 3, 4, 5]."),
        ("[nodes]\nmotors = [1.0, 2, 3, 4, 5, 6]", "nodes.motors[0]: expected a whole number, found 1.0."),
        ("[brakes.31]\ngear_ratio = 1", "brakes.31.wheel: expected a value, found nothing. Add it."),
        ("[brakes.127]\nwheel = 1", 'brakes.127: expected a node-ID from 1 to 126, found "127".'),
        ('[rover]\nname = "a b"', 'rover.name: expected letters, digits, _ and -, 1 to 64, found "a b".'),
        ('[mqtt]\nhost = ""', 'mqtt.host: expected a text that is not empty, found "".'),
        (
            '[mqtt]\nhost = "mqtt://rover.local:1884"',
            'mqtt.host: expected a name or an address alone: host = "rover.local", port = 1884, found "mqtt://',
        ),
        (
            '[mqtt]\nhost = "rover.local:1884"',
            'mqtt.host: expected a name or an address alone: host = "rover.local", port = 1884, found "rover.local:',
        ),
        ('[mqtt]\nhost = "mqtts://x/"', 'mqtt.host: expected a name or an address alone: host = "x", tls = true,'),
        ('[mqtt]\nhost = "a b"', "mqtt.host: expected a name or an address, such as rover.local or 10.0.0.2, found"),
        ("[recording]\ndirectory = 3", "recording.directory: expected a path in quotes, found 3."),
        ('[devices.motors.settings]\n"0x605A" = true', "devices.motors.settings.0x605A: expected a whole number,"),
        ('[devices.motors.objects]\nmotor_current_A = {scale = "1"}', "scale: expected a number, found"),
        ("[slip]\nconstant = 1", "slip.constant: expected above -1 and below 1, found 1."),
    ],
)
def test_a_mistake_is_one_problem_without_jargon(text: str, said: str) -> None:
    """Key, range with its unit, and the value as TOML writes it."""
    (found,) = problems(text)
    assert said in found
    assert "Input" not in found
    assert "valid" not in found.replace("a device", "")


@pytest.mark.parametrize("host", ["rover.local", "10.0.0.2", "::1", "fe80::1%eth0", "localhost"])
def test_names_and_addresses_are_hosts(host: str) -> None:
    """Of IPv6 as well, which has colons without being a port."""
    assert parse_configuration(f'[mqtt]\nhost = "{host}"\n', Path("rover.toml")).mqtt.host == host


@pytest.mark.parametrize(
    ("key", "unit"),
    [
        *(("radius_m", "m"), ("radius_std_m", "m"), ("speed_limit_m_s", "m/s"), ("standstill_rad_s", "rad/s")),
        *(("no_load_current_std_A", "A"), ("viscous_current_A_s_per_rad", "A·s/rad"), ("threshold", "")),
        *(("torque_constant_Nm_per_A", "N·m/A"), ("load_loss_per_Nm", "1/(N·m)"), ("file_minutes", "min")),
    ],
)
def test_the_unit_is_that_of_the_key(key: str, unit: str) -> None:
    """Keys end in their unit."""
    assert unit_of(key) == unit


def _numbers() -> list[tuple[str, str, bool]]:
    """Return table and key of every number or truth value of the model, and whether it is a truth value."""
    found = []
    for table, tables in Configuration():
        if hasattr(tables, "model_fields_set"):
            for key, value in tables:
                first = value[0] if isinstance(value, tuple) and value else value
                if isinstance(first, bool | int | float):
                    found.append((table, key, isinstance(first, bool)))
    return found


@pytest.mark.parametrize(("table", "key", "truth"), _numbers(), ids=str)
def test_no_key_takes_another_kind_of_value(table: str, key: str, truth: bool) -> None:
    """No text and no truth value is a number, and no number a truth value; a number is never infinite."""
    for value in (1, 0.0, "true") if truth else (True, "1", math.inf, -math.inf, math.nan):
        with pytest.raises(ValidationError):
            Configuration.model_validate({table: {key: value}})
