def test_the_schema_knows_the_adapters_of_the_file(fleet):
    result = fleet("schema")
    assert (result.code, result.err) == (0, "")
    assert "ToyConfig" in result.json["$defs"]


def test_the_schema_is_json_in_any_case(fleet):
    assert fleet("schema", "--json").out == fleet("schema").out


def test_missions_have_a_schema_of_their_own(fleet):
    result = fleet("schema", "--mission")
    assert result.code == 0
    assert {"version", "roles", "steps"} <= set(result.json["required"])
