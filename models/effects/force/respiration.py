"""A force periodic in time, the same everywhere."""

from models.effects.effect import by_name
from models.effects.in_time import ForceInTime, frequencies


class Respiration(ForceInTime):
    """Force `A (sin q + o)` and harmonics of q along +x, `q = 2 pi f t + phi`."""

    id = "respiration"
    words = "a breathing force"
    summary = "a force periodic in time, the same everywhere"
    source = "tracing catalogue 15: 0.2 to 0.3 Hz"
    kinds = frozenset({"pull", "magnetic", "coil", "vibro"})
    needs = ("time", "wall")
    grid = by_name(frequency_Hz=frequencies(0.04, 0.82))
    confounders = ("peristaltic_wave", "mains_hum")
    separated_by = "a second position; a pause of the ventilator"
