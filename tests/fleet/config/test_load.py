import pytest

from fleet.config.load import load, registry_for
from fleet.config.problems import InvalidConfig
from fleet.errors import ConfigError
from fleet.plugins.registry import Registry

ROBOT = "{name: a, twin: 6f0c9a1e-8d2b-4c57-9a39-2f4a1d0b7c11, adapter: toy, link: x}"


def small(robot=ROBOT, more=""):
    return f"edge: {{id: e}}\nplugins: [plugins]\n{more}robots:\n  - {robot}\n"


def test_a_whole_file_becomes_a_fleet(yard, fleet_text):
    loaded = yard.load(fleet_text)
    assert [(robot.name, plugin.name) for robot, plugin in loaded.robots] == [
        ("kestrel", "toy"),
        ("rex", "toy"),
    ]
    assert loaded.config.robots == tuple(robot for robot, _ in loaded.robots)
    assert loaded.config.groups == {"yard": ("kestrel", "rex")}
    assert loaded.config.cloud.token.get_secret_value() == "cw_canary"
    assert loaded.problems == ()


def test_a_fleet_needs_no_cloud(yard):
    assert yard.load(small()).config.cloud is None


def test_an_adapter_for_the_version_before_of_the_api_is_one_warning_for_all_its_robots(
    yard, fleet_text, monkeypatch
):
    monkeypatch.setattr("fleet.plugins.drop_in_file.ADAPTER_API", 2)
    loaded = yard.load(fleet_text)
    found = [str(each) for each in loaded.warnings if "version 1 of the adapter API" in str(each)]
    assert [line.replace(f"{yard.folder}/", "").partition(" was")[0] for line in found] == [
        "fleet.yaml:18:14: robots[0].adapter: Toy"
    ]


def test_defaults_stand_under_each_robot_and_its_own_words_win(yard, fleet_text):
    rex = yard.load(fleet_text).config.robots[1]
    assert (rex.limits.speed, rex.limits.altitude) == (5.0, 60.0)
    slower = yard.load(fleet_text.replace("altitude: 60", "speed: 1")).config.robots[1]
    assert slower.limits.speed == 1.0


def test_all_problems_are_reported_at_once_with_their_places(yard):
    assert yard.problems("""\
        edge: {id: Yard}
        cloud: {host: m, port: 99999, tsl: true}
        plugins: [plugins]
        defaults: {limits: {speed: 5 m/s}}
        robots:
          - name: a
            twin: 6f0c9a1e-8d2b-4c57-9a39-2f4a1d0b7c11
            adapter: toy
            lnk: udp:x
            armed: yes
            pace: fsat
          - name: b
            twin: none
            adapter: toyy
            link: ${NOPE}
        groups: {all: [a, bb]}
        """) == [
        (
            "fleet.yaml:1:12: edge.id: must be lower-case letters, digits, - and _, beginning with a letter "
            "(The edge's name on the bus; no two edges of a site share it.)"
        ),
        "fleet.yaml:2:24: cloud.port: must be at most 65535 (Left out: CYBERWAVE_MQTT_PORT, else 8883.)",
        "fleet.yaml:2:31: cloud.tsl: unknown key (did you mean 'tls'?)",
        "fleet.yaml:4:28: defaults.limits.speed: must be a number (write the number alone, without 'm/s')",
        "fleet.yaml:9:5: robots[0].lnk: unknown key (did you mean 'link'?)",
        "fleet.yaml:10:12: robots[0].armed: must be true or false (did you mean true?)",
        "fleet.yaml:11:11: robots[0].pace: must be 'slow' or 'fast' (did you mean 'fast'?)",
        (
            "fleet.yaml:13:11: robots[1].twin: must be a uuid "
            "(like 6f0c9a1e-8d2b-4c57-9a39-2f4a1d0b7c11; the twin's page in the cloud shows it)"
        ),
        "fleet.yaml:14:14: robots[1].adapter: there is no adapter 'toyy' (did you mean 'toy'?)",
        (
            "fleet.yaml:15:11: robots[1].link: the environment variable NOPE is not set "
            "(set it, or give a default: ${NOPE:-value})"
        ),
        "fleet.yaml:16:19: groups.all[1]: there is no robot 'bb' (did you mean 'b'?)",
    ]


