"""Files, folders, classes and threads that the documents name exist, and the map of the tree is complete."""

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
THREADED = ("bus", "cloud", "host", "link", "missions", "spool", "standby")
OF_OTHERS = {
    *("None", "Literal"),
    *("DataBus", "CronTrigger"),  # of Cyberwave's SDK and of APScheduler
    *("HttpOnly", "Secure"),  # of cookies
    *("KillMode", "PrivateUsers"),  # of systemd
    "BestMatching",  # of Zenoh
}
"""Names in the documents that this project does not define."""


def defined_in(text):
    """Return the classes and module-level names that Python text defines."""
    return {
        match[1] or match[2]
        for match in re.finditer(r"^ *class (\w+)|^(\w+)(?:: [^=\n]+)? = ", text, re.MULTILINE)
    }


DEFINED = defined_in(
    "\n".join(path.read_text(encoding="utf-8") for path in (*PAGES, *(ROOT / file[1:] for file in FILES)))
)


@pytest.mark.parametrize("page", PAGES, ids=lambda page: str(page.relative_to(ROOT)))
def test_each_source_file_that_a_page_names_exists(page):
    named = set(re.findall(r"`((?:[\w-]+/)*\w+\.py)`", page.read_text(encoding="utf-8")))
    elsewhere = {"plugins/my_robot.py", "test_my_robot.py", "app.py"}  # the reader's own, and Waveshare's
    assert {
        name for name in named - elsewhere if not any(file.endswith(f"/{name}") for file in FILES)
    } == set()


@pytest.mark.parametrize("folder", FOLDERS, ids=lambda path: str(path.relative_to(ROOT)))
def test_the_map_of_the_tree_draws_each_folder_and_says_what_it_is_for(folder):
    page = (ROOT / "docs/architecture.md").read_text(encoding="utf-8")
    assert re.search(rf"[├└]── {folder.name}/ +\w", page)
    assert f"**`{folder.relative_to(ROOT)}`**" in page


@pytest.mark.parametrize("name", sorted(path.name for path in (ROOT / "fleet").glob("[!_]*.py")))
def test_the_map_of_the_tree_draws_each_module_beside_the_folders(name):
    page = (ROOT / "docs/architecture.md").read_text(encoding="utf-8")
    assert name == "version.py" or re.search(rf"[├└]── {name} +\w", page)


@pytest.mark.parametrize("folder", [str(path.relative_to(ROOT)) for path in FOLDERS])
def test_each_module_that_the_architecture_names_for_a_folder_is_in_it(folder):
    page = (ROOT / "docs/architecture.md").read_text(encoding="utf-8")
    described = re.findall(rf"\*\*`{folder}`\*\*(.*?)(?=\*\*`|\n## )", page, re.DOTALL)
    named = set(re.findall(r"`(\w+\.py)`", " ".join(described)))
    modules = {path.name for path in (ROOT / folder).rglob("*.py")}
    assert named - modules == set()


@pytest.mark.parametrize("page", PAGES, ids=lambda page: str(page.relative_to(ROOT)))
def test_each_class_or_constant_that_a_page_names_exists(page):
    prose = re.sub(r"```.*?```", "", page.read_text(encoding="utf-8"), flags=re.DOTALL)
    named = {name.partition(".")[0] for name in re.findall(r"`([A-Z][a-z]\w*(?:\.\w+)?)`", prose)}
    assert named - DEFINED - OF_OTHERS == set()


def test_each_thread_of_an_edge_is_in_the_table_of_threads():
    page = (ROOT / "docs/architecture.md").read_text(encoding="utf-8")
    sources = "\n".join(
        path.read_text(encoding="utf-8")
        for folder in THREADED
        for path in (ROOT / "fleet" / folder).rglob("*.py")
    )
    names = re.findall(r"(?:thread_name_prefix=|name=|NAME = |THREAD = )f?\"(fleet-[a-z-]*[a-z])", sources)
    assert len(names) > 10, "threads are found"
    assert {name for name in names if f"`{name}" not in page} == set()
