"""Contradictions between the sections of a fleet file, each reported at its place."""

from types import SimpleNamespace

import pytest

from fleet.config import checks
from fleet.config.checks import check_bus, check_consoles, check_names, check_workers

# -- names --------------------------------------------------------------------------------------------

ORIGIN = "site: {origin: [latitude, longitude, altitude]}"
UUID = "6f0c9a1e-8d2b-4c57-9a39-2f4a1d0b7c11"
BASE = "robots: [{name: rex}, {name: kes}]\ngroups: {yard: [rex]}\nmissions: {patrol: {}}\n"


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        ("stop_inputs: [{name: a}, {name: a}]", ["stop_inputs[1].name: another stop input has this name"]),
        ("stop_inputs: [{}, {}, {name: b, robots: [rex, yard]}, 3]", []),
        ("stop_inputs: [{name: [x]}, {name: {a: 1}, robots: [1]}]", []),
        (
            "stop_inputs: [{robots: [rx]}]",
            ["stop_inputs[0].robots[0]: there is no robot or group 'rx' (did you mean 'rex'?)"],
        ),
        ("notify: [{robots: [rex, yard]}, 3]", []),
        (
            "notify: [{robots: [yrd]}]",
            ["notify[0].robots[0]: there is no robot or group 'yrd' (did you mean 'yard'?)"],
        ),
        ("schedules: {s: {mission: patrol, on_event: {robots: [rex]}}, t: 3}", []),
        (
            "schedules: {s: {mission: patol}}",
            ["schedules.s.mission: there is no mission 'patol' (did you mean 'patrol'?)"],
        ),
        (
            "schedules: {s: {on_event: {robots: [yard]}}}",
            ["schedules.s.on_event.robots[0]: there is no robot 'yard'"],
        ),
        ("cloud: {workflows: {u: {mission: patrol}, v: 3}}", []),
        (f"cloud: {{workflows: {{{UUID}: 1, v: 2}}}}", []),
        (
            f"cloud: {{workflows: {{{UUID}: 1, {UUID.replace('-', '').upper()}: 2}}}}",
            [f"cloud.workflows.{UUID.replace('-', '').upper()}: another workflow has this uuid"],
        ),
        ("cloud: {workflows: {u: {mission: x}}}", ["cloud.workflows.u.mission: there is no mission 'x'"]),
        ("partners: {barn: {robots: [max]}, hall: 3}\nedge: {id: e}", []),
        ("partners: {barn: {}}\nedge: {id: barn}", ["partners.barn: this is the edge of this file"]),
        (
            "partners: {b: {robots: [rex]}, c: {robots: [max, max]}}",
            [
                "partners.b.robots[0]: there is another robot 'rex' (missions go by their names)",
                "partners.c.robots[1]: there is another robot 'max' (missions go by their names)",
            ],
        ),
        ("console: {map: x}\nsite: {origin: [1, 2, 3]}", []),
        ("console: {port: 1}", []),
        (
            "console: {map: x}",
            [f"console.map: the site's position on this map is unknown ({ORIGIN})"],
        ),
    ],
)
def test_names_that_refer_to_nothing_are_reported_where_they_stand(reading, text, expected):
    document = reading(f"{BASE}{text}\n")
    check_names(document.data, document)
    assert [str(each).partition(": ")[2] for each in document.problems] == expected


@pytest.mark.parametrize(
    "section", ["stop_inputs", "notify", "schedules", "partners", "console", "cloud", "robots"]
)
@pytest.mark.parametrize("value", ["5", "[5]", "{a: 5}", "null", "[[a]]", "[{robots: {a: 1}, name: null}]"])
def test_a_section_that_is_something_else_is_left_to_the_schema(reading, section, value):
    document = reading(f"{section}: {value}\n" if section == "robots" else f"{BASE}{section}: {value}\n")
    check_names(document.data, document)
    assert document.problems == []


# -- the bus ------------------------------------------------------------------------------------------


