"""The lock file of the rover's packages, and the audit that is made of them."""

from __future__ import annotations

import importlib.util
import json
import re
import subprocess
import sys
import tomllib
import zipfile
from pathlib import Path
from types import ModuleType, SimpleNamespace
from typing import TYPE_CHECKING

import pytest
from cyclonedx.schema import SchemaVersion
from cyclonedx.validation.json import JsonStrictValidator
from packaging.requirements import Requirement

if TYPE_CHECKING:
    from collections.abc import Sequence

ROOT = Path(__file__).resolve().parents[2]
LOCK = (ROOT / "systemd/requirements.lock").read_text()
LOCKED = dict(re.findall(r"(?m)^([a-z0-9-]+)==(\S+)", LOCK))


def script(file: str) -> ModuleType:
    """Import a script of `.ci`, which is no package."""
    specification = importlib.util.spec_from_file_location(name := f"ci_{file}", ROOT / f".ci/{file}.py")
    assert specification is not None
    assert specification.loader is not None
    module = importlib.util.module_from_spec(specification)
    sys.modules[name] = module  # dataclasses look their module up
    specification.loader.exec_module(module)
    return module


audit = script("audit")


def test_the_lock_file_satisfies_what_the_project_requires() -> None:
    """Every dependency of the rover, and of building, is locked in a version that pyproject.toml allows."""
    tables = tomllib.loads((ROOT / "pyproject.toml").read_text())
    for text in (*tables["project"]["dependencies"], *tables["build-system"]["requires"]):
        requirement = Requirement(text)
        assert requirement.specifier.contains(LOCKED[requirement.name.lower()]), f"{text}: make lock"


def test_every_locked_package_has_hashes_and_no_address() -> None:
    """A package is one version and at least one SHA-256, and no index or address is named."""
    entries = [entry for entry in LOCK.replace("\\\n", " ").splitlines() if not entry.startswith("#")]
    assert len(entries) == len(LOCKED) > 20
    for entry in entries:
        assert re.fullmatch(r"[a-z0-9-]+==[\w.+-]+( +--hash=sha256:[0-9a-f]{64})+", entry), entry


def test_the_install_script_takes_nothing_that_has_no_hash() -> None:
    """Both of its calls of pip: the packages by their hashes, and the project without a network."""
    calls = [line for line in (ROOT / "systemd/install").read_text().splitlines() if line.startswith('"${pip[@]}"')]
    assert len(calls) == 2
    assert "--require-hashes" in calls[0]
    assert "--only-binary=:all:" in calls[0]
    assert "--no-index --no-deps --no-build-isolation" in calls[1]


def wheel(folder: Path, name: str, metadata: str) -> Path:
    """Write a wheel that holds only its metadata."""
    path = folder / f"{name}-1.0-py3-none-any.whl"
    with zipfile.ZipFile(path, "w") as archive:
        text = f"Metadata-Version: 2.1\nName: {name}\nVersion: 1.0\n{metadata}"
        archive.writestr(f"{name}-1.0.dist-info/METADATA", text)
    return path


@pytest.mark.parametrize(
    ("metadata", "licence"),
    [
        ("License-Expression: MIT OR Apache-2.0\n", "MIT OR Apache-2.0"),
        ("Classifier: License :: OSI Approved :: BSD License\n", "BSD-3-Clause"),
        ("License: Apache 2.0\nClassifier: License :: OSI Approved\n", "Apache-2.0"),
        ("License: a licence of our own\n", "a licence of our own"),
        ("Summary: none\n", "not stated"),
    ],
)
def test_the_licence_is_what_the_package_states(metadata: str, licence: str, tmp_path: Path) -> None:
    """As SPDX where that is known, otherwise in its own words."""
    assert audit.package(wheel(tmp_path, "Some_Package", metadata)).licence == licence


def test_the_bill_of_materials_is_valid_cyclonedx(tmp_path: Path) -> None:
    """By the schema that comes with CycloneDX's own library; each package has its address (purl) and its hash."""
    for name, metadata in (("one", "License-Expression: MIT AND (0BSD OR Zlib)\n"), ("two", "License: our own\n")):
        wheel(tmp_path, name, metadata)
    found = audit.packages(tmp_path)
    document = audit.bill_of_materials(found, "1.2.3")
    assert JsonStrictValidator(SchemaVersion.V1_5).validate_str(json.dumps(document)) is None
    assert [each["purl"] for each in document["components"]] == ["pkg:pypi/one@1.0", "pkg:pypi/two@1.0"]
    assert document["components"][0]["hashes"] == [{"alg": "SHA-256", "content": found[0].sha256}]


def test_a_wheel_that_is_not_the_locked_one_is_reported(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Another file of the same version, a package that is not locked, and one that is missing."""
    lock = tmp_path / "lock"
    lock.write_text(f"one==1.0 \\\n    --hash=sha256:{'0' * 64}\nthree==1.0 \\\n    --hash=sha256:{'1' * 64}\n")
    monkeypatch.setattr(audit, "LOCK", lock)
    for name in ("one", "two"):
        wheel(tmp_path, name, "License: MIT\n")
    told = audit.differences(audit.packages(tmp_path))
    assert sorted(told) == [
        "one 1.0: another file",
        "three 1.0: only in one of both",
        "two 1.0: another file",
        "two 1.0: only in one of both",
    ]


BUG = {"name": "one", "version": "1.0", "vulns": [{"id": "CVE-2026-0001"}]}
UNKNOWN = {"name": "two", "skip_reason": "not found"}


@pytest.mark.parametrize(
    ("answered", "looked_up", "known", "problem"),
    [
        ([BUG], 1, ("one CVE-2026-0001",), ""),
        ([UNKNOWN], 0, (), "the database knows 0 of 1 packages"),
        (None, 0, (), "no database could be reached"),
    ],
)
def test_what_was_not_looked_up_does_not_count_as_safe(
    answered: Sequence[object] | None,
    looked_up: int,
    known: tuple[str, ...],
    problem: str,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """The number of packages that the database knows is told, and why it is not all."""
    output = "" if answered is None else json.dumps({"dependencies": answered})
    monkeypatch.setattr(subprocess, "run", lambda *_, **__: SimpleNamespace(stdout=output))
    assert audit.vulnerabilities() == audit.Vulnerabilities(looked_up, known, problem)
