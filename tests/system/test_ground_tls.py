"""The ground for others on the network: TLS and passwords, and what is said where the certificate cannot be used."""

from __future__ import annotations

import socket
import ssl
import subprocess
import sys
import urllib.error
import urllib.request
import warnings
from typing import TYPE_CHECKING

import pytest
from broker import unused_port
from certificates import Authority, Certificate, new_authority
from ground_rig import GroundRig
from playwright.sync_api import expect

from regolithd.daemon.ground.web.users import add_user

if TYPE_CHECKING:
    from pathlib import Path

    from broker import Mosquitto
    from playwright.sync_api import Browser

pytestmark = pytest.mark.timeout(120)
LOCALHOST = "DNS:localhost"


@pytest.fixture(scope="module")
def authority(tmp_path_factory: pytest.TempPathFactory) -> Authority:
    """A certificate authority."""
    return new_authority(tmp_path_factory.mktemp("authority"), "ground")


def page_settings(issued: Certificate) -> str:
    """Return further lines of [page] that let others see the page."""
    return f'host = "0.0.0.0"\nusers = "users"\ncertificate = "{issued.path}"\nkey = "{issued.key}"'


def test_over_tls_the_page_is_encrypted_and_the_login_stays_in_the_browser(
    browser: Browser, authority: Authority, tmp_path: Path, mosquitto: Mosquitto
) -> None:
    """The certificate is checked by its authority; old protocols and plain HTTP fail; the cookie is for HTTPS alone."""
    issued = authority.issue("localhost", subject_alternative_name=LOCALHOST)
    rig = GroundRig(tmp_path, mosquitto, page=page_settings(issued), scheme="https")
    add_user(tmp_path / "users", "ada", "difference engine")
    try:
        rig.start_ground()
        trusting = ssl.create_default_context(cafile=authority.ca.path)
        with urllib.request.urlopen(rig.url, context=trusting, timeout=20) as answer:
            assert answer.url == f"{rig.url}/login"
        with pytest.raises(urllib.error.URLError, match="CERTIFICATE_VERIFY_FAILED"):
            urllib.request.urlopen(rig.url, timeout=20)
        with pytest.raises(OSError, match=r"reset|closed|disconnected|empty"):
            urllib.request.urlopen(rig.url.replace("https", "http"), timeout=20)
        assert handshake(rig.port, ssl.TLSVersion.TLSv1_2) == "TLSv1.2"
        with pytest.raises(OSError, match=r"(?i)protocol|alert|version|reset"):
            handshake(rig.port, ssl.TLSVersion.TLSv1_1)
        context = browser.new_context(ignore_https_errors=True)
        page = context.new_page()
        page.goto(rig.url)
        page.get_by_label("Name").fill("ada")
        page.get_by_label("Password").fill("difference engine")
        page.get_by_role("button", name="Log in").click()
        expect(page.locator("#user")).to_have_text("ada")
        expect(page.locator("#problem")).to_be_hidden()
        (cookie,) = context.cookies()
        assert (cookie["secure"], cookie["httpOnly"], cookie["sameSite"]) == (True, True, "Strict")
        context.close()
    finally:
        rig.end()


def handshake(port: int, version: ssl.TLSVersion) -> str | None:
    """Connect with one version of TLS, whose ciphers may be weak, and return the version."""
    context = ssl.SSLContext(ssl.PROTOCOL_TLS_CLIENT)
    context.check_hostname, context.verify_mode = False, ssl.CERT_NONE
    context.set_ciphers("ALL:@SECLEVEL=0")
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", DeprecationWarning)  # of old versions of TLS
        context.minimum_version = context.maximum_version = version
    with socket.create_connection(("localhost", port), 20) as plain, context.wrap_socket(plain) as encrypted:
        return encrypted.version()


@pytest.mark.parametrize(
    ("lines", "told"),
    [
        ('certificate = "none.pem"\nkey = "{key}"', "[page] certificate {folder}/none.pem: No such file or directory"),
        ('certificate = "{path}"\nkey = "{other}"', "are no PEM files of a certificate and its unencrypted key"),
        ('certificate = "{path}"\nkey = "{encrypted}"', "are no PEM files of a certificate and its unencrypted key"),
        ("", "127.0.0.1:{port}: another program uses it. Set [page] port"),
    ],
    ids=["no file", "key of another", "encrypted key", "port in use"],
)
def test_what_the_page_cannot_use_has_one_message(lines: str, told: str, authority: Authority, tmp_path: Path) -> None:
    """Status 1 and one line, no traceback."""
    ours, other = (authority.issue("localhost") for _ in range(2))
    Authority.encrypt(ours.key, tmp_path / "encrypted.key", "secret")
    names = {"path": ours.path, "key": ours.key, "other": other.key, "encrypted": tmp_path / "encrypted.key"}
    with socket.create_server(("127.0.0.1", 0)) as taken:
        port = taken.getsockname()[1] if not lines else unused_port()
        page = f"[page]\nport = {port}\n{lines.format(**names)}\n"
        (tmp_path / "ground.toml").write_text(f'{page}[store]\ndirectory = "data"\n')
        command = [sys.executable, "-m", "regolithd", "ground", "--config", tmp_path / "ground.toml"]
        done = subprocess.run(command, capture_output=True, text=True, check=False, timeout=60)
    assert done.returncode == 1
    (line,) = done.stderr.splitlines()
    assert told.format(port=port, folder=tmp_path) in line
