"""The force of an axis along its motion, at several parameter sets side by side, stepped row by row in machine code."""

from collections.abc import Sequence
from dataclasses import replace
from functools import lru_cache
from typing import Any, Final, cast

import casadi as ca
import numpy as np
from numba import njit

from models.assembly.effects import Active
from models.compiled.machine_code import Code, addresses, call
from models.effects.effect import Effect, Signals
from models.identification.kind import Array
from models.identification.kinds.axis.zero_phase import AxisMotion
from models.parameter import Name

LANES: Final = 8
_SEEN: Final = ("t", "x", "v", "direction", "travelled")


def rows_of(m: AxisMotion, s: Signals) -> Array:
    """What every row of a motion tells a model (n, 8 and one a logged input): acceleration in m/s2, speed in m/s since
    the row before, the interval in s, and the signals.
    """
    n, dt = len(s.t), float(np.median(np.diff(s.t)))
    own = (m.a, np.diff(s.x, prepend=s.x[:1]) / dt, dt, *(getattr(s, name) for name in _SEEN), *s.loads.values())
    return np.column_stack([np.broadcast_to(one, n) for one in own])


def force_along(effects: Sequence[type[Effect]], loads: Sequence[str], values: Array, rows: Array) -> Array:
    """Force in N (n, P) that the motion `rows` (n, k) with logged inputs named `loads` needs, at P <= `LANES` sets of
    `values` (P, q): the base's four numbers and those of the `effects`, whose hidden states begin at 0.
    """
    code, states = cast(Any, _program)(tuple(effects), tuple(loads))
    work = np.zeros((states + values.shape[1] + 1, LANES))
    work[states:-1] = np.concatenate([values, np.repeat(values[-1:], LANES - len(values), axis=0)]).T
    out = np.empty((len(rows), len(values)))
    _run(code, work.ravel(), rows, out)
    return out


@njit(nogil=True, cache=True, error_model="numpy")
def _run(code: int, work: Array, rows: Array, out: Array) -> None:
    last = work.size - LANES
    for k in range(rows.shape[0]):
        call(code, work, rows[k])
        for lane in range(out.shape[1]):
            out[k, lane] = work[last + lane]


@lru_cache(maxsize=256)
def _program(effects: tuple[type[Effect], ...], loads: tuple[str, ...]) -> tuple[int, int]:
    """Address of the machine code of a row, and the number of hidden states."""
    named = [(e.id, name) for e in effects for name in e.states]
    known = [(e.id, p.name) for e in effects for p in e.parameters()]
    z, base, own = (ca.SX.sym(name, size) for name, size in (("z", len(named)), ("b", 4), ("p", len(known))))
    a, speed, h, *seen = (ca.SX.sym(name) for name in ("a", "speed", "h", *_SEEN))
    logged = [ca.SX.sym(name) for name in loads]
    s = Signals(
        **dict(zip(_SEEN, seen, strict=True)),
        load=logged[0] if logged else 0.0,
        loads=dict(zip(loads, logged, strict=True)),
    )
    acting = Active.of(effects, _by_name(known, own), _by_name(named, z)).advance(replace(s, v=speed), h)
    dry, viscous, _ = acting.levels(s)
    friction = base[1] * s.v * viscous + base[2] * acting.passed("direction", s) * dry
    force = acting.through("measured", s, base[0] * a + friction + base[3] - acting.total("force", s))
    after = ca.vertcat(*(acting.z[name] for name in named))
    step = ca.Function("row", [z, base, own, a, speed, h, *seen, *logged], [force, ca.SX(after)])
    first, last = len(named), len(named) + 4 + len(known)
    return addresses([Code(step, {0: 0, 1: first, 2: first + 4}, (last, 0))], LANES)[0], first


def _by_name(names: Sequence[Name], values: ca.SX) -> dict[Name, Any]:
    return {name: values[k] for k, name in enumerate(names)}
