"""``fleet schema``: the JSON Schema of fleet.yaml, for completion and checking in editors."""

from __future__ import annotations

import json

import click

from fleet.cli.adapters import file_option, registry_of
from fleet.config.json_schema import json_schema


@click.command()
@file_option
@click.option("--json", "as_json", is_flag=True, help="It is JSON in any case.")
def schema(file: str | None, as_json: bool) -> None:  # noqa: ARG001, FBT001 - every command takes --json
    """Print the JSON Schema of fleet.yaml for editors.

    It knows every adapter that is installed and, with -f, those of the file's drop-in folders. Save it
    beside fleet.yaml and begin that file with:

    # yaml-language-server: $schema=fleet.schema.json
    """
    click.echo(json.dumps(json_schema(registry_of(file)), indent=2))
