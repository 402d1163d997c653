"""A second Maxwell branch beside the first: what one relaxation time leaves. Refines an effect, never named itself."""

from __future__ import annotations

from dataclasses import dataclass
from types import MappingProxyType

from models.effects.force.stress_relaxation import StressRelaxation
from models.parameter import Parameter

_SOURCE = "generalised Maxwell model: soft tissue relaxes with more than one time (Fung, Biomechanics, ch. 7)"


@dataclass(frozen=True)
class FurtherRelaxation(StressRelaxation):
    """A second branch that slips, `-k_2 q_2`, `q_2' = v - q_2/tau_2 - c_2 |v| q_2`."""

    id = "further_relaxation"
    summary = "a second relaxation time"
    source = _SOURCE
    grid = MappingProxyType({"time_s": (0.3,)})
    confounders = (StressRelaxation.id,)
    separated_by = "stops of very different length"
    refined_by = ()

    stiffness_N_per_m: Parameter = Parameter("stiffness_N_per_m", 0.0, "N/m", -100.0, 300.0, _SOURCE, fit=True)
    time_s: Parameter = Parameter("time_s", 0.3, "s", 0.02, 20.0, _SOURCE, fit=True)
    slip_per_m: Parameter = Parameter("slip_per_m", 100.0, "1/m", 0.0, 2000.0, _SOURCE, fit=True)
    thinning_s_per_m: Parameter = Parameter("thinning_s_per_m", 0.0, "s/m", 0.0, 5000.0, _SOURCE)
