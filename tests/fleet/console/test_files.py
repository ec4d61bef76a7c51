"""The files of the page: a table, and nothing outside of it."""

import hashlib
import re
from pathlib import Path

import pytest

from fleet.console.files import TYPES, page_files

ESCAPES = (
    "/../pyproject.toml",
    "/static/../../app.py",
    "/%2e%2e/%2e%2e/etc/passwd",
    "/..%2f..%2fetc/passwd",
    "/....//....//etc/passwd",
    "/%252e%252e/etc/passwd",
    "//etc/passwd",
    "/index.html%00.js",
    "/stop.js/../app.py",
    "/app.py",
    "/__init__.py",
    "/.git/config",
)


@pytest.mark.parametrize("path", ESCAPES)
def test_no_path_leads_out_of_the_page(console, path):
    status, _, body = console.request("GET", path)
    assert (status, body) == (404, b"there is nothing here\n")


def test_each_file_is_served_as_what_it_is(console):
    for path, file in page_files().items():
        status, headers, body = console.request("GET", path)
        assert (status, headers["content-type"], body) == (200, file.media_type, file.content)


def test_the_page_loads_nothing_from_elsewhere_and_has_no_code_in_itself():
    files = page_files()
    assert set(TYPES) == {".html", ".css", ".js", ".svg"}
    page = files["/"].content.decode()
    assert "style=" not in page
    assert "onclick" not in page
    assert all(f'src="{path}"' in page for path in ("/stop.js", "/app.js"))
    for path, file in files.items():
        if path.startswith("/vendor/"):
            continue
        text = file.content.decode().replace("http://www.w3.org/2000/svg", "")
        assert "http://" not in text, path
        assert "https://" not in text, path
        assert "innerHTML" not in text, path


def test_what_others_wrote_is_as_they_released_it_and_has_its_licence():
    root = Path(__file__).parents[3]
    dependencies = (root / "docs" / "dependencies.md").read_text()
    rows = re.findall(
        r"^\| (\S+\.(?:js|css)) \| (\w+) \S+ \| [\w-]+ \| ([0-9a-f]{64}) ", dependencies, re.MULTILINE
    )
    vendor = root / "fleet" / "console" / "static" / "vendor"
    files = {path.name: hashlib.sha256(path.read_bytes()).hexdigest() for path in vendor.glob("*.*s*")}
    files = {name: digest for name, digest in files.items() if not name.endswith(".txt")}
    assert files == {name: digest for name, _, digest in rows}
    licences = {path.name.partition(".")[0].lower() for path in vendor.glob("*.LICENSE.txt")}
    assert {package for _, package, _ in rows} <= licences
