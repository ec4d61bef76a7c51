"""A test that hangs fails in time, with its name."""

import re
import subprocess
import sys

import pytest

# conftest.py of a folder of its own: the one of the project starts brokers and looks for programs.
CONFTEST = """
import sys
sys.path.insert(0, {tests!r})
import hangs
from fleet.runtime.event_loop import FleetLoop

hangs.AFTER_CANCEL = {grace}

def pytest_addoption(parser, pluginmanager):
    pluginmanager.register(hangs, "hangs")

def pytest_asyncio_loop_factories():
    return {{"fleet": FleetLoop}}
"""
HANGING = {
    "in the loop": "async def test_it():\n    await asyncio.Event().wait()\n",
    "in a thread's lock": "def test_it():\n    threading.Event().wait()\n",
    "in a fixture of the loop": (
        "@pytest.fixture\nasync def one():\n    await asyncio.Event().wait()\n\ndef test_it(one):\n    pass\n"
    ),
    "at the end of a fixture, after a failure": (
        "@pytest.fixture\nasync def one():\n    yield\n    await asyncio.Event().wait()\n\n"
        "def test_it(one):\n    assert False\n"
    ),
}


@pytest.fixture
def run_tests(root, tmp_path):
    """Run tests in a pytest of their own with a limit of a second; return its exit code and its output."""

    def run_tests(*texts, options=(), grace=20.0):
        (tmp_path / "conftest.py").write_text(CONFTEST.format(tests=str(root / "tests"), grace=grace))
        rest = "\n\ndef test_another():\n    pass\n"
        for number, text in enumerate(texts):
            file = tmp_path / f"test_hanging_{number}.py"
            file.write_text("import asyncio, threading, pytest\n\n" + text + rest)
        line = [sys.executable, "-m", "pytest", "-c", str(root / "pyproject.toml"), "-p", "no:cacheprovider"]
        line += [str(tmp_path), "--timeout", "1", *options]
        done = subprocess.run(
            line, cwd=tmp_path, check=False, capture_output=True, text=True, encoding="utf-8", timeout=120
        )
        return done.returncode, done.stdout + done.stderr

    return run_tests


def test_a_test_that_hangs_fails_with_its_name_and_the_others_run(run_tests):
    code, output = run_tests(*HANGING.values())
    assert code == 1, output
    summary = output.partition("short test summary info")[2]
    failed = [line for line in summary.splitlines() if line.startswith(("FAILED", "ERROR"))]
    names = [f"test_hanging_{number}.py::test_it" for number in range(len(HANGING))]
    for where, name in zip(HANGING, names, strict=True):
        assert [line for line in failed if name in line], (where, output)
    assert all(any(name in line for name in names) for line in failed), output
    passed = int(re.search(r"(\d+) passed", output)[1])
    assert passed in (len(names), len(names) + 1), output


def test_a_test_that_ignores_its_cancellation_ends_its_process_with_its_name(run_tests):
    text = (
        "async def test_it():\n    while True:\n        try:\n            await asyncio.Event().wait()\n"
        "        except asyncio.CancelledError:\n            pass\n"
    )
    code, output = run_tests(text, grace=0.5)
    assert code == 1, output
    assert "test_hanging_0.py::test_it takes more than 1 s" in output
    code, output = run_tests(text, options=("-n", "1"), grace=0.5)
    assert "crashed while running" in output, output
    assert "1 failed, 1 passed" in output, output
