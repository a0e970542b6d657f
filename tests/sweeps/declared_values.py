"""Values that a setting may have, and values that it may not, derived from its kind."""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from sweeps.engine.kinds import Count, Draws, Groups, Kind, Number, SetOf, Switch, Text, Word, shown
from sweeps.engine.settings import Setting
from sweeps.stages.irar import Errors
from sweeps.stages.ships import Ships

DIFFER, EMPTY = "more than once, but values must differ", "is empty, but must hold at least one"
STEPS = "start, stop and step"


def two(kind: Kind) -> tuple[Any, Any]:
    """Two values that are allowed, ascending: the lower bound is one of them."""
    match kind:
        case Count():
            return int(kind.low), int(min(kind.low + 1, kind.high))
        case Number():
            low = kind.low if math.isfinite(kind.low) else 0.0
            high = min(kind.high, kind.below)
            return low, (low + high) / 2 if math.isfinite(high) else low + 1
        case Draws():
            return 1, 2
        case Word():
            first, second = sorted(kind.words)[:2]
            return first, second
        case Switch():
            return False, True
        case Ships():
            return "duncan", "texas"
        case Text():
            return "a", "b"
        case SetOf():
            return two(kind.kind)
    raise AssertionError(f"no values are known of {kind}")


def one(setting: Setting) -> Any:
    """One value that is not the default, as a user writes it."""
    match setting.kind:
        case Errors():
            return {"pointing": 2.5}
        case Groups():
            return [["pulse_width", "frame_count"]]
        case Draws():
            return 3
        case kind:
            return next(value for value in reversed(two(kind)) if value != setting.default)


def ends(kind: Kind) -> list[Any]:
    """Every value at a bound, and every word."""
    match kind:
        case Number() | Count():
            found: list[Any] = [kind.low, kind.high]
            if isinstance(kind, Number) and math.isfinite(kind.below):
                found.append(float(np.nextafter(kind.below, -math.inf)))
            return [value for value in found if math.isfinite(value)] + [None] * kind.null
        case Draws():
            return [1, kind.high]
        case Word():
            return list(kind.words)
        case Switch():
            return [False, True]
        case SetOf():
            members = [[value] for value in ends(kind.kind)] + [word for word, _ in kind.spellings]
            return [*members, *([None] if kind.null else [])]
    return []


def wrong(setting: Setting) -> list[tuple[Any, str, str]]:
    """Values that are refused, with how the sentence shows each, and what it says is allowed."""
    kind = setting.kind
    match kind:
        case SetOf():
            listed = wrong(Setting(kind.kind, None, setting.label, key=setting.key))
            refused = [
                ([value], *said) for value, *said in listed if not isinstance(value, list | dict)
            ]
            refused += [] if kind.null else [(None, "null", kind.kind.allowed)]
            return [*refused, *_lists(two(kind)[0])]
        case Errors():
            return [
                ({"luck": 1}, "luck", "aircraft_speed, "),
                ({"pointing": 31}, "31", "at most 30"),
                ([1], "[1]", kind.allowed),
                ("much", "'much'", kind.allowed),
            ]
        case Groups():
            return [([["a"]], "[['a']]", kind.allowed), (3, "3", kind.allowed)]
        case Draws():
            odd = (0, -1, kind.high + 1, 2.5, True, math.nan, None, "many", [1], {})
            return [(value, shown(value), kind.allowed) for value in odd]
        case Text():
            odd = [7, math.nan, True, {"a": 1}, *([] if kind.null else [None])]
            ships = isinstance(kind, Ships)
            entries = kind.entries if isinstance(kind, Ships) else ()
            found = [({"a": 1}, ".a", "path, name, up, forward, scale, offset")] * bool(entries)
            odd = [value for value in odd if not (entries and isinstance(value, dict))]
            found += [(value, shown(value), kind.allowed) for value in odd]
            return [*found, ("", "''" if ships else "empty", kind.allowed), *_lists(two(kind)[0])]
    refused = [(value, shown(value), kind.allowed) for value in _odd(kind)]
    if isinstance(kind, Number | Count):
        low, high = two(kind)
        ended = {"start": low, "stop": high}
        refused += [
            ({}, "(none)", STEPS),
            (ended, "start, stop", STEPS),
            (ended | {"step": 0}, ".step has 0", "above 0"),
            (ended | {"step": (high - low) / 1e6}, ".step is", "at most 100000 values"),
            ({"start": high, "stop": low, "step": 1}, "runs from", "must not be below start"),
        ]
    return [*refused, *_lists(two(kind)[0])]


def _odd(kind: Kind) -> list[Any]:
    """Values of another type, or out of bounds, alone and in a list."""
    match kind:
        case Number() | Count():
            found: list[Any] = [math.nan, math.inf, -math.inf, "warm", "", True, 10**400]
            found += [float(np.nextafter(value, -math.inf)) for value in _finite(kind.low)]
            found += [float(np.nextafter(value, math.inf)) for value in _finite(kind.high)]
            found += [] if kind.null else [None]
            if isinstance(kind, Number):
                found += _finite(kind.below)
            return found
        case Word():
            return ["nobody", "", kind.words[0].upper(), 1, math.nan, True, None, {"a": 1}]
        case Switch():
            return [0, 1, 2.5, math.nan, "yes", "true", "", None, {}]
    raise AssertionError(f"no wrong values are known of {kind}")


def _finite(bound: float) -> list[float]:
    return [bound] if math.isfinite(bound) else []


def _lists(allowed: Any) -> list[tuple[Any, str, str]]:
    return [([], "", EMPTY), ([allowed, allowed], repr(allowed), DIFFER)]


def override(key: str, value: Any) -> str:
    """A setting as the command line has it."""
    return f"{key}={_text(value)}"


def _text(value: Any) -> str:
    match value:
        case None:
            return "null"
        case bool():
            return str(value).lower()
        case list() | tuple():
            return f"[{','.join(map(_text, value))}]"
        case dict():
            return "{" + ",".join(f"{key}:{_text(one)}" for key, one in value.items()) + "}"
        case float():
            return repr(value)
    return str(value)
