"""The operator's buttons: which ones count in the present state, and why or why not."""

from dataclasses import dataclass
from typing import Final

from hil.app.cockpit.phrases import TEXT, words
from hil.nodes.operator import OperatorLimits
from hil.nodes.operator_sender import OperatorAnswer, refusal_words, steering_words

RESTS: Final = ("boot", "self_test", "standby", "fault")
"""States of a drive that does not move and is not about to be enabled."""
ENABLES: Final = ("standby", "ready", "enabled", "derated")  # States of a drive that a press may move
ME: Final = "cockpit"  # as a source of setpoints
Button = tuple[bool, str]  # Whether it counts now, and what it would do, or why it does not count and what helps


@dataclass(frozen=True)
class Situation:
    """States of drive and controller by their names in the catalogue, "" where they are not heard; of a run that was
    `started` here: "", "starting", "leading" or "ending"; the controller's `answer` to setpoints; the limits of the
    cockpit's own deployment file, None where it accepts no setpoints; how the last run of this cockpit `ended`.
    """

    node: str
    drive: str
    controller: str
    started: str
    answer: OperatorAnswer | None
    limits: OperatorLimits | None
    ended: str = ""

    def buttons(self) -> dict[str, Button]:
        start, hold = self._start(), self._hold()
        stop = self._stop()
        return {
            "start": start or (True, TEXT("button.start")),
            "reset": start or (True, TEXT("button.reset", node=self.node)),
            "stop": stop or (True, TEXT("button.stop" if self.started else "button.press")),
            "safe": (True, TEXT("button.safe")),
            "arm": self._arm() or (True, TEXT("button.arm")),
            "back": hold or (True, TEXT("button.back")),
            "forth": hold or (True, TEXT("button.forth")),
            "go": hold or (True, TEXT("button.go")),
        }

    def words(self) -> str:
        if self.started in ("starting", "ending") and self.controller != "fault":
            return TEXT(f"run.{self.started}")
        if not self.controller:
            idle = "last" if self.ended else "none"
            led = "unled" if self.drive in ("ready", "enabled", "derated") else idle
            key = "silent" if not self.drive else "fault" if self.drive == "fault" else led
            return TEXT(f"run.{key}", node=self.node, ended=self.ended)
        if self.controller != "running":
            return TEXT("run.stopped" if self.controller == "fault" else "run.not_leading")
        return TEXT("run.ours" if self.started else "run.theirs")

    def steering(self) -> str:
        if off := self._arm():
            return off[1]
        return steering_words(self.answer, True, ME) if self.controller else TEXT("button.no_steering")

    def _start(self) -> Button | None:
        if self.started:
            return False, TEXT("button.ending" if self.started == "ending" else "button.running")
        return (False, TEXT("button.led")) if self.controller else None

    def _stop(self) -> Button | None:
        """None where a controlled stop stops something."""
        if self.started:
            return (False, TEXT("button.ending")) if self.started == "ending" else None
        if not self.controller:
            return False, TEXT("button.nothing")
        if self.drive in RESTS:
            return False, self.rests()
        if self.answer is None or self.limits is None:
            return False, TEXT("button.no_setpoints")
        return (False, TEXT("button.not_leading")) if self.answer.state == "off" else self._not_a_source()

    def _arm(self) -> Button | None:
        return (False, TEXT("button.not_accepted")) if self.limits is None else self._not_a_source()

    def _not_a_source(self) -> Button | None:
        sources = self.limits.sources if self.limits else ()
        return (False, TEXT("button.not_a_source", sources=sources)) if sources and ME not in sources else None

    def _hold(self) -> Button | None:
        """None where a button that is held moves the capsule."""
        if off := self._arm():
            return off
        if self.answer is None or self.answer.state == "off":
            return False, self.steering()
        if self.answer.source not in (ME, "nobody"):
            return False, refusal_words("busy", self.answer.source)
        if not self.drive:
            return False, TEXT("run.silent", node=self.node)
        why = TEXT("button.not_enabled", node=self.node, state=words(self.drive))
        return None if self.drive in ENABLES else (False, why)

    def rests(self) -> str:
        """A sentence that nothing moves, "" where something may."""
        return TEXT("button.rests", node=self.node, state=words(self.drive)) if self.drive in RESTS else ""
