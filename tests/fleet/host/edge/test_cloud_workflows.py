"""Workflows of the cloud start the missions that fleet.yaml has for them, and no others."""

import asyncio
import json
import time
from datetime import UTC, datetime

import pytest
from cyberwave.mqtt import CyberwaveMQTTClient
from cyberwave.workers.hooks import manual_trigger_topic, workflow_cancel_topic
from cyberwave.workflow_executions import WorkflowExecutionReporter

from fleet.cloud.values import CloudMessage, CloudState
from fleet.config.load import load
from fleet.config.problems import InvalidConfig
from fleet.errors import WireError
from fleet.host.edge.cloud_workflows import ENDS
from fleet.missions.state import RunOutcome
from fleet.wire.rules import WORKFLOW_CANCEL, WORKFLOW_RUN
from fleet.wire.topics import Topic
from tests.tools import sdk

HERE = {"worker": "main", "accepts": {"mission": ["tele"], "command": ["tele"]}}
WORKFLOW, OTHER = "6f0c9a1e-0000-4000-8000-00000000cccc", "6f0c9a1e-0000-4000-8000-00000000dddd"
RUN = "6f0c9a1e-0000-4000-8000-00000000aaaa"
PATROL = {
    "version": 1,
    "inputs": {"rest": {"type": "number", "default": 0.1}},
    "roles": {"eye": {"from": "rex"}},
    "steps": [{"id": "go", "do": {"eye": "walk"}}, {"id": "rest", "wait": {"input": "rest"}}],
}


def now():
    return datetime.now(UTC).isoformat()


class Cloud:
    """What the cloud asks of an edge's workflows, and is told."""

    def __init__(self, edge):
        self.edge, self.workflows = edge, edge.missions.workflows
        self.published = []
        self.workflows.publish = lambda uuid, suffix, payload: self.published.append(
            (uuid, suffix.partition(":")[2], json.loads(payload))
        )

    def run(self, workflow=WORKFLOW, **fields):
        self._say(WORKFLOW_RUN, workflow, {"requested_at": now(), **fields})

    def cancel(self, workflow=WORKFLOW):
        self._say(WORKFLOW_CANCEL, workflow, {})

    def _say(self, suffix, workflow, fields):
        payload = json.dumps({"execution_uuid": RUN, **fields}).encode()
        self.workflows.handlers[suffix](Topic(workflow, suffix), CloudMessage("t", payload))

    @property
    def ends(self):
        return [body for _, suffix, body in self.published if suffix.endswith("/finished")]


@pytest.fixture
def place(yard):
    place = yard(rex=HERE)
    cloud = {"host": "127.0.0.1", "port": 1, "tls": False, "workflows": {WORKFLOW: {"mission": "patrol"}}}
    place.change(missions={"patrol": PATROL}, cloud=cloud)
    return place


@pytest.fixture
async def cloud(place, run_edge, requests):
    edge = place.edge()
    async with run_edge(edge):
        await requests.until(lambda: edge.states()[0].health == "ok")
        cloud = Cloud(edge)
        cloud.words = lambda: place.words("rex")
        yield cloud


async def test_a_mapped_workflow_starts_its_mission_in_the_name_that_fleet_yaml_says(cloud, requests):
    cloud.run(requested_by_uuid="u1")
    cloud.run(requested_by_uuid="u1")  # the cloud repeats it until it hears that it was started
    await requests.until(lambda: cloud.published)
    about = cloud.edge.missions.runs.find(RUN).about
    assert (about.transport, about.source_type, about.workflow) == ("cloud", "tele", WORKFLOW)
    assert about.by == f"workflow {WORKFLOW} by u1"
    await requests.until(lambda: cloud.ends)
    cloud.run(requested_by_uuid="u1")
    await requests.until(lambda: len(cloud.ends) == 2)
    assert cloud.ends == [{"status": "success", "source_type": "edge"}] * 2
    assert cloud.words().count("walk") == 1


async def test_a_cancelled_execution_is_an_aborted_run(cloud, requests):
    cloud.run(inputs={"rest": 600})
    await requests.until(lambda: cloud.published)
    cloud.cancel(OTHER)  # of another workflow: not this run
    assert cloud.ends == []
    cloud.cancel()
    await requests.until(lambda: cloud.ends)
    assert cloud.ends[0]["status"] == "canceled"
    assert cloud.ends[0]["error_message"].startswith("aborted: aborted by workflow")


