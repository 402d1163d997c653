"""The finer shape of a wave's contractions: what its first four harmonics leave. Never named itself."""

from models.effects.effect import Effect, Signals, Value, Values, number
from models.effects.force.peristaltic_wave import PeristalticWave, wave_turn
from models.effects.in_time import with_harmonics
from models.parameter import Parameter


def _harmonic() -> Parameter:
    return number(0.0, "1", -0.3, 0.3, spread=0.05)


class WaveHarmonics(Effect):
    """Force `A (sum of harmonics 5 to 8 of q)` along +x, with A and q of the peristaltic wave."""

    id = "wave_harmonics"
    words = "higher harmonics of the wave"
    summary = "the fifth to eighth harmonics of a wave"
    source = "no law: contractions that begin and end sharply have harmonics that fall with the square of their order"
    kinds = PeristalticWave.kinds
    of = PeristalticWave.id
    probe = 0.02
    confounders = ("peristaltic_wave",)
    separated_by = "many contractions at one place"

    fifth_sin, fifth_cos, sixth_sin, sixth_cos = (_harmonic() for _ in range(4))
    seventh_sin, seventh_cos, eighth_sin, eighth_cos = (_harmonic() for _ in range(4))

    def force(self, s: Signals, p: Values, z: Values) -> Value:
        return p["force_N"] * with_harmonics(0.0, wave_turn(s, p), p, 5, ("fifth", "sixth", "seventh", "eighth"))
