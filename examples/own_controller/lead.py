"""A controller of one's own: the magnet runs ahead of the reference by what the last error asks for."""

from controller.limits import Envelope
from controller.model.control_model import ControlModel
from controller.signals import Action, Controller, Estimate, Reference


class Lead(Controller):
    """`carriage = r(t) + lead + k (r(t) - x)`: a fixed lead against the friction, and a share of the error."""

    name = "lead"
    kinds = ("magnetic",)

    def __init__(self, model: ControlModel, envelope: Envelope) -> None:
        self._gain, self._lead_m = 1.5, 0.2 * envelope.gap_m

    def reset(self, now: float, estimate: Estimate, command: float) -> None:
        """Nothing is remembered."""

    def act(self, now: float, estimate: Estimate, reference: Reference) -> Action:
        """The carriage's position in m for the tick that begins at `now` in s."""
        r, v = float(reference.position(now)), float(reference.speed(now))
        ahead = self._lead_m * (v > 0) - self._lead_m * (v < 0)
        return Action(r + ahead + self._gain * (r - float(estimate.state[0])))
