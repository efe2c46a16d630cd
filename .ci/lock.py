"""Writes systemd/requirements.lock: every package of the rover's computer, with version and hashes (`make lock`).

The newest versions that pyproject.toml allows are resolved by pip for the oldest Python; the wheels of the other
Pythons and processors are those of the same versions. Only wheels: nothing is compiled on a rover.
"""

from __future__ import annotations

import json
import re
import subprocess
import sys
import tempfile
import tomllib
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
LOCK = ROOT / "systemd/requirements.lock"
PYTHONS = ("3.11", "3.12", "3.13")
PROCESSORS = ("x86_64", "aarch64")
GLIBC = ("manylinux_2_28", "manylinux_2_27", "manylinux_2_17", "manylinux2014")
"""Debian 12 has glibc 2.36, Ubuntu 24.04 has 2.39."""
HEAD = """\
# The packages of the rover's computer, each wheel by its hash: CPython {pythons}; {processors}; glibc 2.28 or newer.
# Written by `make lock` from pyproject.toml; `make install` takes nothing else.
"""


def requirements() -> list[str]:
    """Return what pyproject.toml requires on the rover, and for building."""
    tables = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))
    return [*tables["project"]["dependencies"], *tables["build-system"]["requires"]]


def resolved(wanted: list[str], python: str, processor: str) -> dict[str, tuple[str, str]]:
    """Return name → version and SHA-256 of the wheels that pip chooses for a Python and a processor."""
    with tempfile.TemporaryDirectory() as folder:
        report = Path(folder, "report.json")
        platforms = [f"--platform={glibc}_{processor}" for glibc in GLIBC]
        command = [sys.executable, "-m", "pip", "install", "--quiet", "--dry-run", "--ignore-installed"]
        command += ["--disable-pip-version-check", "--only-binary=:all:", "--implementation=cp"]
        command += [f"--python-version={python}", f"--target={folder}/none", f"--report={report}", *platforms, *wanted]
        subprocess.run(command, check=True)
        found = json.loads(report.read_text(encoding="utf-8"))["install"]
    return {
        normalised(each["metadata"]["name"]): (
            each["metadata"]["version"],
            each["download_info"]["archive_info"]["hashes"]["sha256"],
        )
        for each in found
    }


def normalised(name: str) -> str:
    """Return a package's name as PEP 503 normalises it."""
    return re.sub(r"[-_.]+", "-", name).lower()


def lock() -> str:
    """Return the text of the lock file."""
    versions: dict[str, str] = {}
    hashes: dict[str, set[str]] = {}
    for python in PYTHONS:
        for processor in PROCESSORS:
            pinned = [f"{name}=={version}" for name, version in versions.items()]
            for name, (version, digest) in resolved([*requirements(), *pinned], python, processor).items():
                versions.setdefault(name, version)
                hashes.setdefault(name, set()).add(digest)
    head = HEAD.format(pythons=", ".join(PYTHONS), processors=" and ".join(PROCESSORS))
    lines = [
        f"{name}=={versions[name]}" + "".join(f" \\\n    --hash=sha256:{digest}" for digest in sorted(hashes[name]))
        for name in sorted(versions)
    ]
    return head + "\n".join(lines) + "\n"


if __name__ == "__main__":
    LOCK.write_text(lock(), encoding="utf-8")
