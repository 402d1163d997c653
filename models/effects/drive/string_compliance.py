"""An elastic link between rig and capsule."""

from models.drives.elastic_link import Link
from models.effects.effect import Effect, Values, number


class StringCompliance(Effect):
    """The rig pulls through `models.drives.elastic_link.Link`; the model makes the capsule a free mass behind it."""

    id = "string_compliance"
    words = "an elastic string"
    summary = "an elastic link between rig and capsule"
    source = "tracing catalogue 29"
    kinds = frozenset({"pull"})
    probe = 0.001
    confounders = ("carriage_backlash", "small_strain_stiffening")
    separated_by = "change the length of the string"

    compliance_m_per_N = number(0.0, "m/N", 0.0, 0.02)
    hardening_per_m = number(100.0, "1/m", 0.0, 2000.0, "threads stiffen as they stretch")
    damping_N_s_per_m = number(0.02, "N s/m", 0.0, 0.3, "loss within the thread")

    def link(self, p: Values) -> Link:
        return Link(*(p[name.name] for name in self.parameters()))
