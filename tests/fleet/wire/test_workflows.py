"""Executions of workflows: what the cloud asks, and what it is told."""

import json

import pytest

from fleet.errors import WireError
from fleet.wire.workflows import decode_workflow, finished, started


def read(**fields):
    return decode_workflow(json.dumps({"execution_uuid": "e1", **fields}).encode())


def test_a_request_is_read_with_its_inputs_and_when_it_was_made():
    requested = read(inputs={"height": 4}, requested_at="2026-11-23T02:00:00+00:00", requested_by_uuid="u1")
    assert (requested.execution, requested.inputs, requested.by) == ("e1", {"height": 4}, "u1")
    assert requested.stamp == 1795399200.0
    assert read(requested_at="2026-11-23T02:00:00").stamp == requested.stamp, "without a zone it is UTC"
    assert read(requested_at=requested.stamp * 1000).stamp == requested.stamp
    assert read(inputs=None, requested_at=None).stamp is None


@pytest.mark.parametrize(
    ("fields", "where"),
    [
        ({"execution_uuid": 7}, "execution_uuid"),
        ({"inputs": []}, "inputs"),
        ({"requested_at": "soon"}, "requested_at"),
        ({"requested_at": True}, "requested_at"),
        ({"requested_by_uuid": 7}, "requested_by_uuid"),
    ],
)
def test_what_is_malformed_is_refused_with_its_place(fields, where):
    with pytest.raises(WireError, match=where):
        read(**fields)


def test_what_is_published_has_the_forms_of_the_sdk():
    assert json.loads(started("e1")) == {"execution_uuid": "e1", "source_type": "edge"}
    assert json.loads(finished("success", "")) == {"status": "success", "source_type": "edge"}
    assert json.loads(finished("error", "no"))["error_message"] == "no"
