"""A second Maxwell branch beside the first: what one relaxation time leaves. Refines an effect, never named itself."""

from models.effects.effect import by_name, number
from models.effects.force.stress_relaxation import StressRelaxation


class FurtherRelaxation(StressRelaxation):
    """A second branch that slips, `-k_2 q_2`, `q_2' = v - q_2/tau_2 - c_2 |v| q_2`."""

    id = "further_relaxation"
    words = "a second relaxation time"
    summary = "a second relaxation time"
    source = "generalised Maxwell model: soft tissue relaxes with more than one time (Fung, Biomechanics, ch. 7)"
    grid = by_name(time_s=(0.3,))
    confounders = (StressRelaxation.id,)
    separated_by = "stops of very different length"
    refined_by = ()

    stiffness_N_per_m = number(0.0, "N/m", -100.0, 300.0)
    time_s = number(0.3, "s", 0.02, 20.0)
    slip_per_m = number(100.0, "1/m", 0.0, 2000.0)
    thinning_s_per_m = number(0.0, "s/m", 0.0, 5000.0, fit=False)
