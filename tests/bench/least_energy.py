"""The least-energy cycles of every kind of impact, which the drive map's choices are held against."""

from controller.vibro.cycles import Cycles, Gait, Impact, impact_of
from controller.vibro.drive_map import Alternative
from controller.vibro.optimal_cycle import optimal_cycle
from controller.vibro.waveform import Waveform

_EXACT = 0.02  # share of the speed to which a cycle is brought
_ROUGHLY = 0.25


def optima(cycles: Cycles, speed_m_s: float, guesses: list[Waveform]) -> list[Alternative]:
    """The cheapest least-energy cycle at `speed_m_s` of every kind of impact that comes of `guesses`; which stop one
    strikes is what the optimiser made of it, not what it began with.
    """
    best: dict[Impact, Alternative] = {}
    for guess in guesses:
        optimum = optimal_cycle(cycles, speed_m_s, guess, 6, _ROUGHLY)
        if optimum is None:
            continue
        wave, gait = brought_to(cycles, optimum[0], speed_m_s)
        impact = impact_of(cycles.model, gait)
        if abs(gait.speed_m_s / speed_m_s - 1) < _EXACT and (
            impact not in best or gait.energy_J_per_m < best[impact].gait.energy_J_per_m
        ):
            best[impact] = Alternative(wave, gait, impact, "optimal")
    return list(best.values())


def cheapest(found: list[Alternative]) -> Alternative | None:
    """The choice among `found`: least electrical energy for the way."""
    return min(found, key=lambda one: one.gait.energy_J_per_m, default=None)


def brought_to(cycles: Cycles, wave: Waveform, speed_m_s: float) -> tuple[Waveform, Gait]:
    """`wave` brought within 2 % of `speed_m_s` by its strength, as far as that goes."""
    gait = cycles.gait(wave)
    for _ in range(10):
        ratio = gait.speed_m_s / speed_m_s
        if not 0.2 < ratio < 5 or abs(ratio - 1) < _EXACT:
            break
        wave = wave.scaled(ratio**-0.4)
        gait = cycles.gait(wave)
    return wave, gait