def bus(
    listen=(),
    connect=(),
    *,
    password=None,
    tls=None,
    insecure=False,
    access=None,
    scouting=False,
    consoles=(),
):
    return SimpleNamespace(
        listen=listen,
        connect=connect,
        password=password,
        tls=tls,
        insecure=insecure,
        access=access,
        scouting=scouting,
        consoles=consoles,
    )


TEXT = "bus:\n  listen: [a,\n    b]\n  connect: [c]\n  tls: {}\n  scouting: true\n"


def test_each_endpoint_is_judged_by_itself_at_its_place(reading):
    document = reading(TEXT)
    check_bus(bus(("unixsock-stream//nowhere/x", "tcp/10.0.0.1:1"), ("tcp/h:1",)), document)
    assert [(each.line, each.path) for each in document.problems] == [
        (3, "bus.listen[1]"),
        (4, "bus.connect[0]"),
    ]
    assert document.warnings == []


def test_a_password_on_the_open_network_is_taken_with_a_warning(reading):
    document = reading(TEXT)
    check_bus(bus(("tcp/10.0.0.1:1",), password="x"), document)
    assert document.problems == []
    assert [each.path for each in document.warnings] == ["bus.listen[0]"]
    check_bus(bus(("tcp/10.0.0.1:1",), password="x", insecure=True), document)
    assert len(document.warnings) == 1


@pytest.mark.parametrize(("mode", "refused"), [(0o777, True), (0o1777, True), (0o775, False), (0o700, False)])
def test_a_socket_in_a_folder_of_all_users_is_refused(reading, tmp_path, mode, refused):
    folder = tmp_path / "sockets"
    folder.mkdir()
    folder.chmod(mode)
    for field in ("listen", "connect"):
        document = reading(TEXT)
        check_bus(bus(**{field: (f"unixsock-stream/{folder}/s",)}), document)
        assert [each.path for each in document.problems] == [f"bus.{field}[0]"] * refused


def test_a_listening_socket_has_a_shorter_path_for_its_second_session(reading):
    end = f"unixsock-stream//{'x' * 99}"
    document = reading(TEXT)
    check_bus(bus(connect=(end,)), document)
    assert document.problems == []
    check_bus(bus(listen=(end,)), document)
    assert "that of a Unix socket may have 99 here" in document.problems[0].message


def test_certificates_without_access_are_warned_of(reading):
    tls = SimpleNamespace(mutual=True)
    for listen, access, warned in ((("tls/h:1",), None, 1), (("tls/h:1",), {}, 0), ((), None, 0)):
        document = reading(TEXT)
        check_bus(bus(listen, tls=tls, access=access), document)
        assert (document.problems, len(document.warnings)) == ([], warned)
    check_bus(bus(("tls/h:1",), tls=SimpleNamespace(mutual=False), access={}), document)
    assert [each.path for each in document.problems] == ["bus.listen[0]"]


def test_scouting_without_proof_is_refused(reading):
    document = reading(TEXT)
    check_bus(bus(scouting=True), document)
    assert [(each.line, each.path) for each in document.problems] == [(6, "bus.scouting")]
    check_bus(bus(scouting=True, insecure=True), document)
    assert len(document.problems) == 1


def test_limits_of_an_unknown_console_and_access_of_an_unknown_worker_are_reported(reading):
    document = reading(
        "bus:\n  consoles: {desk: {}, dsk: {}, wall: {}}\n  access: {arms: worker, amrs: worker}\n"
    )
    access = {"desk": "console", "arms": "worker", "amrs": "worker", "hub": "router"}
    sections = SimpleNamespace(
        bus=bus(access=access, consoles=("desk", "dsk", "wall")), remote_workers={"arms": 1}
    )
    check_consoles(sections, document)
    check_workers(sections, document)
    assert [str(each).partition(": ")[2] for each in document.problems] == [
        "bus.consoles.dsk: 'dsk' is no console in bus.access (did you mean 'desk'?)",
        "bus.consoles.wall: 'wall' is no console in bus.access (access: gives it the role console)",
        "bus.access.amrs: 'amrs' is not in remote_workers (did you mean 'arms'?)",
    ]


def test_a_folder_that_is_not_there_is_not_shared():
    assert not checks._is_shared("/no/such/folder")
    assert not checks._is_shared("")
