"""Model of the section ``edge`` of fleet.yaml: the computer, its state on disk, and its history."""

from __future__ import annotations

from typing import Annotated

from pydantic import Field

from fleet.robot_config import Name
from fleet.yaml_model import Model, NewPath

Age = Annotated[float, Field(gt=0, le=30 * 86400, allow_inf_nan=False)]


class SpoolAges(Model):
    """Lifetimes of messages that the cloud has not accepted, in seconds; older ones are dropped."""

    reply: Age = Field(60.0, description="Answers to commands.")
    status: Age = Field(86400.0, description="The status of actions.")
    event: Age = Field(86400.0, description="Events and logs.")


class SpoolConfig(Model):
    """State that survives the edge: messages for the cloud, and the state of stops and commands."""

    path: NewPath | None = Field(
        None,
        description="Folder, for this edge alone. Left out: fleet/<edge id> in XDG_STATE_HOME, "
        "else in ~/.local/state.",
    )
    size: int = Field(
        256,
        ge=16,
        le=65536,
        description="Limit in MiB on disk; beyond it the least important and oldest messages are dropped "
        "and counted.",
    )
    ages: SpoolAges = Field(SpoolAges(), description="How long messages are kept, by their kind.")


class HistoryConfig(Model):
    """Limits of the history of requests to the robots, their senders and outcomes."""

    size: int = Field(
        64, ge=4, le=65536, description="Limit in MiB on disk; beyond it the oldest events are deleted."
    )
    days: float = Field(
        90.0,
        gt=0,
        le=3650,
        allow_inf_nan=False,
        description="Days for which events are kept; the newest 1000 always are.",
    )


class EdgeConfig(Model):
    """The computer that this file is for."""

    id: Name = Field(description="The edge's name on the bus; no two edges of a site share it.")
    site: Name | None = Field(None, description="Its site in `fleet top`; edges of one site share it.")
    spool: SpoolConfig = Field(SpoolConfig(), description="State that survives the edge, on its disk.")
    history: HistoryConfig = Field(HistoryConfig(), description="Limits of the history (`fleet history`).")
    realtime: bool = Field(
        False,
        description="Run the event loops of the edge and its workers with real-time priority, before all "
        "normal programs of the computer. It needs permission: `LimitRTPRIO=2`, which `fleet service` sets.",
    )
