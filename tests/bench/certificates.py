"""A certificate authority for tests: issues certificates of brokers and clients by the `openssl` command."""

from __future__ import annotations

import shutil
import subprocess
from dataclasses import dataclass
from typing import TYPE_CHECKING

import pytest

if TYPE_CHECKING:
    from pathlib import Path

_NEW_KEY = ("-newkey", "ec", "-pkeyopt", "ec_paramgen_curve:P-256", "-nodes")
_VALID_DAYS = 2
_EXPIRED_DAYS = -1


@dataclass(frozen=True)
class Certificate:
    """A certificate and its private key, both PEM files."""

    path: Path
    key: Path


class Authority:
    """A certificate authority with its own self-signed certificate, `ca`."""

    def __init__(self, folder: Path, name: str) -> None:
        self._folder = folder
        self._name = name
        self._issued = 0
        key, path = folder / f"{name}.key", folder / f"{name}.pem"
        _openssl("req", "-x509", *_NEW_KEY, "-days", _VALID_DAYS, "-subj", f"/CN={name}", "-keyout", key, "-out", path)
        self.ca = Certificate(path, key)

    def issue(self, name: str, *, subject_alternative_name: str = "", expired: bool = False) -> Certificate:
        """Issue a certificate with `name` as its CN. An expired one ended a day ago."""
        self._issued += 1
        stem = self._folder / f"{self._name}-{self._issued}"
        path, key, request = (stem.with_suffix(suffix) for suffix in (".pem", ".key", ".csr"))
        _openssl("req", *_NEW_KEY, "-subj", f"/CN={name}", "-keyout", key, "-out", request)
        extensions = stem.with_suffix(".ext")
        extensions.write_text(f"subjectAltName={subject_alternative_name}\n" if subject_alternative_name else "")
        days = _EXPIRED_DAYS if expired else _VALID_DAYS
        signer = ("-CA", self.ca.path, "-CAkey", self.ca.key, "-CAcreateserial", "-extfile", extensions)
        _openssl("x509", "-req", "-in", request, *signer, "-days", days, "-out", path)
        return Certificate(path, key)

    @staticmethod
    def encrypt(key: Path, encrypted: Path, passphrase: str) -> None:
        """Write a private key encrypted by a passphrase."""
        _openssl("pkey", "-in", key, "-aes256", "-passout", f"pass:{passphrase}", "-out", encrypted)


def new_authority(folder: Path, name: str) -> Authority:
    """Return a new authority; skip the test where there is no `openssl`."""
    if shutil.which("openssl") is None:
        pytest.skip("no openssl here: apt-get install openssl")
    return Authority(folder, name)


def _openssl(*arguments: str | int | Path) -> None:
    subprocess.run(["openssl", *map(str, arguments)], check=True, capture_output=True)
