"""Compile a C source into an FMU: a zip archive of the model description and a shared library (FMI 2.0, 2.3)."""

from __future__ import annotations

import os
import subprocess
import sys
import tempfile
import zipfile
from pathlib import Path

SOURCES = Path(__file__).parent.parent / "first_simulations"
PLATFORM = {"linux": ("linux64", ".so"), "darwin": ("darwin64", ".dylib")}
STAMP = (1980, 1, 1, 0, 0, 0)
"""Time of every file in the archive, so that the same source gives the same archive."""


def build_fmu(name: str, path: Path) -> Path:
    """Compile `first_simulations/NAME.c` and write the FMU with NAME.xml to `path`; the C compiler is $CC, or cc.

    Raises
    ------
    OSError, subprocess.CalledProcessError
        Where there is no C compiler, or it fails.
    """
    return compile_fmu(SOURCES / f"{name}.c", (SOURCES / f"{name}.xml").read_bytes(), path)


def compile_fmu(source: Path, description: bytes, path: Path) -> Path:
    """Compile a C file and write the FMU with a model description to `path`; the C compiler is $CC, or cc.

    Raises
    ------
    OSError, subprocess.CalledProcessError
        Where there is no C compiler, or it fails.
    """
    folder, suffix = PLATFORM[sys.platform]
    with tempfile.TemporaryDirectory() as scratch:
        library = Path(scratch) / f"{source.stem}{suffix}"
        command = [
            os.environ.get("CC", "cc"),
            "-shared",
            "-fPIC",
            "-O2",
            str(source),
            "-o",
            str(library),
        ]
        subprocess.run([*command, "-lm"], check=True, capture_output=True)  # noqa: S603  # our own source
        with zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED) as archive:
            _add(archive, "modelDescription.xml", description)
            _add(archive, f"binaries/{folder}/{library.name}", library.read_bytes())
    return path


def _add(archive: zipfile.ZipFile, name: str, content: bytes) -> None:
    archive.writestr(zipfile.ZipInfo(name, STAMP), content, zipfile.ZIP_DEFLATED)
