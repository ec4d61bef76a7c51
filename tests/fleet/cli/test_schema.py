def test_the_schema_knows_the_adapters_of_the_file(fleet):
    result = fleet("schema")
    assert (result.code, result.err) == (0, "")
    assert "ToyConfig" in result.json["$defs"]


def test_the_schema_is_json_in_any_case(fleet):
    assert fleet("schema", "--json").out == fleet("schema").out
