"""The magnet's attraction across the lumen presses the capsule on what it lies on."""

from models.effects.effect import Effect, Signals, Value, Values, by_name, number


class MagnetNormalLoad(Effect):
    """Normal load `N_m/(1 + (g/w)^2)^2` on the gap g of carriage and capsule: most where the magnet stands above the
    capsule. For rigs that only know the spring; a rig file with `[rig.magnet]` has the load from both moments.
    """

    id = "magnet_normal_load"
    words = "a magnet that presses on the wall"
    summary = "the magnet presses the capsule on the wall, the more the nearer it is"
    source = "K. W. Yung et al., Magn. Electr. Sep. 9 (1998) 39: two dipoles attract each other across the gap"
    kinds = frozenset({"magnetic"})
    needs = ("both_ways",)
    grid = by_name(width_m=(0.012, 0.03))
    probe = 0.2
    confounders = ("stribeck", "coupling_decay")
    separated_by = "the same motion with the magnet at another height: the load changes, the tissue's friction does not"

    load_N = number(0.0, "N", 0.0, 5.0)
    width_m = number(0.02, "m", 0.003, 0.3)

    def normal_load(self, s: Signals, p: Values, z: Values) -> Value:
        apart = (s.command - s.x) / p["width_m"]
        return p["load_N"] / (1 + apart * apart) ** 2
