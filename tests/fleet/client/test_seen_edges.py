import json

import pytest

from fleet.client.seen_edges import FILE, SeenEdges
from fleet.errors import StateError
from fleet.health.rollup import SeenEdge
from fleet.model.summary import Summary

YARD = SeenEdge("yard-1", False, 5.0, Summary("yard-1", "1", 4.0, 1.0), 4.0)
BARN = SeenEdge("barn", False, 6.0)


@pytest.fixture
def environ(tmp_path):
    return {"XDG_STATE_HOME": str(tmp_path / "state"), "FLEET_RUNTIME_DIR": str(tmp_path / "run")}


@pytest.fixture
def file(environ, tmp_path):
    return tmp_path / "state" / "fleet" / FILE


def test_what_was_seen_is_known_to_the_next_and_each_bus_has_its_own(environ):
    SeenEdges(None, environ).save([YARD])
    SeenEdges(None, environ).save([BARN])
    SeenEdges("site.yaml", environ).save([BARN])
    assert SeenEdges(None, environ).read() == {"yard-1": YARD, "barn": BARN}
    assert SeenEdges("site.yaml", environ).read() == {"barn": BARN}


def test_an_edge_is_forgotten_once(environ):
    edges = SeenEdges(None, environ)
    edges.save([YARD, BARN])
    assert edges.forget("barn")
    assert not edges.forget("barn")
    assert list(edges.read()) == ["yard-1"]


@pytest.mark.parametrize("broken", [b"", b"[]", b'{"format": 1}', b'{"format": 1, "buses": {"x": {"y": 1}}}'])
def test_a_file_that_cannot_be_read_is_reported_and_not_written_over(environ, file, broken):
    file.parent.mkdir(parents=True)
    file.write_bytes(broken)
    edges = SeenEdges(None, environ)
    for use in (edges.read, lambda: edges.save([YARD])):
        with pytest.raises(StateError, match=f"{FILE} cannot be read .*; remove it"):
            use()
    assert file.read_bytes() == broken


def test_a_file_of_a_newer_fleet_is_reported(environ, file):
    file.parent.mkdir(parents=True)
    file.write_text(json.dumps({"format": 2, "shelves": []}))
    with pytest.raises(StateError, match="format 2, of a newer fleet"):
        SeenEdges(None, environ).read()
