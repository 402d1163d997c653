"""Back-EMF of the drive's coil."""

from models.effects.effect import Effect, Signals, Value, Values, number


class BackEmf(Effect):
    """Command `u - K v`: a coil driven by a voltage loses K volt for each m/s (K/R ampere of an asked-for current)."""

    id = "back_emf"
    words = "a back-EMF of the coil"
    summary = "the moving magnet takes voltage from the coil that drives it"
    source = "tracing catalogue 21: i = (u - K v)/R"
    kinds = frozenset({"coil"})
    probe = 0.5
    confounders = ("viscous_drag", "actuator_lag")
    separated_by = "a measured current in place of the voltage: back-EMF goes, drag of the tissue stays"

    loss_s_per_m = number(0.0, "of the command's unit a m/s", 0.0, 60.0, "tracing catalogue 21; 0 to 60 V s/m")

    def command(self, s: Signals, p: Values, z: Values) -> Value:
        return s.command - p["loss_s_per_m"] * s.v
