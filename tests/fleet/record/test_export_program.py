"""The process that exports a window: a line with what is wrong, then the file."""

import subprocess
import sys

import msgspec
import pytest

from fleet.record.export import recorded
from fleet.record.export_task import ExportTask
from tests.tools.recordings import write_recording

BEGINS = 1_795_000_000.0


@pytest.fixture
def folder(tmp_path):
    write_recording(tmp_path / "recordings", BEGINS, 10)
    return str(tmp_path / "recordings")


def export(task):
    """Return the exit code, the line and the file that the process writes."""
    command = [sys.executable, "-m", "fleet.record.export_program"]
    result = subprocess.run(command, input=msgspec.json.encode(task), capture_output=True, check=False)
    line, _, file = result.stdout.partition(b"\n")
    return result.returncode, msgspec.json.decode(line), file


def test_a_window_is_written_as_a_file_with_an_index(folder, tmp_path):
    code, problem, file = export(ExportTask((folder,), BEGINS + 3, BEGINS + 5))
    (tmp_path / "window.mcap").write_bytes(file)
    found = recorded(tmp_path / "window.mcap")
    assert (code, problem) == (0, "")
    assert (found.begins, found.ends, found.messages > 0) == (BEGINS + 3, BEGINS + 4.5, True)


def test_what_is_wrong_is_reported_instead_of_a_file(folder, tmp_path):
    assert export(ExportTask((folder,), 5.0, 6.0)) == (1, "nothing is recorded of that time", b"")
    code, problem, file = export(ExportTask((str(tmp_path / "none"),), 5.0, 6.0))
    assert (code, "there is no folder" in problem, file) == (1, True, b"")
