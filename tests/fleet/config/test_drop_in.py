"""What is asked of a drop-in file about a robot, and what becomes of its answer."""

import json
from types import SimpleNamespace
from uuid import UUID

import pytest

from fleet.config.drop_in import requested
from fleet.plugins.probe import CheckedConfig, Flaw, ProbeError, ProblemPlace
from fleet.robot_config import AdapterConfig

TWIN = "6f0c9a1e-8d2b-4c57-9a39-2f4a1d0b7c11"
AT = ("robots", 1)
TEXT = (
    f"x: 1\nrobots:\n  - name: a\n  - name: rex\n    twin: {TWIN}\n"
    "    link: ${LINK:-udp}\n    wrong: ${NO}\n"
)
FIELDS = {"name": "rex", "twin": TWIN, "setpoint_lease": 2.0, "max_age": 0.5}


class Bench:
    """A file with a robot of a drop-in file, which answers as the test says."""

    def __init__(self, document, folder):
        self.document = document
        self.folder = folder
        self.cases = []
        self.answer = CheckedConfig()

    def check(self, plugin, case):
        self.cases.append(case)
        if isinstance(self.answer, Exception):
            raise self.answer
        return self.answer

    def requested(self, answer=None):
        self.answer = answer or self.answer
        return requested(
            self,
            SimpleNamespace(name="toy", origin="plugins/toy.py"),
            self.document.data["robots"][1],
            at=AT,
            document=self.document,
            context={"folder": self.folder},
        )

    @property
    def problems(self):
        """The problems since the file was read."""
        return [(each.line, each.path, each.message, each.hint) for each in self.document.problems[1:]]


@pytest.fixture
def bench(reading, tmp_path):
    return Bench(reading(TEXT), tmp_path)


def answered(**more):
    return CheckedConfig(given="{}", fields=json.dumps({**FIELDS, **more}), identity="udp#1")


def test_a_robot_has_the_hosts_fields_that_the_file_accepted(bench):
    answer = answered()
    config, said = bench.requested(answer)
    assert said is answer
    assert (config.name, config.twin, config.setpoint_lease) == ("rex", UUID(TWIN), 2.0)
    assert (config.simulated, config.source_type, bench.problems) == (False, "edge", [])


def test_a_field_that_is_as_the_host_has_it_counts_as_not_given(bench):
    """Robots share the values of fields that are not given."""
    config, _ = bench.requested(answered(limits={}, separation={}))
    assert "setpoint_lease" in config.model_fields_set
    assert "max_age" not in config.model_fields_set
    assert config.accepts is AdapterConfig.model_fields["accepts"].default


def test_fields_of_the_adapter_are_left_to_its_file(bench):
    config, _ = bench.requested(answered(adapter="toy", pace="fast"))
    assert not hasattr(config, "pace")


def test_a_simulation_is_what_the_files_config_says(bench):
    config, _ = bench.requested(CheckedConfig(fields=json.dumps(FIELDS), simulated=True))
    assert (config.simulated, config.source_type) == (True, "sim")


def test_the_file_is_told_the_robot_with_its_places_and_nothing_of_the_rest(bench):
    bench.requested()
    (case,) = bench.cases
    assert (case.adapter, case.at, case.folder) == ("toy", AT, str(bench.folder))
    assert json.loads(case.data) == {"name": "rex", "twin": TWIN, "link": "udp", "wrong": None}
    assert {steps for steps, _ in case.marks} == {
        (),
        AT,
        *((*AT, key) for key in ("name", "twin", "link", "wrong")),
    }
    assert {steps for steps, _ in case.keys} == {(*AT, key) for key in ("name", "twin", "link", "wrong")}
    assert dict(case.marks)[*AT, "twin"] == ProblemPlace(
        str(bench.folder / "fleet.yaml"), 5, 11, (*AT, "twin")
    )
    assert (set(case.texts), set(case.spoiled)) == ({(*AT, "link")}, {(*AT, "wrong")})


def test_errors_of_the_file_are_reported_at_their_places(bench):
    place = ProblemPlace(str(bench.folder / "fleet.yaml"), 6, 11, (*AT, "link"))
    assert bench.requested(CheckedConfig(flaws=(Flaw(place, "must be x", "try y"),))) is None
    assert bench.problems == [(6, "robots[1].link", "must be x", "try y")]


def test_a_file_that_does_not_answer_is_reported_at_the_robot_with_the_reason(bench):
    assert bench.requested(ProbeError("it hangs")) is None
    assert bench.problems == [
        (4, "robots[1]", "the adapter 'toy' cannot be used", "plugins/toy.py: it hangs")
    ]


@pytest.mark.parametrize("fields", ["{", '{"name": "REX"}', "{}", '{"name": 5}'])
def test_an_answer_that_is_no_robot_is_reported(bench, fields):
    assert bench.requested(CheckedConfig(fields=fields)) is None
    ((line, path, message, hint),) = bench.problems
    assert (line, path, message) == (4, "robots[1]", "what plugins/toy.py makes of it cannot be read")
    assert hint
