"""Licences, bill of materials and known vulnerabilities of the packages in a wheelhouse: `make audit`.

    python .ci/audit.py build/wheelhouse

Writes build/sbom.cdx.json (CycloneDX 1.5) and build/figures/audit.json, and prints what it found. Exit status 1: a
vulnerability is known, a licence is not stated, or the wheels are not those of the lock file.
"""

from __future__ import annotations

import email
import hashlib
import json
import re
import subprocess
import sys
import tomllib
import zipfile
from collections import Counter
from dataclasses import dataclass
from datetime import UTC, datetime
from pathlib import Path
from typing import TYPE_CHECKING
from uuid import uuid4

if TYPE_CHECKING:
    from collections.abc import Iterable, Sequence
    from email.message import Message

ROOT = Path(__file__).resolve().parents[1]
LOCK = ROOT / "systemd/requirements.lock"
UNKNOWN = "not stated"
SPDX = {
    "MIT License": "MIT",
    "MIT": "MIT",
    "Apache Software License": "Apache-2.0",
    "Apache 2.0": "Apache-2.0",
    "BSD License": "BSD-3-Clause",
    "BSD": "BSD-3-Clause",
    "3-Clause BSD License": "BSD-3-Clause",
    "ISC License (ISCL)": "ISC",
    "GNU Lesser General Public License v3 (LGPLv3)": "LGPL-3.0-only",
    "LGPL v3": "LGPL-3.0-only",
    "LGPL-3.0": "LGPL-3.0-only",
    "Python Software Foundation License": "PSF-2.0",
}
"""What older packages state, as an SPDX identifier."""


@dataclass(frozen=True, slots=True)
class Package:
    """A wheel: name, version, licence (SPDX where it is known), summary, SHA-256."""

    name: str
    version: str
    licence: str
    summary: str
    sha256: str


@dataclass(frozen=True, slots=True)
class Vulnerabilities:
    """How many packages a database knows, and the identifiers of what it knows about them."""

    looked_up: int
    known: tuple[str, ...]
    problem: str = ""


def packages(wheelhouse: Path) -> list[Package]:
    """Return the packages of the wheels in a folder, by name."""
    return sorted((package(path) for path in wheelhouse.glob("*.whl")), key=lambda each: each.name)


def package(wheel: Path) -> Package:
    """Return what a wheel says of itself."""
    with zipfile.ZipFile(wheel) as archive:
        (name,) = (each for each in archive.namelist() if re.fullmatch(r"[^/]+\.dist-info/METADATA", each))
        stated = email.message_from_bytes(archive.read(name))
    digest = hashlib.sha256(wheel.read_bytes()).hexdigest()
    normalised = re.sub(r"[-_.]+", "-", stated["Name"]).lower()
    return Package(normalised, stated["Version"], licence(stated), stated["Summary"] or "", digest)


def licence(stated: Message) -> str:
    """Return the licence of a package: its SPDX expression, its classifier, or its licence field."""
    if expression := stated["License-Expression"]:
        return expression
    classifiers = [each.rsplit(" :: ", 1)[1] for each in stated.get_all("Classifier", []) if "License ::" in each]
    field = (stated["License"] or "").strip().splitlines()
    for text in (*classifiers, *field[:1]):
        if text in SPDX:
            return SPDX[text]
    return (*(each for each in classifiers if each != "OSI Approved"), *field[:1], UNKNOWN)[0]


def bill_of_materials(found: Iterable[Package], version: str) -> dict[str, object]:
    """Return the CycloneDX 1.5 document."""
    return {
        "bomFormat": "CycloneDX",
        "specVersion": "1.5",
        "serialNumber": f"urn:uuid:{uuid4()}",
        "version": 1,
        "metadata": {
            "timestamp": datetime.now(UTC).isoformat(timespec="seconds"),
            "component": {
                "type": "application",
                "bom-ref": "regolithd",
                "name": "regolithd",
                "version": version,
                "licenses": [{"expression": "Apache-2.0"}],
            },
        },
        "components": [_component(each) for each in found],
    }


