"""Reads the files that `[mqtt]` names: password, certificates, private key. An error names the file and the remedy."""

from __future__ import annotations

import ssl
from typing import TYPE_CHECKING, NoReturn

if TYPE_CHECKING:
    from pathlib import Path

    from regolithd.daemon.config.broker import BrokerSettings


def password_of(settings: BrokerSettings) -> str | None:
    """Return the content of `[mqtt] password_file`, or None where there is none.

    Raises
    ------
    OSError
        It cannot be read, or is not UTF-8.
    """
    if settings.password_file is None:
        return None
    _check_readable(settings.password_file, "password_file")
    try:
        return settings.password_file.read_text(encoding="utf-8").strip()
    except UnicodeDecodeError:
        raise OSError(f"{settings.password_file} is not UTF-8. Write [mqtt] password_file again as text") from None


def tls_context(settings: BrokerSettings) -> ssl.SSLContext | None:
    """Return the TLS context of `[mqtt]`, or None where TLS is off.

    Without `ca_file` it trusts the system's authorities. With `cert_file` it proves the client's identity.

    Raises
    ------
    OSError
        A file cannot be read, or does not hold what it should.
    """
    if not settings.tls:
        return None
    for key in ("ca_file", "cert_file", "key_file"):
        if (file := getattr(settings, key)) is not None:
            _check_readable(file, key)  # ssl's own error does not name the file
    try:
        context = ssl.create_default_context(cafile=settings.ca_file)
    except ssl.SSLError:
        raise OSError(
            f"{settings.ca_file} holds no certificate. Correct [mqtt] ca_file: PEM, of the authority"
        ) from None
    if settings.cert_file is not None:
        assert settings.key_file is not None  # noqa: S101  # the reader accepts both or neither
        _load_client_certificate(context, settings.cert_file, settings.key_file)
    return context


def _check_readable(file: Path, key: str) -> None:
    """Raise an OSError that names the key and the remedy where a file cannot be read."""
    try:
        file.open("rb").close()
    except FileNotFoundError:
        raise OSError(f"{file} is not there. Write it, or correct [mqtt] {key}") from None
    except IsADirectoryError:
        raise OSError(f"{file} is a folder. Name a file in [mqtt] {key}") from None
    except PermissionError:
        remedy = f"Let the group of the daemon's user read [mqtt] {key}: chgrp, and mode 640"
        raise OSError(f"{file} may not be read by this user. {remedy}") from None
    except OSError as error:
        raise OSError(f"{file}: {error.strerror}. Correct [mqtt] {key}") from None


def _load_client_certificate(context: ssl.SSLContext, certificate: Path, key: Path) -> None:
    def no_passphrase() -> NoReturn:  # by default OpenSSL asks on the terminal
        raise OSError(f"{key} is encrypted. Store [mqtt] key_file without a passphrase, readable by the daemon only")

    try:
        context.load_cert_chain(certificate, key, no_passphrase)
    except ssl.SSLError as error:
        if error.reason == "KEY_VALUES_MISMATCH":
            what = f"{key} is not the private key of {certificate}. Correct [mqtt] cert_file and key_file"
        else:
            what = f"{certificate} or {key} holds no certificate and key in PEM. Correct [mqtt] cert_file and key_file"
        raise OSError(what) from None
