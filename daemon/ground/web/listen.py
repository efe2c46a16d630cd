"""The page's address and certificate, tried before anything else runs, so that what is wrong has one message."""

from __future__ import annotations

import errno
import socket
import ssl
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from regolithd.daemon.ground.settings import Page


class PageError(OSError):
    """The page cannot be served; the message says which setting is wrong."""


def listen(page: Page) -> socket.socket:
    """Return a socket that listens at the page's address.

    Raises
    ------
    PageError
        Another program has the port, or this computer does not have the address.
    """
    family = socket.AF_INET6 if ":" in page.host else socket.AF_INET
    try:
        return socket.create_server((page.host, page.port), family=family)
    except OSError as error:
        taken = error.errno == errno.EADDRINUSE
        why = "another program uses it" if taken else error.strerror or str(error)
        key = "port" if taken else "host"
        raise PageError(f"{page.host}:{page.port}: {why}. Set [page] {key} in ground.toml") from error


def check_certificate(page: Page) -> None:
    """Check that certificate and key can be read and belong together.

    Raises
    ------
    PageError
        They cannot be used.
    """
    if page.certificate is None or page.key is None:
        return
    for name, path in (("certificate", page.certificate), ("key", page.key)):
        try:
            path.read_bytes()
        except OSError as error:
            raise PageError(f"[page] {name} {path}: {error.strerror}") from error
    try:
        ssl.SSLContext(ssl.PROTOCOL_TLS_SERVER).load_cert_chain(page.certificate, page.key, password="")
    except (ssl.SSLError, ValueError) as error:
        why = getattr(error, "reason", None) or str(error)
        told = f"{page.certificate} and {page.key} are no PEM files of a certificate and its unencrypted key ({why})"
        raise PageError(f"[page] certificate, key: {told}") from error
