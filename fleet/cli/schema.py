"""``fleet schema``: the JSON Schema of fleet.yaml and of missions, for completion and checks in editors."""

from __future__ import annotations

import json

import click

from fleet.cli.adapters import file_option, registry_of
from fleet.config.json_schema import json_schema, mission_file_schema


@click.command()
@file_option
@click.option("--mission", is_flag=True, help="Of a file with one mission.")
@click.option("--json", "as_json", is_flag=True, help="It is JSON in any case.")
def schema(file: str | None, *, mission: bool, as_json: bool) -> None:  # noqa: ARG001 - every command takes --json
    """Print the JSON Schema of fleet.yaml for editors.

    It contains every installed adapter and, with -f, those of the file's drop-in folders. Save it beside
    fleet.yaml and begin that file with:

    # yaml-language-server: $schema=fleet.schema.json

    With --mission it is the schema of a mission file.
    """
    found = mission_file_schema() if mission else json_schema(registry_of(file))
    click.echo(json.dumps(found, indent=2))
