"""What the repository does on its own: workflows, hooks before a commit, notes of a release."""

import re
import subprocess
import sys
import tomllib
from importlib.machinery import SourceFileLoader
from importlib.util import module_from_spec, spec_from_loader

import pytest
import yaml

CHANGELOG = """# Changelog

## 0.3.0 (unreleased)

- later

## 0.2.0 (2027-01-02)

### Added

- a thing

## 0.1.0 (2026-12-01)

- the first
"""


@pytest.fixture(scope="module")
def release(root):
    """Load .ci/release-notes."""
    loader = SourceFileLoader("release_notes", str(root / ".ci" / "release-notes"))
    module = module_from_spec(spec_from_loader("release_notes", loader))
    loader.exec_module(module)
    return module


@pytest.fixture(scope="module")
def locked(root):
    """Return the versions that uv.lock pins, by package."""
    packages = tomllib.loads((root / "uv.lock").read_text())["package"]
    return {package["name"]: package.get("version") for package in packages}


def test_the_notes_of_a_release_are_its_section_of_the_changelog(release):
    assert release.notes("0.2.0", "0.2.0", CHANGELOG) == "### Added\n\n- a thing\n"


@pytest.mark.parametrize(
    ("tag", "version", "problem"),
    [
        ("0.2.0", "0.1.0", "the tag is 0.2.0, fleet/version.py says 0.1.0"),
        ("0.3.0", "0.3.0", "version 0.3.0 has no date"),
        ("0.4.0", "0.4.0", "no version 0.4.0"),
    ],
)
def test_a_release_whose_tag_version_and_changelog_disagree_has_no_notes(release, tag, version, problem):
    with pytest.raises(ValueError, match=re.escape(problem)):
        release.notes(tag, version, CHANGELOG)


def test_a_release_that_cannot_be_described_ends_the_workflow(root):
    done = subprocess.run(
        [sys.executable, root / ".ci" / "release-notes", "99.0.0"],
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 1
    assert "the tag is 99.0.0" in done.stderr


def test_the_hooks_before_a_commit_use_the_versions_of_the_lock(root, locked):
    hooks = yaml.safe_load((root / ".pre-commit-config.yaml").read_text())["repos"]
    revisions = {hook["repo"].rpartition("/")[2]: hook["rev"] for hook in hooks if "rev" in hook}
    assert revisions == {"ruff-pre-commit": f"v{locked['ruff']}"}
    entries = [hook["entry"] for repo in hooks if repo["repo"] == "local" for hook in repo["hooks"]]
    assert all(entry.startswith(".venv/bin/") for entry in entries)  # what uv.lock put there


def test_the_workflow_runs_the_one_script_on_every_python_that_is_supported(root, project):
    jobs = yaml.safe_load((root / ".github" / "workflows" / "ci.yml").read_text())["jobs"]
    classifiers = "\n".join(project["project"]["classifiers"])
    supported = re.findall(r"Python :: (3\.\d+)", classifiers)
    assert jobs["test"]["strategy"]["matrix"]["python"] == supported
    assert [step["run"] for step in jobs["test"]["steps"] if "run" in step] == [".ci/run"]
    assert project["project"]["requires-python"] == f">={supported[0]}"


def test_every_script_that_a_workflow_calls_is_there_and_can_be_run(root):
    for path in (root / ".github" / "workflows").glob("*.yml"):
        for script in re.findall(r"\.ci/[\w-]+", path.read_text()):
            assert (root / script).stat().st_mode & 0o111, f"{path.name}: {script}"
