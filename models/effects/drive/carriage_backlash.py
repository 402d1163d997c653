"""Play in the drive."""

import numpy as np

from models.effects.effect import Effect, Signals, Value, Values, by_name, number

_SMALLEST = 1e-4  # sharpness, below which the share differs from its limit by less than that


class CarriageBacklash(Effect):
    """Backlash as a Duhem operator: of a change `dc` of the command the carriage follows `dc (e^(k q^n) - 1)/(e^k -
    1)`, `q` from 0 to 1 how far it is through the play `b` in the direction of `dc`. A large `k` is the loose nut,
    which does not move before `q = 1`; a small one an elastic seat that gives way gradually, from its begin on (`n =
    1`) or late: at `k = 0` it is `dc q^n`.
    """

    id = "carriage_backlash"
    words = "a drive with backlash"
    summary = "play in the drive"
    source = "tracing catalogue 18; backlash-like hysteresis, Su et al., IEEE TAC 45 (2000) 2427"
    kinds = frozenset({"pull", "magnetic"})
    needs = ("reversals",)
    states = ("position_m",)
    follows = by_name(position_m="command")
    grid = by_name(sharpness=(3.0, 30.0), order=(1.2,))
    probe = 0.0003
    confounders = ("directional_asymmetry", "actuator_lag", "sensor_delay")
    separated_by = "reversals at several amplitudes"

    play_m = number(0.0, "m", 0.0, 0.008, "tracing catalogue 18")
    sharpness = number(10.0, "1", 0.0, 60.0, "from an elastic seat to a loose nut")
    order = number(1.0, "1", 1.0, 4.0, "a seat that stiffens", spread=1.0)

    def command(self, s: Signals, p: Values, z: Values) -> Value:
        return z["position_m"]

    def advance(self, s: Signals, p: Values, z: Values, h: Value) -> dict[str, Value]:
        half, change, k = p["play_m"] / 2, s.rate * h, np.maximum(p["sharpness"], _SMALLEST)
        ahead = (s.command - 0.5 * change - z["position_m"]) * np.sign(change)
        through = np.clip(0.5 + 0.5 * ahead / np.maximum(half, 1e-9), 0.0, 1.0)
        share = (np.exp(k * through ** p["order"]) - 1) / (np.exp(k) - 1)
        return {"position_m": np.clip(z["position_m"] + change * share, s.command - half, s.command + half)}
