"""The wheel of regolithd, installed beside python-daemon, whose import name is `daemon`, in one virtual environment."""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
import tomllib
import zipfile
from pathlib import Path

import numpy as np
import pytest

ROOT = Path(__file__).resolve().parents[2]
SOURCES = ("pyproject.toml", "README.md", "LICENSE", "src", "daemon", "drivers", "calibration")
NO_INDEX = (
    "no package index here: connect this machine, or put wheels of setuptools and python-daemon into $PIP_FIND_LINKS"
)
ENVIRONMENT = {name: value for name, value in os.environ.items() if name != "PYTHONPATH"}
USE_BOTH = """
import daemon, sys
with daemon.DaemonContext(detach_process=False, stdout=sys.stdout, stderr=sys.stderr):
    # Imported here, as the context closes all descriptors, those of onnxruntime included, which then exits after 30 s.
    import regolithd.daemon.service
    print(daemon.DaemonContext.__module__, regolithd.daemon.service.Service.__module__, flush=True)
"""


def pip(*arguments: str | Path) -> subprocess.CompletedProcess[str]:
    """Run pip of this interpreter."""
    command = [sys.executable, "-m", "pip", "--disable-pip-version-check", "--quiet", *arguments]
    return subprocess.run(command, check=False, capture_output=True, text=True, env=ENVIRONMENT)


@pytest.fixture(scope="module")
def wheel(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The wheel, built from a copy of the checkout, beside wheels of python-daemon and what that needs."""
    folder = tmp_path_factory.mktemp("wheel")
    requires = tomllib.loads((ROOT / "pyproject.toml").read_text())["build-system"]["requires"]
    if pip("download", "--dest", folder, "python-daemon", *requires).returncode:
        pytest.skip(NO_INDEX)
    copy = folder / "copy"
    copy.mkdir()
    for name in SOURCES:
        if (ROOT / name).is_dir():
            shutil.copytree(ROOT / name, copy / name, symlinks=True, ignore=shutil.ignore_patterns("__pycache__"))
        else:
            shutil.copy(ROOT / name, copy)
    built = pip("wheel", "--no-deps", "--no-index", "--find-links", folder, "--wheel-dir", folder, copy)
    assert built.returncode == 0, built.stderr
    (path,) = folder.glob("regolithd-*.whl")
    return path


@pytest.fixture(scope="module")
def python(wheel: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The interpreter of a virtual environment with both; regolithd's dependencies are those of this environment."""
    folder = tmp_path_factory.mktemp("environment")
    subprocess.run([sys.executable, "-m", "venv", "--without-pip", folder], check=True)
    interpreter = folder / "bin" / "python"
    arguments = ("--no-index", "--find-links", wheel.parent, "python-daemon")
    for packages in (arguments, ("--no-deps", wheel)):
        installed = pip("--python", interpreter, "install", *packages)
        assert installed.returncode == 0, installed.stderr
    (site_packages,) = (folder / "lib").glob("python*/site-packages")
    (site_packages / "dependencies.pth").write_text(f"{Path(np.__file__).parents[1]}\n")
    return interpreter


def run(*command: str | Path) -> str:
    """Return what a command prints; it must succeed."""
    done = subprocess.run(command, check=False, capture_output=True, text=True, env=ENVIRONMENT, cwd=Path(sys.prefix))
    assert done.returncode == 0, done.stderr
    return done.stdout


def test_the_wheel_has_one_import_name(wheel: Path) -> None:
    """Every file of the wheel is below `regolithd/`, and the packages and resources of all three rooms are there."""
    names = zipfile.ZipFile(wheel).namelist()
    assert {name.split("/")[0] for name in names} == {"regolithd", wheel.name.split("-py3")[0] + ".dist-info"}
    sources = [
        path.relative_to(ROOT)
        for room in ("daemon", "drivers", "calibration")
        for pattern in ("*.py", "*.eds", "*.onnx", "*.html", "*.css", "*.toml")
        for path in (ROOT / room).rglob(pattern)
    ]
    assert {f"regolithd/{path}" for path in sources} <= set(names)


def test_both_are_imported_and_used_in_one_process(python: Path) -> None:
    """`import daemon` gives python-daemon's `DaemonContext`, and regolithd's service is imported beside it."""
    assert run(python, "-c", USE_BOTH) == "daemon.daemon regolithd.daemon.service\n"


def test_the_installed_command_prints_its_version(python: Path) -> None:
    """`regolithd --version` prints the version of `pyproject.toml`."""
    version = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]["version"]
    assert run(python.parent / "regolithd", "--version") == f"regolithd {version}\n"


def test_the_installed_command_finds_its_resources(python: Path) -> None:
    """The installed package reads its EDS and ONNX files: the virtual rover runs, and the models are loaded."""
    bench = (python.parent / "regolithd", "bench", "--interface", "virtual", "--seconds", "0.2")
    assert "ready: 14 nodes" in run(*bench, "--control", python.parent / "bench.sock")
    load = (
        "from regolithd.daemon.setup import models_or_exit, configuration_or_exit as c; print(models_or_exit(c(None)))"
    )
    assert run(python, "-c", load)
