"""`regolithd check` names the files of `[mqtt]` that are not there."""

from __future__ import annotations

import json
from typing import TYPE_CHECKING

from typer.testing import CliRunner

from regolithd.daemon.cli import app

if TYPE_CHECKING:
    from pathlib import Path

    from click.testing import Result


def check(option: str, config: Path) -> Result:
    """Run `regolithd check`."""
    return CliRunner().invoke(app, ["check", option, "--config", str(config)])


def test_files_of_the_broker_that_are_not_there_are_named_with_their_keys(tmp_path: Path) -> None:
    """`--syntax` names all with status 78; `check` says it of the broker, and checks the rest."""
    config = tmp_path / "rover.toml"
    config.write_text(
        """\
[mqtt]
tls = true
username = "kapvik"
password_file = "password"
ca_file = "ca.pem"
cert_file = "."
key_file = "key.pem"
"""
    )
    run = check("--syntax", config)
    assert run.exit_code == 78
    assert run.stderr.splitlines() == [
        f"{config}:{line}: mqtt.{key}: expected a file, found {tmp_path / name}, which is {what}. "
        "Write it, or correct the path."
        for line, key, name, what in (
            (4, "password_file", "password", "not there"),
            (5, "ca_file", "ca.pem", "not there"),
            (6, "cert_file", ".", "a folder"),
            (7, "key_file", "key.pem", "not there"),
        )
    ] + ["4 problems in the configuration; nothing else was checked."]
    for name in ("password", "ca.pem", "key.pem"):
        (tmp_path / name).touch()
    config.write_text(config.read_text().replace('cert_file = "."', 'cert_file = "key.pem"'))
    assert check("--syntax", config).exit_code == 0
    (tmp_path / "password").unlink()
    findings = json.loads(check("--json", config).stdout)
    (broker,) = (each for each in findings if each["subject"] == "broker")
    assert broker["text"] == f"localhost:1883: {tmp_path}/password is not there"
    assert broker["remedy"] == "Write it, or correct [mqtt] password_file."
