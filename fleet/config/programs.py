"""What fleet.yaml says of the programs beside an edge: the console and the recorder."""

from __future__ import annotations

from pydantic import Field

from fleet.yaml_model import Model, NewPath


class ConsoleConfig(Model):
    """The console, a web page with the fleet, as a process beside the edge. It listens on loopback alone."""

    port: int = Field(8480, ge=0, le=65535, description="0 takes any that is free.")


class RecordConfig(Model):
    """A recorder as a process beside the edge: what the robots report and are told, in MCAP files."""

    folder: NewPath | None = Field(
        None,
        description="For this recorder alone; nobody else may read it. Left out: recordings, beside the "
        "spool of the edge.",
    )
    size: int = Field(2048, ge=16, le=1_048_576, description="Most MiB; beyond it the oldest is deleted.")
    hours: float = Field(24.0, gt=0, le=87_600, allow_inf_nan=False, description="How long files are kept.")
    free: int = Field(
        512,
        ge=0,
        le=1_048_576,
        description="MiB of the disk that stay free for others: with less nothing is recorded.",
    )
