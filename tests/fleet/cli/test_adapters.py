def test_what_was_found_is_told_with_how_far_it_came(fleet, place):
    (place / "plugins" / "broken.py").write_text("import no_such_library\n")
    result = fleet("adapters")
    assert result.code == 0
    words = " ".join(result.out.split())
    assert "toy loaded velocity, beep [plugins/toy.py]" in words
    assert (
        "broken failed ModuleNotFoundError: No module named 'no_such_library' (plugins/broken.py:1)" in words
    )


def test_programs_are_told_what_an_adapter_takes(fleet):
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
                "summary": "",
                "timeout": 10.0,
                "safe": False,
                "moves": True,
                "parameters": [],
                "ranges": {},
            }
        ],
    }


def test_without_a_fleet_file_only_what_is_installed_counts(fleet, place):
    (place / "fleet.yaml").unlink()
    names = [each["name"] for each in fleet("adapters", "--json").json["adapters"]]
    assert "mavlink" in names
    assert "toy" not in names


def test_a_fleet_file_that_is_asked_for_must_be_there(fleet):
    assert fleet("adapters", "-f", "none.yaml").code == 3
