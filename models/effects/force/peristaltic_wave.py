"""A force wave that travels along the lumen."""

from models.effects.effect import Signals, Value, Values, by_name, number
from models.effects.in_time import ForceInTime, contraction, frequencies, turn

_SPEED = "contractions that travel at 5 to 20 mm/s, 8.6 to 12.5 a minute"


class PeristalticWave(ForceInTime):
    """Force `A (sin q + o)` and harmonics of q along +x, `q = 2 pi (f t - k x) + phi`; it travels at `f/k`, along +x
    where both have one sign.

    The wave number, unlike the speed, passes smoothly through the wave that stands everywhere at once (k = 0) to one
    that comes back. At less than half of the longest wave's, 8.6 a minute at 20 mm/s, it is a force in time.
    """

    id = "peristaltic_wave"
    words = "a peristaltic wave"
    summary = "a force wave that travels along the lumen"
    source = "Kerlin and Phillips 1982: 8.6 to 12.5 a minute; gut 35:625: 59 to 93 mN"
    kinds = frozenset({"pull", "magnetic", "coil", "vibro"})
    needs = ("time", "wall")
    grid = by_name(frequency_Hz=frequencies(0.04, 0.41), wavenumber_per_m=(6.0, 12.0, 19.0, 26.0, 34.0, 43.0))
    confounders = ("respiration", "fold_periodic")
    separated_by = "a record at rest at two places"
    refined_by = ("wave_harmonics",)

    frequency_Hz = number(0.18, "Hz", 0.03, 0.6)
    wavenumber_per_m = number(18.0, "1/m", -80.0, 80.0, _SPEED, least=3.5)

    def force(self, s: Signals, p: Values, z: Values) -> Value:
        return contraction(wave_turn(s, p), p)


def wave_turn(s: Signals, p: Values) -> Value:
    """The angle in rad of the wave at the capsule's place."""
    return turn(s, p, p["wavenumber_per_m"] * s.x)
