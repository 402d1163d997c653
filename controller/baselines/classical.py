"""Gains of the PIDs that see the localisation through a kinematic filter, and how quick that filter is.

Coordinate search over k_p, k_i, k_d and the filter together for the least tracking error of a ramp at 1 mm/s, a sine
and steps with rests on a nominal plant, 8 s each, seed 7, noise as everywhere: `python -m tests.bench.bench_classical
magnetic`. The filter of the coil's PID with friction was not searched but taken over from the coil's PID.
"""

from __future__ import annotations

from collections.abc import Mapping
from types import MappingProxyType

from controller.baselines.pid import PidGains

CLASSICAL: Mapping[str, PidGains] = MappingProxyType(
    {"magnetic": PidGains(100.0, 300.0, 1.0), "coil": PidGains(100.0, 300.0, 0.5)}
)
CLASSICAL_FRICTION: Mapping[str, PidGains] = MappingProxyType(
    {"magnetic": PidGains(20.0, 100.0, 2.0), "coil": PidGains(100.0, 300.0, 2.0)}
)
JERKINESS: Mapping[str, Mapping[str, float]] = MappingProxyType(
    {"pid": {"magnetic": 5e-3, "coil": 5e-3}, "pid_friction": {"magnetic": 1e-3, "coil": 5e-3}}
)
"""Of `Kinematics`, in m/s per root s."""