async def test_what_robots_would_not_obey_starts_nothing_and_is_reported(cloud, requests):
    events = []
    cloud.edge.process.history.on_event = lambda _, event: events.append(event)
    old = datetime.fromtimestamp(time.time() - 60, UTC).isoformat()
    for fields, why in (
        ({"requested_at": old}, " s old"),
        ({"inputs": {"speed": 1}}, "no input 'speed'"),
    ):
        cloud.published.clear()
        cloud.run(**fields)
        await requests.until(lambda: cloud.ends)
        assert (cloud.ends[0]["status"], why in cloud.ends[0]["error_message"]) == ("error", True)
        assert why in events[-1].text
    for bad in ({"execution_uuid": 7}, {"requested_at": "soon"}, {"inputs": []}):
        with pytest.raises(WireError):
            cloud.run(**bad)
    assert "walk" not in cloud.words()


async def test_a_workflow_gives_nobody_rights_that_a_robot_does_not_give(yard, run_edge, requests):
    place = yard(rex={"worker": "main"})  # it lets nobody start missions but local operators
    workflows = {WORKFLOW: {"mission": "patrol"}}
    cloud = {"host": "127.0.0.1", "port": 1, "tls": False, "workflows": workflows}
    place.change(missions={"patrol": PATROL}, cloud=cloud)
    edge = place.edge()
    async with run_edge(edge):
        await requests.until(lambda: edge.states()[0].health == "ok")
        requested = Cloud(edge)
        requested.run()
        await requests.until(lambda: requested.ends)
        assert (
            "rex: source_type 'tele'; this robot accepts no source_type" in requested.ends[0]["error_message"]
        )
        assert "walk" not in place.words()


async def test_the_sdk_starts_a_mapped_workflow_and_hears_of_no_other(place, broker, run_edge, requests):
    place.change(
        cloud={
            "host": "127.0.0.1",
            "port": broker.port,
            "tls": False,
            "workflows": {WORKFLOW: {"mission": "patrol", "inputs": {"rest": 0.1}}},
        }
    )
    client = CyberwaveMQTTClient(mqtt_broker="127.0.0.1", mqtt_port=broker.port, mqtt_password="k")
    heard = []
    edge = place.edge()
    async with run_edge(edge):
        await requests.until(lambda: edge.states()[0].health == "ok")
        await requests.until(lambda: edge.bridge.client.state is CloudState.CONNECTED)
        await asyncio.to_thread(client.connect)
        for suffix in ("started", f"{RUN}/finished"):
            client.subscribe(f"cyberwave/workflow/{WORKFLOW}/execution/{suffix}", heard.append)
        for workflow in (OTHER, WORKFLOW):
            envelope = {"execution_uuid": RUN, "inputs": {}, "params": {}, "requested_at": now()}
            client.publish(manual_trigger_topic(workflow), envelope)
        await requests.until(lambda: len(heard) == 2)
        client.publish(workflow_cancel_topic(OTHER), {"execution_uuid": RUN})
        await asyncio.to_thread(sdk.end, client)
    assert [(each.get("execution_uuid"), each.get("status")) for each in heard] == [
        (RUN, None),
        (None, "success"),
    ]
    assert place.words("rex").count("walk") == 1


async def test_what_is_published_is_what_the_sdk_itself_would_publish(cloud, requests):
    class FakeMqtt:
        connected, topic_prefix = True, ""

        def publish(self, topic, payload):
            from_sdk.append((topic, payload))

    from_sdk = []
    client = type("Client", (), {"mqtt": FakeMqtt()})()
    reporter = WorkflowExecutionReporter(client, workflow_uuid=WORKFLOW, execution_uuid=RUN)
    reporter._send_started()
    reporter.finished()
    cloud.run()
    await requests.until(lambda: cloud.ends)
    ours = [(f"cyberwave/workflow/{uuid}/{suffix}", body) for uuid, suffix, body in cloud.published]
    assert ours == from_sdk


def test_every_end_of_a_run_is_an_end_of_an_execution():
    assert set(ENDS) == set(RunOutcome)
    assert set(ENDS.values()) == {"success", "error", "canceled"}


def test_a_workflow_of_a_mission_that_there_is_not_is_found_by_check(place):
    place.change(missions={"patrols": PATROL})
    with pytest.raises(InvalidConfig) as problems:
        load(place.file)
    (problem,) = problems.value.problems
    assert "there is no mission 'patrol'" in str(problem)
    assert "patrols" in problem.hint
