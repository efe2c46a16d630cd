"""The page's address and certificate: what is wrong has one message with the setting."""

from __future__ import annotations

import socket
from typing import TYPE_CHECKING

import pytest
from certificates import Authority

from regolithd.daemon.ground.settings import Page
from regolithd.daemon.ground.web.listen import PageError, check_certificate, listen

if TYPE_CHECKING:
    from pathlib import Path


def test_a_free_port_is_listened_at() -> None:
    """By IPv4 and by IPv6, whichever the address is of."""
    with socket.socket() as free:
        free.bind(("127.0.0.1", 0))
        port = free.getsockname()[1]
    with listen(Page(host="127.0.0.1", port=port)) as opened:
        assert opened.family is socket.AF_INET
        assert opened.getsockname() == ("127.0.0.1", port)
        with socket.create_connection(("127.0.0.1", port), timeout=5):
            pass


@pytest.mark.skipif(not socket.has_dualstack_ipv6(), reason="this computer has no IPv6; enable it in the kernel")
def test_an_ipv6_address_is_listened_at() -> None:
    """It is one by its colons."""
    with socket.socket(socket.AF_INET6) as free:
        free.bind(("::1", 0))
        port = free.getsockname()[1]
    with listen(Page(host="::1", port=port)) as opened:
        assert opened.family is socket.AF_INET6


def test_a_port_that_another_program_has_is_named() -> None:
    """With the setting that chooses another."""
    with socket.create_server(("127.0.0.1", 0)) as other:
        port = other.getsockname()[1]
        with pytest.raises(PageError) as told:
            listen(Page(host="127.0.0.1", port=port))
    assert str(told.value) == f"127.0.0.1:{port}: another program uses it. Set [page] port in ground.toml"


def test_an_address_of_another_computer_is_named() -> None:
    """192.0.2.1 is an address of documentation (RFC 5737), which no computer has."""
    with pytest.raises(PageError, match=r"^192\.0\.2\.1:8642: Cannot assign .*\. Set \[page\] host in ground\.toml$"):
        listen(Page(host="192.0.2.1"))


def test_a_certificate_must_be_readable_and_have_its_key(tmp_path: Path) -> None:
    """Without certificate or key nothing is checked."""
    authority = Authority(tmp_path, "authority")
    mine, other = authority.issue("page"), authority.issue("other")
    check_certificate(Page())
    check_certificate(Page(certificate=tmp_path / "absent.pem"))
    check_certificate(Page(certificate=mine.path, key=mine.key))
    for certificate, key, told in (
        (tmp_path / "absent.pem", mine.key, r"\[page\] certificate .*absent\.pem: No such file or directory"),
        (mine.path, tmp_path / "absent.key", r"\[page\] key .*absent\.key: No such file or directory"),
        (mine.path, other.key, r"are no PEM files of a certificate and its unencrypted key \(KEY_VALUES_MISMATCH\)"),
    ):
        with pytest.raises(PageError, match=told):
            check_certificate(Page(certificate=certificate, key=key))
