"""Merge of two configurations of one robot into one as strict as both, for a robot in motion.

Pure. Only rules that the host enforces change: accepted sources, limits, fence, battery, separation.
"""

from __future__ import annotations

import math

from fleet.config.difference import SETTINGS
from fleet.host.safety.separation import DEFAULT_BRAKING
from fleet.host.safety.source_policy import SourcePolicy
from fleet.model.polygon import Polygon, crosses, polygon_contains
from fleet.robot_config import Accepts, AdapterConfig, BatteryPolicy, FenceConfig, Limits, Separation


def as_strict_as_both(
    old: AdapterConfig, new: AdapterConfig, *, limits: Limits, separation: Separation
) -> AdapterConfig:
    """Return the old configuration with every setting that is stricter in the new one.

    ``limits`` and ``separation`` are the adapter's defaults, for settings that a configuration leaves out.
    """
    return old.model_copy(
        update={
            "accepts": _accepts(old, new),
            "limits": _limits(old.limits.over(limits), new.limits.over(limits)),
            "fence": new.fence if is_within(new.fence, old.fence) else old.fence,
            "battery_policy": _battery(old.battery_policy, new.battery_policy),
            "separation": _separation(old.separation.over(separation), new.separation.over(separation)),
        }
    )


def merge_stricter(
    old: AdapterConfig, new: AdapterConfig, *, limits: Limits, separation: Separation
) -> AdapterConfig:
    """Return the new configuration with every setting that is stricter in the old one."""
    both = as_strict_as_both(old, new, limits=limits, separation=separation)
    return new.model_copy(update={name: getattr(both, name) for name in SETTINGS})


def may_loosen(old: AdapterConfig, new: AdapterConfig) -> bool:
    """Return whether the new configuration may allow more, as far as is known without the adapter.

    Settings that a configuration leaves out are the adapter's own and unknown here.
    """
    unknown = any(
        before is None and after is not None
        for one, other in ((old.limits, new.limits), (old.separation, new.separation))
        for (_, before), (_, after) in zip(one, other, strict=True)
    )
    kept = merge_stricter(old, new, limits=Limits(), separation=Separation())
    return unknown or not is_equally_strict(kept, new, Limits(), Separation())


def is_equally_strict(
    config: AdapterConfig, other: AdapterConfig, limits: Limits, separation: Separation
) -> bool:
    """Return whether the host enforces the same rules under both configurations."""
    one, two = _policy(config), _policy(other)
    return (
        (one.command, one.navigate, one.mission) == (two.command, two.navigate, two.mission)
        and config.limits.over(limits) == other.limits.over(limits)
        and config.fence == other.fence
        and config.battery_policy == other.battery_policy
        and config.separation.over(separation) == other.separation.over(separation)
    )


def _policy(config: AdapterConfig) -> SourcePolicy:
    return SourcePolicy(config.accepts, simulated=config.simulated)


def _accepts(old: AdapterConfig, new: AdapterConfig) -> Accepts:
    """Return the sources that both accept."""
    one, two = _policy(old), _policy(new)
    both = {
        "command": one.command & two.command,
        "navigate": one.navigate & two.navigate,
        "mission": one.mission & two.mission,
    }
    return old.accepts.model_copy(update=both)


def _limits(old: Limits, new: Limits) -> Limits:
    """Return the smaller value of each limit."""
    smaller = {
        name: min((each for each in (value, getattr(new, name)) if each is not None), default=None)
        for name, value in old
    }
    return old.model_copy(update=smaller)


def _separation(old: Separation, new: Separation) -> Separation:
    """Return the larger radius and the weaker braking; precedence stays."""
    return old.model_copy(
        update={
            "radius": max(old.radius or 0.0, new.radius or 0.0) or None,
            "braking": weaker_braking(old.braking, new.braking),
        }
    )


def weaker_braking(old: float | None, new: float | None) -> float | None:
    """Return the smaller deceleration (m/s2); if only one is left out, it counts as the default."""
    if old is None and new is None:
        return None
    return min(old or DEFAULT_BRAKING, new or DEFAULT_BRAKING)


def _battery(old: BatteryPolicy | None, new: BatteryPolicy | None) -> BatteryPolicy | None:
    """Return the policy that keeps the larger reserve and acts earlier."""
    if old is None or new is None:
        return old or new
    endurance = min(old.endurance or math.inf, new.endurance or math.inf)
    return old.model_copy(
        update={
            "reserve": max(old.reserve, new.reserve),
            "low": max(old.low, new.low),
            "endurance": None if endurance == math.inf else endurance,
            "action": new.action if old.action == "warn" else old.action,
        }
    )


def is_within(new: FenceConfig | None, old: FenceConfig | None) -> bool:
    """Return whether the new fence surely allows no position that the old one forbids."""
    if old is None or new == old:
        return True
    if new is None or new.frame != old.frame or new.margin < old.margin:
        return False
    kept = all(any(_inside(each, other) for other in new.exclusion) for each in old.exclusion)
    if not old.inclusion:
        return kept
    narrowed = all(any(_inside(each, other) for other in old.inclusion) for each in new.inclusion)
    return kept and bool(new.inclusion) and narrowed


def _inside(inner: Polygon, outer: Polygon) -> bool:
    """Return whether a polygon equals or lies inside another; touching borders count as crossing."""
    if inner == outer:
        return True
    sides = zip(inner, (*inner[1:], inner[0]), strict=True)
    return all(polygon_contains(outer, corner) for corner in inner) and not any(
        crosses(outer, *side) for side in sides
    )
