"""Hidden states of an effect along the motion of an axis, stepped sample by sample in machine code."""

from collections.abc import Mapping
from functools import lru_cache
from typing import Any, Final, cast

import casadi as ca
import numpy as np
from numba import njit

from models.compiled.machine_code import Code, addresses, call
from models.effects.effect import Effect, Signals
from models.identification.kind import Array

_SEEN: Final = ("t", "x", "v", "direction", "travelled")


@njit(nogil=True, cache=True, error_model="numpy")
def _run(code: int, work: Array, rows: Array, out: Array) -> None:
    for k in range(rows.shape[0]):
        call(code, work, rows[k])
        for i in range(out.shape[1]):
            out[k, i] = work[i]


@lru_cache(maxsize=64)
def _step(effect: Any, loads: tuple[str, ...]) -> int:
    names, parameters = effect.states, [p.name for p in effect.parameters()]
    z, p = ca.SX.sym("z", len(names)), ca.SX.sym("p", len(parameters))
    seen, own, h = ([ca.SX.sym(name) for name in some] for some in (_SEEN, loads, ("h",)))
    load = own[0] if own else 0.0
    s = Signals(**dict(zip(_SEEN, seen, strict=True)), load=load, loads=dict(zip(loads, own, strict=True)))
    values = {name: p[k] for k, name in enumerate(parameters)}
    new = effect().advance(s, values, {name: z[k] for k, name in enumerate(names)}, *h)
    step = ca.Function("step", [z, p, *seen, *own, *h], [ca.vertcat(*(new[name] for name in names))])
    return addresses([Code(step, {0: 0, 1: len(names)}, (0,))])[0]


def states_along(effect: type[Effect], p: Mapping[str, float], s: Signals) -> dict[str, Array]:
    """The states of `effect` after each row of the signals `s`, by name; they begin at 0."""
    if not effect.states:
        return {}
    n, dt = len(s.t), float(np.median(np.diff(s.t)))
    v = np.diff(s.x, prepend=s.x[:1]) / dt
    seen = [np.broadcast_to(one, n) for one in (s.t, s.x, v, s.direction, s.travelled, *s.loads.values())]
    work = np.concatenate([np.zeros(len(effect.states)), [p[q.name] for q in effect.parameters()], np.zeros(1)])
    out, step = np.empty((n, len(effect.states))), cast(Any, _step)
    _run(step(effect, (*s.loads,)), work, np.column_stack([*seen, np.full(n, dt)]), out)
    return dict(zip(effect.states, out.T, strict=True))
