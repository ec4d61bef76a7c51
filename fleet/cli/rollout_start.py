"""``fleet apply --fleet``: begin a roll-out of bundles, and drive it."""

from __future__ import annotations

import asyncio
import functools
import secrets
import time
from collections.abc import Callable, Mapping
from pathlib import Path

import click
import msgspec

from fleet.cli.output import ExitCode, Output
from fleet.client.local_user import local_user


class RolloutOptions(msgspec.Struct, frozen=True):
    """The options of a roll-out."""

    waves: str
    stop_if: str
    parallel: int
    within: float
    settle: float
    store: Path


def with_waves(function: Callable[..., object]) -> Callable[..., object]:
    """Add the options of a roll-out to a command, as the argument ``wanted``."""

    @click.option(
        "--waves", default="1,10%,100%", show_default=True, help="With --fleet: edges of each wave."
    )
    @click.option(
        "--stop-if",
        default="failed > 0",
        show_default=True,
        help="With --fleet: when to stop, as 'failed > 2%' of the edges started so far, or 'failed > 3'.",
    )
    @click.option(
        "--parallel",
        default=20,
        show_default=True,
        type=click.IntRange(1, 10_000),
        help="With --fleet: limit of edges that change at a time.",
    )
    @click.option(
        "--within",
        default=3600.0,
        show_default=True,
        type=click.FloatRange(1.0, 604_800.0),
        help="With --fleet: seconds after which an edge that is not done has failed.",
    )
    @click.option(
        "--settle",
        default=30.0,
        show_default=True,
        type=click.FloatRange(0.0, 600.0),
        help="With --fleet: seconds after which no robot or service of an edge may be worse than before.",
    )
    @click.option(
        "--store",
        "store_file",
        type=click.Path(dir_okay=False, path_type=Path),
        default="rollout.yaml",
        show_default=True,
        help="With --fleet: the file with the address of the store.",
    )
    @functools.wraps(function)
    def command(
        *args: object,
        waves: str,
        stop_if: str,
        parallel: int,
        within: float,
        settle: float,
        store_file: Path,
        **options: object,
    ) -> object:
        wanted = RolloutOptions(waves, stop_if, parallel, within, settle, store_file)
        return function(*args, wanted=wanted, **options)

    return command


def roll_out(out: Output, files: tuple[str, ...], wanted: RolloutOptions) -> ExitCode:
    """Roll bundles out to their edges."""
    from fleet.cli.bundle import read_bundle  # noqa: PLC0415 - not needed for one edge
    from fleet.rollout.bundle import Bundle, BundleError, verify_bundle  # noqa: PLC0415
    from fleet.rollout.settings import read_settings  # noqa: PLC0415
    from fleet.rollout.waves import limit_of, wave_ends  # noqa: PLC0415

    if not files:
        raise click.UsageError("--fleet needs the bundles to roll out; make one with: fleet bundle make")
    settings = read_settings(wanted.store)
    if not settings.trust:
        raise click.ClickException(f"{wanted.store}: add  trust: [KEY.pub], by which bundles are checked")
    data: dict[str, bytes] = {}
    edges: dict[str, tuple[str, Bundle]] = {}
    for file in files:
        content = read_bundle(Path(file))
        address, bundle = verify_bundle(content, settings.trusted())
        data[address] = content
        for edge in bundle.edges:
            if edge in edges:
                raise BundleError(f"two bundles are for edge {edge}; give one of them")
            edges[edge] = (address, bundle)
    wave_ends(wanted.waves, len(edges))
    limit_of(wanted.stop_if)
    targets = {edge: (address, bundle.version) for edge, (address, bundle) in sorted(edges.items())}
    return asyncio.run(_run(out, wanted, targets, data))


async def _run(
    out: Output, wanted: RolloutOptions, targets: Mapping[str, tuple[str, int]], data: Mapping[str, bytes]
) -> ExitCode:
    """Store the bundles, begin the roll-out, and drive it."""
    from fleet.cli.rollout import drive, store_of  # noqa: PLC0415 - its package is an extra
    from fleet.clock import SystemClock  # noqa: PLC0415
    from fleet.rollout.driver import Driver  # noqa: PLC0415
    from fleet.rollout.messages import EdgeTarget, Rollout  # noqa: PLC0415
    from fleet.rollout.waves import RolloutProgress  # noqa: PLC0415

    store = store_of(wanted.store)
    try:
        await store.prepare()
        parts = {address: await store.put_bundle(address, content) for address, content in data.items()}
        rollout = Rollout(
            secrets.token_hex(4),
            local_user(),
            time.time(),
            wanted.waves,
            wanted.stop_if,
            wanted.parallel,
            wanted.within,
            wanted.settle,
            {
                edge: EdgeTarget(address, parts[address], version)
                for edge, (address, version) in targets.items()
            },
            RolloutProgress(),
        )
        await Driver(store, clock=SystemClock()).begin(rollout)
        return await drive(out, store)
    finally:
        await store.close()
