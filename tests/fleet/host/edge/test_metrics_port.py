"""A taken port of the metrics is tried again, and told once."""

import pytest

from fleet.config.schema import MetricsConfig
from fleet.errors import MetricsError
from fleet.host.edge.metrics_port import MetricsPort

TAKEN = "metrics: 127.0.0.1:9100 cannot be opened: Address already in use"
DENIED = "metrics: 127.0.0.1:9100 cannot be opened: Permission denied"


class Metrics:
    """Metrics whose port cannot be opened for these reasons, one after the other."""

    def __init__(self, *reasons):
        self.reasons, self.asked, self.port = list(reasons), [], 0

    def serve(self, host, port):
        self.asked.append((host, port))
        if self.reasons:
            raise MetricsError(self.reasons.pop(0))
        self.port = port


@pytest.fixture
def port():
    return lambda *reasons: MetricsPort(Metrics(*reasons), MetricsConfig(host="127.0.0.1", port=9100))


def lines(caplog):
    return [record.message for record in caplog.records if record.levelname == "ERROR"]


def test_a_free_port_is_opened_once(port, caplog):
    served = port()
    served.serve()
    served.serve()
    assert (served._metrics.asked, served.problem, lines(caplog)) == ([("127.0.0.1", 9100)], "", [])


def test_a_taken_port_is_a_problem_until_it_is_free_and_is_logged_once(port, caplog):
    served = port(TAKEN, TAKEN)
    problems = []
    for _ in range(4):
        served.serve()
        problems.append(served.problem)
    assert problems == [TAKEN, TAKEN, "", ""]
    assert lines(caplog) == [f"{TAKEN}; it is tried again"]
    assert len(served._metrics.asked) == 3


def test_another_reason_is_logged_too(port, caplog):
    served = port(TAKEN, DENIED)
    served.serve()
    served.serve()
    assert lines(caplog) == [f"{TAKEN}; it is tried again", f"{DENIED}; it is tried again"]