def test_a_problem_is_shown_with_its_line_and_a_caret(yard):
    with pytest.raises(ConfigError) as caught:
        yard.load(small(more="bus: {mode: peeer}\n"))
    assert caught.value.problems[0].shown() == (
        f"{yard.file}:3:13: bus.mode: must be 'peer', 'client' or 'router'\n"
        "    bus: {mode: peeer}\n"
        "                ^\n"
        "    did you mean 'peer'?"
    )


@pytest.mark.parametrize(
    ("wrong", "expected"),
    [
        ("adaptr: toy", "robots[0].adaptr: unknown key (did you mean 'adapter'?)"),
        ("worker: w", "robots[0]: the key 'adapter' is missing (known adapters: toy)"),
        (
            "adapter: 7",
            (
                "robots[0].adapter: there is no adapter 7 (known adapters: toy; for another, "
                "install its package here or name the folder of its file in plugins)"
            ),
        ),
    ],
)
def test_a_robot_without_a_usable_adapter_is_reported(yard, wrong, expected):
    assert expected in yard.problems(small(ROBOT.replace("adapter: toy", wrong)))[0]


@pytest.mark.parametrize(
    ("robots", "expected"),
    [
        ("robots: []", "1:25: robots: must not be empty"),
        ("robots: 7", "1:25: robots: must be a list"),
        ("robots: [7]", "1:26: robots[0]: must be a mapping of  key: value"),
        ("robotz: []", "1:17: robotz: unknown key (did you mean 'robots'?)"),
        ("", "1:1: the key 'robots' is missing"),
    ],
)
def test_robots_that_are_no_list_are_reported(yard, robots, expected):
    assert yard.problems(f"{{edge: {{id: e}}, {robots}}}")[0].startswith(f"fleet.yaml:{expected}")


def test_a_missing_item_of_a_list_is_reported_by_its_number(yard):
    problem = yard.problems(small(ROBOT.replace("adapter: toy", "adapter: toy, start: [0, 0]")))[0]
    assert "robots[0].start: item 3 of the list is missing" in problem


@pytest.mark.parametrize(
    ("second", "expected"),
    [
        ("name: a, twin: 0b7e7a52-3c1d-4f08-8f6e-5d2a9c4b1e73, link: y", "5:12: robots[1].name: {} name"),
        ("name: b, twin: 6F0C9A1E-8d2b-4c57-9a39-2f4a1d0b7c11, link: y", "5:21: robots[1].twin: {} twin"),
        (
            "name: b, twin: 0b7e7a52-3c1d-4f08-8f6e-5d2a9c4b1e73, link: x",
            "5:65: robots[1].link: {} way to the robot",
        ),
    ],
)
def test_two_robots_cannot_be_one(yard, second, expected):
    (problem,) = yard.problems(small() + f"  - {{{second}, adapter: toy}}\n")
    same = f"robots[0] ({yard.file}:4) has the same".replace(f"{yard.folder}/", "")
    assert problem.startswith(f"fleet.yaml:{expected.format(same)} (give each robot a ")


def test_a_part_of_a_list_that_is_wrong_is_reported_with_what_the_list_is_for(yard):
    problems = yard.problems(
        small(ROBOT.replace("adapter: toy", "adapter: toy, fence: {inclusion: [[[0, 1]]]}"))
    )
    assert any("inclusion[0]: must have at least 3 entries (Polygons" in problem for problem in problems)
    assert all("[[[0, 0]," in problem for problem in problems)


