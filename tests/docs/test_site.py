"""The documentation site: builds without a warning, works offline, and is reachable from the README."""

from __future__ import annotations

import os
import re
import subprocess
import sys
from pathlib import Path

import pytest

pytestmark = pytest.mark.timeout(300)  # building the site takes 5 s, and more on a busy machine
ROOT = Path(__file__).resolve().parents[2]
DOCS = ROOT / "docs"
TEMPLATE = DOCS / "decisions/000-template.md"
LINK = re.compile(r"\]\(([^)\s#]+)(?:#[^)]*)?\)")
CODE = re.compile(r"```.*?```|`[^`\n]*`", flags=re.DOTALL)
PUBLIC = {"github.com", "www.nonlinearbenchmark.org", "semver.org"}
"""Public project sites that the documentation may name."""


def pages() -> list[Path]:
    """Every page of the site."""
    return [path for path in sorted(DOCS.rglob("*.md")) if path != TEMPLATE]


def links(page: Path) -> set[Path]:
    """Pages that a page links to."""
    text = CODE.sub("", page.read_text(encoding="utf-8"))
    found = {(page.parent / link).resolve() for link in LINK.findall(text) if "://" not in link}
    return {path / "README.md" if path.is_dir() else path for path in found}


@pytest.fixture(scope="module")
def site(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The site, built as `make docs` does, with warnings as errors."""
    folder = tmp_path_factory.mktemp("site")
    done = subprocess.run(
        [sys.executable, "-m", "mkdocs", "build", "--strict", "--quiet", "--site-dir", folder],
        cwd=ROOT,
        env=os.environ | {"NO_MKDOCS_2_WARNING": "1"},
        check=False,
        capture_output=True,
        text=True,
    )
    assert done.returncode == 0, done.stdout + done.stderr
    return folder


def test_every_page_is_in_the_navigation(site: Path) -> None:
    """Each Markdown file of docs/ becomes a page that the start page's navigation or its section links to."""
    built = {path.relative_to(site).as_posix() for path in site.rglob("*.html")}
    expected = {
        p.relative_to(DOCS).with_suffix(".html").as_posix().replace("README.html", "index.html") for p in pages()
    }
    assert expected <= built
    navigation = (ROOT / "mkdocs.yml").read_text(encoding="utf-8")
    assert [page for page in pages() if page.relative_to(DOCS).as_posix() not in navigation] == []


def test_the_site_needs_no_network(site: Path) -> None:
    """No page loads a script, a style, a font or a picture from another machine."""
    loading = re.compile(r"<(?:script|link|img|iframe)\b[^>]*\b(?:src|href)=\"?(?:https?:)?//[^>]*>")
    remote = {
        f"{path.relative_to(site)}: {tag}"
        for path in site.rglob("*.html")
        for tag in loading.findall(path.read_text(encoding="utf-8"))
    }
    assert not remote


def test_each_page_is_two_clicks_from_the_readme() -> None:
    """From README.md, at most two links lead to any page."""
    near = links(ROOT / "README.md")
    reached = near | {page for path in near if path.suffix == ".md" for page in links(path)}
    assert [str(page.relative_to(ROOT)) for page in pages() if page not in reached] == []


def test_only_public_project_sites_are_linked() -> None:
    """Addresses in the documentation belong to public projects and standards."""
    texts = [*pages(), *ROOT.glob("*.md")]
    hosts = {host for path in texts for host in re.findall(r"https?://([^/\s>)]+)", path.read_text(encoding="utf-8"))}
    assert hosts <= PUBLIC


def test_the_commands_page_has_every_command(site: Path) -> None:
    """The reference of the command line contains a section for each command, made from the command itself."""
    page = (site / "reference/commands.html").read_text(encoding="utf-8")
    for command in ("regolithd run", "regolithd mismatch", "regolithd calibrate wheels-up"):
        assert re.search(rf"<h2[^>]*>{command}", page)
