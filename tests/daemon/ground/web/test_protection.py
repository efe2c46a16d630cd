"""Who may see the page, from where, and how one logs in: the whole application, asked in this process."""

from __future__ import annotations

from typing import TYPE_CHECKING

import pytest
from asgi_client import Browser

from regolithd.daemon.ground.ground import Ground
from regolithd.daemon.ground.settings import GroundSettings
from regolithd.daemon.ground.web import users
from regolithd.daemon.ground.web.application import application
from regolithd.daemon.ground.web.users import UsersError, add_user

if TYPE_CHECKING:
    from collections.abc import Iterator
    from pathlib import Path

PASSWORD = "correct horse battery"


@pytest.fixture
def settings(tmp_path: Path) -> GroundSettings:
    """A ground whose page has no users."""
    return GroundSettings.model_validate({"store": {"directory": tmp_path / "store"}})


def running(settings: GroundSettings) -> Iterator[Ground]:
    """Return a ground, and close its store at the end."""
    ground = Ground(settings)
    yield ground
    ground.connection.close()
    ground._lock.close()


@pytest.fixture
def local(settings: GroundSettings) -> Iterator[Browser]:
    """A browser on the computer of a ground without users."""
    for ground in running(settings):
        yield Browser(application(ground))


@pytest.fixture
def guarded(settings: GroundSettings, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Browser]:
    """A browser elsewhere, and a ground with the user anna."""
    monkeypatch.setattr(users, "LOG2_N", 4)
    add_user(tmp_path / "users", "anna", PASSWORD)
    page = settings.page.model_copy(update={"users": tmp_path / "users"})
    for ground in running(settings.model_copy(update={"page": page})):
        yield Browser(application(ground), host="ground.example:8642")


@pytest.mark.parametrize("host", ["localhost", "localhost:8642", "127.0.0.1:8642", "[::1]:8642", "[::1]"])
async def test_without_users_the_page_is_for_this_computer(local: Browser, host: str) -> None:
    """By any of its own names; nobody is logged in."""
    local.host = host
    assert (await local.get("/")).status == 200
    state = await local.get("/api/state")
    assert (state.status, state.json()["user"]) == (200, None)


@pytest.mark.parametrize("host", ["", "ground.example", "localhost.example", "[::2]:8642", "[::1", "10.0.0.1:8642"])
async def test_a_name_that_is_not_this_computer_s_is_refused(local: Browser, host: str) -> None:
    """Another web site cannot reach the page by a name of its own (DNS rebinding)."""
    local.host = host
    answer = await local.get("/api/state")
    assert (answer.status, answer.body) == (421, b"This page answers to the name localhost only.")


@pytest.mark.parametrize(
    ("origin", "status"),
    [("http://localhost:8642", 400), ("", 400), ("http://evil.test", 403), ("http://localhost:9", 403), ("null", 403)],
)  # fmt: skip
async def test_what_changes_something_comes_from_this_page(local: Browser, origin: str, status: int) -> None:
    """400: it is answered, and is no action; reading is refused to nobody, as a browser hides the answer."""
    headers = {"origin": origin} if origin else {}
    assert (await local.post("/api/alarms/kapvik/bus", {}, **headers)).status == status
    assert (await local.get("/api/state", **headers)).status == 200


@pytest.mark.parametrize("path", ["/", "/api/state", "/absent", "/static/page.css"])
async def test_every_answer_has_a_content_security_policy(local: Browser, path: str) -> None:
    """Also an error, and a refusal."""
    for host in ("localhost", "evil.example"):
        local.host = host
        headers = (await local.get(path)).headers
        assert headers["content-security-policy"] == (
            "default-src 'self'; frame-ancestors 'none'; base-uri 'none'; form-action 'self'"
        )
        assert (headers["x-content-type-options"], headers["referrer-policy"]) == ("nosniff", "same-origin")