@pytest.mark.parametrize(
    ("given", "expected"),
    [
        ("start: [1, 2, 90]", "robots[0].start: the heading counts in radians: 90 is more than a turn"),
        ("start: [0, 0, 0], origin: {latitude: 1, longitude: 2}", "robots[0].start: origin places the robot"),
        ("start: [0, 0]", "robots[0].start"),
        ("start: [.nan, 0, 0]", "robots[0].start[0]"),
        ("separation: {radius: 0}", "robots[0].separation.radius"),
        ("separation: {radios: 1}", "robots[0].separation.radios: unknown key (did you mean 'radius'?)"),
    ],
)
def test_a_place_or_a_separation_that_is_none_is_reported_where_it_stands(yard, given, expected):
    (problem,) = yard.problems(small(ROBOT.replace("adapter: toy", f"adapter: toy, {given}")))
    assert expected in problem


@pytest.mark.parametrize("origin", ["[47.4, 8.5]", "[8.5, 190, 400]", "[95, 8.5, 400]", "here"])
def test_a_sites_origin_that_is_no_place_is_reported_where_it_stands(yard, origin):
    problems = yard.problems(small(more=f"site: {{origin: {origin}}}\n"))
    assert all("site.origin" in problem for problem in problems)
    assert problems


def test_a_site_and_a_start_are_taken(yard):
    robot = ROBOT.replace("adapter: toy", "adapter: toy, start: [1, -2, 1.57], separation: {radius: 2}")
    loaded = yard.load(small(robot, more="site: {origin: [47.4, 8.5, 488]}\n"))
    ((config, _),) = loaded.robots
    assert loaded.config.site.origin == (47.4, 8.5, 488.0)
    assert (config.start, config.separation.radius) == ((1.0, -2.0, 1.57), 2.0)


def test_a_merge_key_is_reported_with_what_does_the_same(yard):
    merged = "x-base: &base {adapter: toy}\n" + small(ROBOT.replace("adapter: toy", "<<: *base"))
    (problem,) = yard.problems(merged)
    assert "robots[0].<<: << merges nothing" in problem
    assert "defaults:" in problem


def test_a_group_cannot_be_called_like_a_robot_or_name_one_twice(yard):
    assert yard.problems(small(more="groups: {a: [a, a]}\n")) == [
        "fleet.yaml:3:10: groups.a: a robot has this name too (rename the group)",
        "fleet.yaml:3:17: groups.a[1]: 'a' is in the group already",
    ]


def test_keys_that_begin_with_x_are_left_alone(yard):
    assert yard.load(small(more="x-notes: {any: [thing]}\n")).robots


def test_a_wrong_default_is_reported_once_for_all_robots(yard):
    text = small(more="defaults: {limits: {spede: 1}}\n")
    text += "  - {name: b, twin: 0b7e7a52-3c1d-4f08-8f6e-5d2a9c4b1e73, adapter: toy, link: y}\n"
    assert yard.problems(text) == [
        "fleet.yaml:3:21: defaults.limits.spede: unknown key (did you mean 'speed'?)"
    ]


def test_a_partial_load_runs_the_robots_that_can_run(yard):
    text = small(more="groups: {yard: [a, b, c]}\n") + (
        "  - {name: b, twin: 0b7e7a52-3c1d-4f08-8f6e-5d2a9c4b1e73, adapter: gone}\n"
        "  - {name: c, twin: 1b7e7a52-3c1d-4f08-8f6e-5d2a9c4b1e73, adapter: toy, link: !secret none}\n"
    )
    loaded = yard.load(text, partial=True)
    assert [robot.name for robot, _ in loaded.robots] == ["a"]
    assert loaded.config.groups == {"yard": ("a",)}
    assert [problem.path for problem in loaded.problems] == ["robots[1].adapter", "robots[2].link"]


@pytest.mark.parametrize("more", ["bus: {mode: peeer}\n", "groups: {g: [nobody]}\n", "colud: {}\n"])
def test_what_is_wrong_outside_the_robots_is_fatal_to_a_partial_load_too(yard, more):
    assert len(yard.problems(small(more=more), partial=True)) == 1


def test_a_partial_load_with_no_robot_left_fails(yard):
    assert len(yard.problems(small(ROBOT.replace("toy", "gone")), partial=True)) == 1


