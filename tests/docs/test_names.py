"""Files and folders that the documents name exist, and the map of the tree is complete."""

import pathlib
import re

import pytest

ROOT = pathlib.Path(__file__).parents[2]
PAGES = [ROOT / "README.md", ROOT / "CONTRIBUTING.md", *sorted((ROOT / "docs").rglob("*.md"))]
SOURCES = ("fleet", "adapters", "plugins", "tests", "bench", "docs")
FILES = [f"/{path.relative_to(ROOT)}" for folder in SOURCES for path in (ROOT / folder).rglob("*.py")]
FOLDERS = [
    path
    for top in ("fleet", "fleet/host")
    for path in (ROOT / top).iterdir()
    if (path / "__init__.py").exists()
]


@pytest.mark.parametrize("page", PAGES, ids=lambda page: str(page.relative_to(ROOT)))
def test_each_source_file_that_a_page_names_exists(page):
    named = set(re.findall(r"`((?:[\w-]+/)*\w+\.py)`", page.read_text(encoding="utf-8")))
    elsewhere = {"plugins/my_robot.py", "app.py"}  # the reader's own, and Waveshare's
    assert {
        name for name in named - elsewhere if not any(file.endswith(f"/{name}") for file in FILES)
    } == set()


@pytest.mark.parametrize("folder", FOLDERS, ids=lambda path: str(path.relative_to(ROOT)))
def test_the_map_of_the_tree_draws_each_folder_and_says_what_it_is_for(folder):
    page = (ROOT / "docs/architecture.md").read_text(encoding="utf-8")
    assert re.search(rf"[├└]── {folder.name}/ +\w", page)
    assert f"**`{folder.relative_to(ROOT)}`**" in page