async def test_page_and_icon_are_there(local: Browser) -> None:
    """The page is asked for anew each time, so that a new version is seen; there is no login."""
    page, icon = await local.get("/"), await local.get("/favicon.ico")
    assert (page.status, page.headers["cache-control"]) == (200, "no-cache")
    assert b"<html" in page.body
    assert (icon.status, icon.headers["location"]) == (301, "/static/icon.svg")
    assert (await local.get("/static/icon.svg")).status == 200
    assert (await local.get("/login")).status == 404


async def test_without_a_login_a_guarded_page_shows_the_login_alone(guarded: Browser) -> None:
    """A program is told so in JSON, a person is led there; what the login page itself needs is public."""
    page, program = await guarded.get("/"), await guarded.get("/api/state")
    assert (page.status, page.headers["location"]) == (303, "/login")
    assert (program.status, program.json()) == (401, {"error": "You are not logged in."})
    for path in ("/login", "/static/page.css", "/static/login.js", "/static/icon.svg"):
        assert (await guarded.get(path)).status == 200
    assert (await guarded.get("/static/page.js")).status == 303
    assert (await guarded.post("/api/alarms/kapvik/bus", {})).status == 401


@pytest.mark.parametrize(("scheme", "secure"), [("http", False), ("https", True)])
async def test_a_session_is_a_cookie_that_no_script_and_no_other_site_gets(
    guarded: Browser, scheme: str, secure: bool
) -> None:
    """For seven days, over TLS alone where there is TLS; it ends with the logout."""
    guarded.scheme = scheme
    answer = await guarded.post("/login", {"name": "anna", "password": PASSWORD})
    assert (answer.status, answer.json()) == (200, {"user": "anna"})
    cookie, *attributes = answer.headers["set-cookie"].split("; ")
    expected = {"HttpOnly", "Max-Age=604800", "Path=/", "SameSite=strict"} | ({"Secure"} if secure else set())
    assert set(attributes) == expected
    guarded.cookie = cookie
    assert (await guarded.get("/api/state")).json()["user"] == "anna"
    assert (await guarded.get("/")).status == 200
    out = await guarded.post("/logout")
    assert (out.status, out.headers["location"]) == (303, "/login")
    assert out.headers["set-cookie"].startswith('regolithd=""; ')
    assert (await guarded.get("/api/state")).status == 401


@pytest.mark.parametrize(("name", "password"), [("anna", "wrong horse battery"), ("berta", PASSWORD)])
async def test_a_wrong_name_and_a_wrong_password_are_told_alike(guarded: Browser, name: str, password: str) -> None:
    """After five of them the address has to wait, also with the right one; another address does not."""
    for _ in range(5):
        answer = await guarded.post("/login", {"name": name, "password": password})
        assert (answer.status, answer.json()) == (401, {"error": "Name or password is wrong."})
    blocked = await guarded.post("/login", {"name": "anna", "password": PASSWORD})
    assert blocked.status == 429
    assert blocked.json()["error"].startswith("Too many wrong passwords. Try again in ")
    assert 0 < int(blocked.headers["retry-after"]) <= users.FAILURES_WITHIN_S
    minutes = int(blocked.json()["error"].split(" in ")[1].removesuffix(" min."))
    assert minutes == pytest.approx(int(blocked.headers["retry-after"]) / 60, abs=0.51)
    guarded.address = "10.0.0.10"
    assert (await guarded.post("/login", {"name": "anna", "password": PASSWORD})).status == 200


async def test_a_login_without_a_password_is_told(guarded: Browser) -> None:
    """It counts as no failure."""
    for _ in range(6):
        answer = await guarded.post("/login", {"name": "anna"})
        assert (answer.status, answer.json()) == (400, {"error": "Name and password are needed."})


def test_a_file_of_users_that_is_not_there_ends_the_start(settings: GroundSettings, tmp_path: Path) -> None:
    """A page without its users would be open, or closed to everybody."""
    page = settings.page.model_copy(update={"users": tmp_path / "absent"})
    for ground in running(settings.model_copy(update={"page": page})):
        with pytest.raises(UsersError, match="--add-user"):
            application(ground)
