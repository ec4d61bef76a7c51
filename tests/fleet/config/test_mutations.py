"""One mistake anywhere in a good file is told at its own line, and never ends in a traceback."""

import random
import re

import pytest

from fleet.config.load import load
from fleet.config.problems import InvalidConfig
from fleet.plugins.registry import Registry

MUTATIONS = 600
PAIR = re.compile(r"(?P<before>\s*(?:- )?)(?P<key>\w+):(?P<value> .+)?")
FREE_KEYS = ("yard",)  # a group may have any name
REQUIRED = ("name", "twin", "adapter", "link")


def misspelt(lines, number, rng):
    """Change one letter of the key; the problem is on the same line."""
    match = PAIR.fullmatch(lines[number])
    at = rng.randrange(len(match["key"]))
    wrong = match["key"][:at] + rng.choice("qxz") + match["key"][at + 1 :]
    changed = f"{match['before']}{wrong}:{match['value'] or ''}"
    return [*lines[:number], changed, *lines[number + 1 :]], number


def mistyped(lines, number, rng):
    """Put a value of a wrong kind; the problem is on the same line."""
    match = PAIR.fullmatch(lines[number])
    wrong = rng.choice(("{a: {b: 1}}", "[[1, 2]]"))
    changed = f"{match['before']}{match['key']}: {wrong}"
    return [*lines[:number], changed, *lines[number + 1 :]], number


def dropped(lines, number, _):
    """Leave a required key out; the problem is on the first line of its robot."""
    rest = [*lines[:number], *lines[number + 1 :]]
    if lines[number].startswith("  - "):
        rest[number] = "  - " + rest[number].removeprefix("    ")
        return rest, number
    first = max(at for at in range(number) if lines[at].startswith("  - "))
    return rest, first


def mutations(lines):
    """Return every mutation that can be made: the function and the line."""
    pairs = [(number, PAIR.fullmatch(line)) for number, line in enumerate(lines)]
    keyed = [(number, match) for number, match in pairs if match["key"] not in FREE_KEYS]
    return [
        *((misspelt, number) for number, match in keyed),
        *((mistyped, number) for number, match in pairs if match["value"]),
        *((dropped, number) for number, match in keyed if match["key"] in REQUIRED),
    ]


@pytest.fixture
def registry(yard):
    return Registry(yard.installed)


def test_one_mistake_is_reported_at_its_own_line(yard, fleet_text, registry):
    lines = fleet_text.splitlines()
    rng = random.Random(20261121)
    for mutate, number in rng.choices(mutations(lines), k=MUTATIONS):
        mutated, expected = mutate(lines, number, rng)
        yard.write("\n".join(mutated) + "\n")
        with pytest.raises(InvalidConfig) as caught:
            load(yard.file, {}, registry=registry)
        reported = {problem.line for problem in caught.value.problems}
        assert expected + 1 in reported, (mutate.__name__, lines[number], str(caught.value))
        assert len(reported) == 1 or lines[number].startswith(("robots", "  - name", "plugins")), str(
            reported
        )


def test_in_a_partial_load_each_robot_runs_or_is_reported(yard, fleet_text, registry):
    lines = fleet_text.splitlines()
    rng = random.Random(20261122)
    for mutate, number in rng.choices(mutations(lines), k=MUTATIONS // 4):
        yard.write("\n".join(mutate(lines, number, rng)[0]) + "\n")
        try:
            loaded = load(yard.file, {}, registry=registry, partial=True)
        except InvalidConfig:
            continue
        reported = {problem.path.partition(".")[0] for problem in loaded.problems}
        assert len(loaded.robots) + len(reported) == 2


def test_a_token_in_the_file_is_never_shown(yard, fleet_text, registry):
    lines = fleet_text.splitlines()
    rng = random.Random(20261123)
    for mutate, number in rng.choices(mutations(lines), k=MUTATIONS // 4):
        yard.write("\n".join(mutate(lines, number, rng)[0]) + "\n")
        with pytest.raises(InvalidConfig) as caught:
            load(yard.file, {}, registry=registry)
        assert "cw_canary" not in "\n".join([problem.shown() for problem in caught.value.problems])


def test_noise_is_refused_and_never_crashes(yard, fleet_text, registry):
    rng = random.Random(20261124)
    for _ in range(MUTATIONS):
        data = bytearray(fleet_text.encode())
        for _ in range(rng.randint(1, 8)):
            data[rng.randrange(len(data))] = rng.choice(b"{}[]:-!&*?|>%@`\"'#,\t\n\x00\x1b\xff abc109$")
        yard.file.write_bytes(bytes(data))
        try:
            load(yard.file, {}, registry=registry)
        except InvalidConfig as error:
            assert_whole(error)


def assert_whole(error):
    assert error.problems
    assert all(problem.line > 0 and problem.column > 0 for problem in error.problems)
    assert str(error).replace("\n", "").isprintable()
