"""The magnets of carriage and capsule: a spring with a range, or their moments."""

import math
from collections.abc import Mapping
from typing import Annotated, Any, Final, Literal

from pydantic import Field

from models.files.toml import shown
from models.laws.dipole import PAIRINGS, Cylinder, Orientation, moment_A_m2, stiffness_N_per_m
from models.rigs.schema import Height, Length, Positive, Remanence, Table, checked, key
from models.words.sentences import Sentences

TEXT: Final = Sentences(__file__)


class Magnet(Table):
    """The magnet's force `k g/(1 + (g/r)^2)^2` on the gap g = carriage - capsule."""

    magnet_stiffness_N_per_m: Positive = key(
        "stiffness k of the magnet's pull `k g/(1 + (g/r)^2)^2` on the gap g between carriage and capsule",
        example="25.0",
    )
    magnet_range_m: Length = key("range r of that pull", example="0.02")


class Magnets(Table):
    """`[rig.magnet]`: the magnet on the carriage (outer) and the capsule's (inner), each by its moment or by size and
    remanence of a cylinder that is magnetised along its axis, and the height across the lumen between their centres.

    Moments lie `across` the lumen, towards each other, or `along` it, opposite. `height_range_m` is where the carriage
    may lift the magnet to, `pressing_limit_N` the most that it may then press the capsule on the tissue.
    """

    purpose = "the magnets by their own numbers, in place of magnet_stiffness_N_per_m and magnet_range_m"
    height_m: Height = key("distance of the two magnets' centres across the lumen", example="0.15")
    moments: Orientation = key(
        "how both moments lie: `across` the lumen, on one axis where the outer magnet stands above the capsule, or"
        " `along` it, opposite to each other",
        "across",
    )
    outer_moment_A_m2: Positive | None = key("moment of the magnet on the carriage; or its size and remanence", None)
    outer_diameter_m: Length | None = key("diameter of that magnet, a cylinder magnetised along its axis", None)
    outer_length_m: Length | None = key("its length", None)
    outer_remanence_T: Remanence | None = key("its remanence", None)
    inner_moment_A_m2: Positive | None = key("moment of the capsule's magnet; or its size and remanence", None)
    inner_diameter_m: Length | None = key("diameter of that magnet", None)
    inner_length_m: Length | None = key("its length", None)
    inner_remanence_T: Remanence | None = key("its remanence", None)
    height_range_m: Annotated[list[Height], Field(min_length=2, max_length=2)] | None = key(
        "lowest and highest height to which the carriage can lift its magnet, where the height is a command too", None
    )
    pressing_limit_N: Positive | None = key("most that the magnet may then press the capsule on the tissue", None)

    def moment(self, side: Literal["outer", "inner"]) -> float:
        """The moment of one magnet in A m^2. Raises ValueError where it is stated neither way or both."""
        moment = getattr(self, f"{side}_moment_A_m2")
        names = [f"{side}_{name}" for name in ("remanence_T", "diameter_m", "length_m")]
        size = [getattr(self, name) for name in names]
        given = [name for name, value in zip(names, size, strict=True) if value is not None]
        if moment is not None and not given:
            return float(moment)
        if moment is None and len(given) == len(names):
            return moment_A_m2(*size)
        got = ", ".join([f"{side}_moment_A_m2"] * (moment is not None) + given) or "neither"
        raise ValueError(TEXT("magnet.moment", side=side, size=", ".join(names), got=got))

    def cylinders(self) -> tuple[Cylinder, Cylinder] | None:
        """Both magnets' sizes; None where one is only known by its moment."""
        sizes = (self.outer_diameter_m, self.outer_length_m, self.inner_diameter_m, self.inner_length_m)
        if any(size is None for size in sizes):
            return None
        return Cylinder(*sizes[:2]), Cylinder(*sizes[2:])  # type: ignore[arg-type]

    def stiffness_N_per_m(self) -> float:
        """Stiffness of the pull at `height_m`."""
        return stiffness_N_per_m(self.moment("outer") * self.moment("inner"), self.height_m, self.moments)

    def check(self) -> None:
        """Raises ValueError of one sentence for numbers that contradict each other."""
        self.stiffness_N_per_m()
        if self.height_range_m is not None:
            low, high = self.height_range_m
            if not low <= self.height_m <= high:
                raise ValueError(TEXT("magnet.heights", height=self.height_m, low=low, high=high))
            if self.pressing_limit_N is None:
                raise ValueError(TEXT("magnet.pressing"))

    def spring(self, stiffness: float | None = None) -> Magnet:
        """The spring of that stiffness (or a measured one) and the gap of greatest pull."""
        return Magnet(
            magnet_stiffness_N_per_m=self.stiffness_N_per_m() if stiffness is None else stiffness,
            magnet_range_m=math.sqrt(3) * PAIRINGS[self.moments].peak * self.height_m,
        )


def read_magnets(content: Any, where: str) -> Magnets:
    """A table `[rig.magnet]`, checked. Raises ValueError of one sentence."""
    if not isinstance(content, Mapping):
        raise ValueError(f"{where}: [rig.magnet] must be a table; got {shown(content)}")
    return checked(where, "rig.magnet", Magnets, content)