def test_a_broken_adapter_is_reported_at_the_robot_with_the_reason(yard):
    yard.write("import no_such_library\n", "plugins/gone.py")
    (problem,) = yard.problems(small(ROBOT.replace("toy", "gone")))
    assert "the adapter 'gone' cannot be used" in problem
    assert "No module named 'no_such_library' (plugins/gone.py:1)" in problem


def test_an_unknown_adapter_may_be_in_a_file_that_failed(yard):
    yard.write("1 / 0\n", "plugins/rovers.py")
    (problem,) = yard.problems(small(ROBOT.replace("toy", "wheely")))
    assert problem.endswith(
        "there is no adapter 'wheely' (known adapters: toy; for another, "
        "install its package here or name the folder of its file in plugins; "
        "plugins/rovers.py failed: ZeroDivisionError: division by zero (plugins/rovers.py:1))"
    )


def test_a_validator_that_crashes_is_a_problem_of_its_robot(yard):
    yard.drop_in()
    toy = (yard.folder / "plugins" / "toy.py").read_text()
    yard.write(toy.replace('return f"{self.link}#{self.system_id}"', "raise KeyError(1)"), "plugins/toy.py")
    assert yard.problems(small()) == [
        "fleet.yaml:4:5: robots[0]: the adapter 'toy' failed to check it (KeyError: 1)"
    ]


def test_a_missing_file_is_reported_with_what_to_do(yard):
    (problem,) = yard.problems()
    assert problem.startswith("fleet.yaml:1:1: cannot read fleet.yaml: No such file or directory")
    assert problem.endswith("(fleet init writes an example)")


@pytest.mark.parametrize("text", ["", "# nothing\n", "[]", "text"])
def test_a_file_that_is_no_mapping_is_reported(yard, text):
    assert yard.problems(text)[0].endswith("(fleet init writes an example)")


def test_two_hundred_robots_load(yard):
    robots = "".join(
        f"  - {{name: r{n}, twin: 6f0c9a1e-8d2b-4c57-9a39-{n:012x}, adapter: toy, link: 'udp:{n}'}}\n"
        for n in range(199)
    )
    assert len(yard.load(small() + robots).robots) == 200


def test_a_drop_in_file_is_read_and_reported_as_an_installed_adapter(yard, fleet_text):
    problems = yard.problems(fleet_text.replace("pace: fast", "pace: fsat"))
    yard.drop_in()
    assert yard.problems() == problems
    assert [plugin.name for _, plugin in yard.load(fleet_text).robots] == ["toy", "toy"]


@pytest.mark.parametrize(
    ("given", "lease"), [("", 2.0), (", setpoint_lease: 0.5", 0.5), (", setpoint_lease: 1", 1)]
)
def test_a_drop_in_file_may_have_other_defaults_than_the_host(yard, given, lease):
    yard.drop_in()
    toy = (yard.folder / "plugins" / "toy.py").read_text()
    yard.write(
        toy.replace("    link: str", "    setpoint_lease: float = 2.0\n    link: str"), "plugins/toy.py"
    )
    ((config, _),) = yard.load(small(ROBOT.replace("adapter: toy", f"adapter: toy{given}"))).robots
    assert config.setpoint_lease == lease


def test_what_robots_do_not_say_is_shared_by_those_of_a_drop_in_file(yard):
    yard.drop_in()
    second = (
        ROBOT.replace("4a1d0b7c11", "4a1d0b7c12").replace("name: a", "name: b").replace("link: x", "link: y")
    )
    (one, _), (other, _) = yard.load(f"{small()}  - {second}\n").robots
    assert one.limits is other.limits
    assert one.separation is other.separation


def test_adapters_are_found_though_the_file_is_wrong(yard):
    yard.drop_in()
    yard.write("plugins: [plugins]\nnonsense: 1\n")
    assert registry_for(yard.file, {}, Registry([])).names() == ("toy",)


