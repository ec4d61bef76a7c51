def test_what_was_found_is_reported_with_how_far_it_came(fleet, place):
    (place / "plugins" / "broken.py").write_text("import no_such_library\n")
    result = fleet("adapters")
    assert result.code == 0
    words = " ".join(result.out.split())
    assert "toy loaded velocity, beep [plugins/toy.py]" in words
    assert (
        "broken failed ModuleNotFoundError: No module named 'no_such_library' (plugins/broken.py:1)" in words
    )


def test_programs_learn_what_an_adapter_takes(fleet):
    found = {each["name"]: each for each in fleet("adapters", "--json").json["adapters"]}
    assert found["toy"] == {
        "name": "toy",
        "state": "loaded",
        "origin": "plugins/toy.py",
        "report": "",
        "class": "fleet_plugins.toy:Toy",
        "drives": True,
        "navigates": False,
        "limits": {},
        "commands": [
            {
                "name": "beep",
                "summary": "Sound the horn.",
                "timeout": 10.0,
                "moves": True,
                "parameters": [
                    {
                        "name": "seconds",
                        "type": "number",
                        "default": "1.0",
                        "least": 1,
                        "most": 30,
                        "unit": "s",
                    }
                ],
            }
        ],
    }


def test_one_adapter_is_shown_with_parameters_units_and_help(fleet):
    words = " ".join(fleet("adapters", "toy").out.split())
    assert "toy: loaded [plugins/toy.py]" in words
    assert "beep [seconds=NUMBER] Sound the horn." in words
    assert "seconds number 1 to 30 s 1.0" in words
    assert "may move the robot; given up after 10 s" in words
    assert "\n\nbeep [" in fleet("adapters", "toy").out


def test_an_adapter_that_is_not_there_is_reported_with_the_nearest(fleet):
    result = fleet("adapters", "tou")
    assert result.code == 3
    assert "toy" in result.err


def test_an_adapter_that_is_not_there_is_reported_with_the_ways_to_add_it(fleet):
    result = fleet("adapters", "hexapod")
    assert result.code == 3
    assert "install its package here, or name the folder of its file in plugins" in " ".join(
        result.err.split()
    )


def test_without_a_fleet_file_only_what_is_installed_counts(fleet, place):
    (place / "fleet.yaml").unlink()
    names = [each["name"] for each in fleet("adapters", "--json").json["adapters"]]
    assert "mavlink" in names
    assert "toy" not in names


def test_a_fleet_file_that_is_asked_for_must_be_there(fleet):
    assert fleet("adapters", "-f", "none.yaml").code == 3
