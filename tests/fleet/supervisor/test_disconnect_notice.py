import os
import sys
import tempfile

import pytest

from fleet.supervisor.disconnect_notice import DisconnectNotice
from tests.tools.waiting import wait_until

WRITES = "import sys; open(sys.argv[1], 'w').write(sys.stdin.read())"
HANGS = "import time; time.sleep(60)"


@pytest.fixture
def left():
    """Return a descriptor of a file without a name, as an edge leaves it."""

    def left(text):
        with tempfile.TemporaryFile() as file:
            file.write(text)
            file.flush()
            return os.dup(file.fileno())

    return left


def test_what_was_left_last_is_given_to_the_program_that_tells_it_once(left, tmp_path):
    file = tmp_path / "told"
    notice = DisconnectNotice([sys.executable, "-c", WRITES, str(file)], lambda _line: None)
    notice.store([left(b"old")])
    notice.store([left(b"new")])
    notice.send()
    wait_until(
        "it is told", lambda: (tmp_path / "told").exists() and (tmp_path / "told").read_text() == "new"
    )
    (tmp_path / "told").unlink()
    notice.send()
    notice.abort()
    assert not file.exists()


def test_the_next_edge_ends_what_is_still_being_reported(left):
    notice = DisconnectNotice([sys.executable, "-c", HANGS], lambda _line: None)
    notice.store([left(b"x")])
    notice.send()
    process = notice._process
    notice.abort()
    assert process.returncode < 0


def test_a_program_that_cannot_be_started_is_reported(left):
    lines = []
    notice = DisconnectNotice(["/nowhere/at/all"], lines.append)
    notice.store([left(b"x")])
    notice.send()
    assert lines == ["cannot report the death of the edge to the cloud: No such file or directory"]
