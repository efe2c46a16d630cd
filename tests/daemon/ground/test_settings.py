"""ground.toml: defaults, and what may not be combined."""

from __future__ import annotations

from typing import TYPE_CHECKING

import pytest

from regolithd.daemon.config.reader import ConfigurationError, read_tables
from regolithd.daemon.ground.settings import GroundSettings, checks_together

if TYPE_CHECKING:
    from pathlib import Path


def problems(tmp_path: Path, text: str) -> str:
    """Return the error text of a ground.toml."""
    path = tmp_path / "ground.toml"
    path.write_text(text)
    with pytest.raises(ConfigurationError) as caught:
        read_tables(path, GroundSettings, checks_together)
    return str(caught.value)


def test_an_open_page_needs_users_and_a_certificate(tmp_path: Path) -> None:
    """Both are reported at once, with what to do."""
    text = problems(tmp_path, '[page]\nhost = "0.0.0.0"\n')
    assert "page.users: expected a file of users, where others can reach the page" in text
    assert "page.certificate: expected a certificate" in text
    assert "--add-user NAME" in text


def test_a_misspelt_key_has_its_line_and_a_suggestion(tmp_path: Path) -> None:
    """As for rover.toml."""
    text = problems(tmp_path, '[store]\nkeep_day = 3\n[page]\ncertificate = "a.pem"\n')
    assert "ground.toml:2: store.keep_day" in text
    assert "Did you mean keep_days?" in text
    assert "page.key: expected certificate and key together" in text


def test_paths_are_relative_to_the_file(tmp_path: Path) -> None:
    """The store and the users lie beside ground.toml, wherever the ground is started."""
    (tmp_path / "ground.toml").write_text('[store]\ndirectory = "data"\n[page]\nusers = "users"\n')
    settings = read_tables(tmp_path / "ground.toml", GroundSettings, checks_together)
    assert settings.store.database == tmp_path / "data/ground.sqlite"
    assert settings.page.users == tmp_path / "users"


@pytest.mark.parametrize(
    ("host", "local"), [("127.0.0.1", True), ("::1", True), ("localhost", True), ("0.0.0.0", False)]
)
def test_the_loopback_addresses_are_local(host: str, *, local: bool) -> None:
    """Only they need neither users nor a certificate."""
    page = GroundSettings.model_validate({"page": {"host": host}}).page
    assert page.is_local is local