def test_a_name_that_an_adapters_own_check_does_not_know_has_a_hint(tmp_path):
    (tmp_path / "fleet.yaml").write_text(
        "edge: {id: e}\nrobots:\n  - {name: a, twin: 6f0c9a1e-8d2b-4c57-9a39-2f4a1d0b7c11, adapter: ugv, "
        "profile: waveshare-beest, link: 'sim:waveshare-beast'}\n"
    )
    with pytest.raises(InvalidConfig) as caught:
        load(tmp_path / "fleet.yaml")
    (problem,) = caught.value.problems
    assert problem.hint == "did you mean 'waveshare-beast'?"


A, B = "6f0c9a1e-8d2b-4c57-9a39-2f4a1d0b7c11", "6f0c9a1e-8d2b-4c57-9a39-2f4a1d0b7c12"
LED = "adapter: toy, accepts: {command: [tele, edge_leader]}"


def followers(yard, first, second):
    """Return the problems of two robots, each named with what it says besides."""
    return yard.problems(
        "edge: {id: e}\nplugins: [plugins]\nrobots:\n"
        f"  - {{name: a, twin: {A}, {LED}, {first}}}\n  - {{name: b, twin: {B}, {LED}, {second}}}\n"
    )


@pytest.mark.parametrize(
    ("first", "second", "says"),
    [
        (f"link: x, follows: {B}", f"link: y, follows: {A}", "follows another robot itself"),
        (f"link: x, follows: {B}", "link: 'sim:toy'", "b is simulated"),
    ],
)
def test_robots_that_would_lead_each_other_or_a_real_one_from_a_simulation_are_refused(
    yard, first, second, says
):
    assert any(says in problem for problem in followers(yard, first, second))


GROUPED = (
    "groups: {yard: {robots: [a], limits: {speed: 1.5, altitude: 20}, accepts: {command: [tele, sim]}}}\n"
)


def test_what_a_group_says_stands_under_its_robots_and_their_own_words_win(yard):
    more = "defaults: {limits: {speed: 9, distance: 50}}\n" + GROUPED
    ((config, _),) = yard.load(small(more=more)).robots
    assert (config.limits.speed, config.limits.altitude, config.limits.distance) == (1.5, 20.0, 50.0)
    assert config.accepts.command == {"tele", "sim"}
    own = ROBOT.replace("adapter: toy", "adapter: toy, limits: {speed: 3}")
    ((config, _),) = yard.load(small(own, more=more)).robots
    assert (config.limits.speed, config.limits.altitude) == (3.0, 20.0)


def test_a_group_of_either_form_has_the_same_members(yard):
    assert yard.load(small(more=GROUPED)).config.members == {"yard": ("a",)}
    assert yard.load(small(more="groups: {yard: [a]}\n")).config.members == {"yard": ("a",)}


def test_two_groups_that_contradict_each_other_are_reported_unless_the_robot_says_it_itself(yard):
    more = "groups:\n  one: {robots: [a], limits: {speed: 1}}\n  two: {robots: [a], limits: {speed: 2}}\n"
    (problem,) = yard.problems(small(more=more))
    assert "fleet.yaml:5:8: groups.two: another group of a says something else" in problem
    own = ROBOT.replace("adapter: toy", "adapter: toy, limits: {speed: 3}")
    ((config, _),) = yard.load(small(own, more=more)).robots
    assert config.limits.speed == 3.0


@pytest.mark.parametrize(
    ("group", "expected"),
    [
        ("{robots: [a], limits: {sped: 1}}", "groups.y.limits.sped: unknown key (did you mean 'speed'?)"),
        ("{limits: {speed: 1}}", "groups.y: the key 'robots' is missing"),
        ("{robots: [b]}", "groups.y.robots[0]: there is no robot 'b'"),
        ("{robots: [a, a]}", "groups.y.robots[1]: 'a' is in the group already"),
        ("{robots: [a], fence: {}}", "groups.y.fence: unknown key"),
        ("a", "groups.y: must be a list"),
    ],
)
def test_what_is_wrong_with_a_group_is_reported_where_it_stands(yard, group, expected):
    assert any(expected in problem for problem in yard.problems(small(more=f"groups: {{y: {group}}}\n")))