def _component(each: Package) -> dict[str, object]:
    spdx = re.fullmatch(r"[A-Za-z0-9.+-]+( (AND|OR|WITH) \(?[A-Za-z0-9.+-]+\)?)*", each.licence)
    stated = {"expression": each.licence} if spdx else {"license": {"name": each.licence}}
    return {
        "type": "library",
        "bom-ref": f"pkg:pypi/{each.name}@{each.version}",
        "name": each.name,
        "version": each.version,
        "description": each.summary,
        "purl": f"pkg:pypi/{each.name}@{each.version}",
        "hashes": [{"alg": "SHA-256", "content": each.sha256}],
        "licenses": [stated],
    }


def vulnerabilities() -> Vulnerabilities:
    """Ask pip-audit; say why where it reaches no database, or one that does not know the packages."""
    command = [sys.executable, "-m", "pip_audit", "--requirement", str(LOCK), "--disable-pip", "--format", "json"]
    try:
        done = subprocess.run(command, check=False, capture_output=True, text=True, timeout=300)
        answered = json.loads(done.stdout)["dependencies"]
    except (subprocess.TimeoutExpired, json.JSONDecodeError, KeyError):
        return Vulnerabilities(0, (), "no database could be reached")
    known = tuple(f"{each['name']} {bug['id']}" for each in answered for bug in each.get("vulns", ()))
    looked_up = sum("skip_reason" not in each for each in answered)
    problem = "" if looked_up == len(answered) else f"the database knows {looked_up} of {len(answered)} packages"
    return Vulnerabilities(looked_up, known, problem)


def differences(found: Sequence[Package]) -> list[str]:
    """Return how the wheels differ from the lock file: packages, versions, hashes."""
    text = LOCK.read_text(encoding="utf-8")
    locked = set(re.findall(r"(?m)^([a-z0-9-]+)==(\S+)", text))
    there = {(each.name, each.version) for each in found}
    hashes = set(re.findall(r"sha256:([0-9a-f]{64})", text))
    wrong = [f"{each.name} {each.version}: another file" for each in found if each.sha256 not in hashes]
    return [*(f"{name} {version}: only in one of both" for name, version in sorted(locked ^ there)), *wrong]


def main(wheelhouse: Path) -> int:
    """Write both files, print the packages, and return the exit status."""
    found, bugs = packages(wheelhouse), vulnerabilities()
    wrong = [*differences(found), *(f"{each.name}: licence {UNKNOWN}" for each in found if each.licence == UNKNOWN)]
    version = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]["version"]
    figures: dict[str, object] = {
        "command": "make audit",
        "measured": f"{datetime.now(UTC):%Y-%m-%d}",
        "packages on the rover": len(found),
        "with a hash in the lock file": len(found) - sum("another file" in each for each in wrong),
        "without a stated licence": sum(each.licence == UNKNOWN for each in found),
        "packages looked up for vulnerabilities": bugs.looked_up,
        "known vulnerabilities": len(bugs.known) if bugs.looked_up else None,
        "vulnerabilities not looked up because": bugs.problem or "–",
    }
    figures |= {f"{name} / packages": count for name, count in sorted(Counter(each.licence for each in found).items())}
    for path, content in (
        ("build/sbom.cdx.json", bill_of_materials(found, version)),
        ("build/figures/audit.json", figures),
    ):
        (ROOT / path).parent.mkdir(parents=True, exist_ok=True)
        (ROOT / path).write_text(json.dumps(content, indent=2, ensure_ascii=False) + "\n", encoding="utf-8")
    for each in found:
        sys.stdout.write(f"{each.name:<24}{each.version:<14}{each.licence}\n")
    sys.stdout.write(f"vulnerabilities: {', '.join(bugs.known) or bugs.problem or 'none known'}\n")
    sys.stdout.writelines(f"wrong: {each}\n" for each in wrong)
    return int(bool(wrong or bugs.known))


if __name__ == "__main__":
    sys.exit(main(Path(sys.argv[1])))
