"""The finer shape of a wave's contractions: what its first four harmonics leave. Refines an effect, never named
itself.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

from models.effects.effect import Effect, Signals, Values
from models.effects.force.peristaltic_wave import PeristalticWave, wave_turn
from models.effects.in_time import with_harmonics
from models.parameter import Parameter

_SOURCE = "no law: contractions that begin and end sharply have harmonics that fall with the square of their order"


def _harmonic(name: str) -> Parameter:
    return Parameter(name, 0.0, "1", -0.3, 0.3, _SOURCE, fit=True, spread=0.05)


@dataclass(frozen=True)
class WaveHarmonics(Effect):
    """Force `A (sum of harmonics 5 to 8 of q)` along +x, with A and q of the peristaltic wave."""

    id = "wave_harmonics"
    summary = "the fifth to eighth harmonics of a wave"
    source = _SOURCE
    kinds = PeristalticWave.kinds
    of = PeristalticWave.id
    probe = 0.02
    confounders = ("peristaltic_wave",)
    separated_by = "many contractions at one place"

    fifth_sin: Parameter = _harmonic("fifth_sin")
    fifth_cos: Parameter = _harmonic("fifth_cos")
    sixth_sin: Parameter = _harmonic("sixth_sin")
    sixth_cos: Parameter = _harmonic("sixth_cos")
    seventh_sin: Parameter = _harmonic("seventh_sin")
    seventh_cos: Parameter = _harmonic("seventh_cos")
    eighth_sin: Parameter = _harmonic("eighth_sin")
    eighth_cos: Parameter = _harmonic("eighth_cos")

    def force(self, s: Signals, p: Values, z: Values) -> Any:
        return p["force_N"] * with_harmonics(0.0, wave_turn(s, p), p, 5, ("fifth", "sixth", "seventh", "eighth"))
