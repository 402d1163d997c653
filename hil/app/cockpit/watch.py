"""States of all nodes, refused frames and events, from frames one after the other."""

import math
from collections import deque
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, Final

from hil.app.cockpit.phrases import TEXT, clock, grade_of, words
from hil.bus.catalogue import FrameCatalogue
from hil.bus.codec import NOT_MEASURED_C, Refusal
from hil.bus.load import frame_bits
from hil.bus.protection import Receiver, Reception
from hil.nodes.operator import SETPOINT, STATUS
from hil.nodes.operator_sender import OperatorAnswer, steering_words
from hil.nodes.receive import HEARTBEAT_LOST_S, refusal_cause
from models.words.quantities import DASH, fixed, quantity

KEPT: Final = 200  # Most events kept while a bus is watched, and most kinds of refusals that become an event
SILENT_S: Final = 2 * HEARTBEAT_LOST_S  # A node whose heartbeat is older than this is silent
BURST_S: Final = 0.5  # within which the same refusal is one event
_LOAD_S: Final = 1.0  # over which the bus load is averaged
_FRESH: Final = 10  # cycles, within which a value is current
_LOST: Final = 3  # `Wall` of an estimate that is lost
_BEAT, _FAULT, _FEEDBACK = "Heartbeat", "Fault", "Feedback"


@dataclass(frozen=True)
class Occurrence:
    """One line of the page's list: `grade` is note, good, doubt or bad."""

    time_s: float
    words: str
    grade: str = "note"

    def document(self) -> list[Any]:
        return [round(self.time_s, 3), self.words, self.grade]


class FrameWatch:
    """Takes frames in order of time, in bounded memory, and never raises; `last` are the last good values by frame."""

    def __init__(self, catalogue: FrameCatalogue, kept: int = KEPT) -> None:
        self.catalogue = catalogue
        self.reception = Reception(catalogue.frames.values())
        self.last: dict[str, dict[str, float]] = {}
        self.at: dict[str, float] = {}
        self.events: deque[Occurrence] = deque(maxlen=kept)
        self.count = self.events_count = 0
        self.now = 0.0
        self._setpoint = catalogue[SETPOINT]
        self._setpoints: dict[int, Receiver] = {}
        self._names = {frame.id: frame.name for frame in catalogue.frames.values()}
        self._silent: set[str] = set()
        self._refused: set[tuple[str, str]] = set()
        self._seconds: deque[tuple[float, int, int]] = deque()
        self._open = [0.0, 0, 0]

    def take(self, time_s: float, identifier: int, data: bytes) -> tuple[str, dict[str, float]] | None:
        """The name and values of a good frame, None for one that is refused."""
        self.now = max(self.now, time_s)
        self.count += 1
        self._weigh(time_s, identifier, data)
        if identifier == self._setpoint.id:
            # each source of setpoints has its own counter
            source = self._setpoint.field("Source")
            number = int.from_bytes(data, "little") >> source.start & ((1 << source.length) - 1)
            values = self._setpoints.setdefault(number, Receiver(self._setpoint)).accept(data, time_s)
        else:
            values = self.reception.accept(identifier, data, time_s)
        name = self._names.get(identifier, "")
        if isinstance(values, Refusal):
            self._refuse(time_s, name or hex(identifier), values)
            return None
        before, since = self.last.get(name), time_s - self.at.get(name, -math.inf)
        self.last[name], self.at[name] = values, time_s
        self._report(time_s, name, before, values, since)
        return name, values

    def tick(self, now: float) -> None:
        """Move the time on; nodes that fell silent become events."""
        self.now = max(self.now, now)
        for name, at in self.at.items():
            if name.endswith(_BEAT) and now - at > SILENT_S and name not in self._silent:
                self._silent.add(name)
                ended = self._ended(name)
                key, grade = ("ended", "note") if ended else ("silent", "bad")
                self.say(now, TEXT(f"event.{key}", node=self._sender(name), why=TEXT(f"node.{key}")), grade)

    def say(self, time_s: float, words: str, grade: str = "note") -> None:
        self.events.append(Occurrence(time_s, words, grade))
        self.events_count += 1

    def state(self, name: str, signal: str = "State") -> str:
        """The name of a state, "" where none was received."""
        return self._named(name, signal, self.last[name]) if name in self.last else ""

    def newest(self, name: str) -> dict[str, float] | None:
        """The values of a cyclic frame, where one was received within ten cycles."""
        late = self.now - self.at.get(name, -math.inf) > _FRESH * self.catalogue[name].cycle_s
        return None if late else self.last[name]

    def steering(self) -> OperatorAnswer | None:
        values = self.newest(STATUS)
        if values is None:
            return None
        state, source, refused = (self._named(STATUS, name, values) for name in ("State", "Source", "Refused"))
        return OperatorAnswer(state, source, refused, values["Position_m"], values["Velocity_m_s"])

    def document(self) -> dict[str, Any]:
        return {
            "nodes": self._nodes(),
            "readings": readings(self),
            "model": self._model(),
            "bus": self._bus(),
            "refused": [
                [r.frame.name, refusal_cause(reason), n]
                for r in self._receivers()
                for reason, n in sorted(r.refused.items())
            ],
        }

    def _receivers(self) -> list[Receiver]:
        return [*self.reception.receivers.values(), *self._setpoints.values()]

    def _nodes(self) -> list[dict[str, Any]]:
        found = []
        for name in [n for n in self.at if n.endswith(_BEAT)]:
            node = name.removesuffix(_BEAT)
            silent, feedback = name in self._silent, self.last.get(f"{node}{_FEEDBACK}")
            state = self.state(f"{node}{_FEEDBACK}" if feedback else name)
            warm, code = "", self.state(f"{node}{_FAULT}", "Code")
            if feedback and feedback["Temperature_degC"] != NOT_MEASURED_C:
                warm = f"{fixed(feedback['Temperature_degC'], 0)} °C"
            role = "drive" if feedback else "controller" if node == "Controller" else "sensor"
            gone = "ended" if self._ended(name) else "silent"
            cause = TEXT(f"node.{gone}") if silent else TEXT(f"{role}.{state}")
            if state == "fault" and code and not silent:
                state, cause = f"fault: {code}", TEXT(f"fault.{code}")
            if self.last[name]["Catalogue"] != self.catalogue.fingerprint:
                cause = TEXT("node.another_dbc")
            shown = gone if silent else words(state)
            grade = grade_of(gone if silent else state.partition(":")[0])
            state_now = {"state": shown, "grade": grade, "warm": warm, "why": cause, "role": role}
            found.append({"node": words(node), **state_now, "up": clock(self.last[name]["Uptime_s"])})
        return found

    def _ended(self, heartbeat: str) -> bool:
        """Whether a controller that is silent said before that it ends."""
        return heartbeat == "ControllerHeartbeat" and self.state(heartbeat) in ("stopping", "fault")

    def _model(self) -> dict[str, Any]:
        health, wanted = self.last.get("ModelHealth"), self.last.get("WantedMotion")
        number = int(wanted["Model"]) if wanted else 0
        if health is None:
            return {"state": DASH, "grade": "note", "number": number, "why": TEXT("model.silent"), "facts": []}
        state, old = self.state("ModelHealth"), self.newest("ModelHealth") is None
        facts = [["alarms", TEXT("model.alarms", count=int(health["Alarms"]))]]
        if state in ("doubtful", "broken"):
            facts.insert(0, ["since", TEXT("model.since", time=clock(health["Since_s"]))])
        if state != "not_watched":
            facts.insert(0, ["evidence", TEXT("model.evidence", evidence=health["Evidence"])])
        if change := int(health["Change"]):
            kind = self.catalogue["ModelHealth"].field("Change").names[change]
            facts.insert(0, ["model", TEXT("model.change", change=kind)])
        why = TEXT("model.silent") + f"; {TEXT('model.was', state=words(state))}" if old else TEXT(f"model.{state}")
        return {
            "state": DASH if old else words(state),
            "grade": "note" if old else grade_of(state),
            "number": number,
            "why": why,
            "facts": facts,
        }

    def _bus(self) -> dict[str, Any]:
        span = sum(s for s, _, _ in self._seconds)
        frames, bits = (sum(one[k] for one in self._seconds) for k in (1, 2))
        rate, load = (frames / span, bits / span / self.catalogue.bit_rate) if span else (0.0, 0.0)
        statistics = list(self._receivers())
        return {
            "rate": f"{fixed(rate, 0)} /s",
            "load": f"{fixed(100 * load, 1)} %",
            "good": sum(s.accepted for s in statistics),
            "lost": sum(s.lost for s in statistics),
            "refused": sum(s.refused.total() for s in statistics),
            "unknown": self.reception.unknown.total(),
        }

    def _weigh(self, time_s: float, identifier: int, data: bytes) -> None:
        """Count frames and bits, a tenth of a second at a time, over the last second."""
        part = self._open
        if not 0 <= time_s - part[0] < 0.1:
            if part[1]:
                self._seconds.append((min(max(time_s - part[0], 0.1), 10.0), int(part[1]), int(part[2])))
            while len(self._seconds) > round(_LOAD_S / 0.1):
                self._seconds.popleft()
            self._open = part = [time_s, 0, 0]
        part[1] += 1
        part[2] += frame_bits(identifier, data) if len(data) <= 8 else 0

    def _refuse(self, time_s: float, name: str, refusal: Refusal) -> None:
        """Make the first refusal of each kind an event; the others are only counted."""
        if (name, refusal.reason) not in self._refused and len(self._refused) < KEPT:
            self._refused.add((name, refusal.reason))
            self.say(time_s, TEXT("event.refused", frame=name, why=refusal_cause(refusal.reason)), "doubt")

    def _report(
        self, t: float, name: str, before: Mapping[str, float] | None, values: Mapping[str, float], since: float
    ) -> None:
        sender = self._sender(name)
        if name.endswith(_BEAT) and name in self._silent:
            self._silent.discard(name)
            self.say(t, TEXT("event.heard", node=sender), "good")
        if name.endswith(_FAULT):
            if since > BURST_S or before != values:
                code = self._named(name, "Code", values)
                self.say(t, TEXT("event.fault", node=sender, code=words(code), why=TEXT(f"fault.{code}")), "bad")
        elif name == "SafeStop":
            if since > BURST_S:
                who, reason = (self._named(name, signal, values) for signal in ("Target", "Reason"))
                self.say(t, TEXT("event.safe_stop", target=words(who), why=TEXT(f"stop.{reason}")), "bad")
        elif name == "DriveReset":
            if since > BURST_S:
                self.say(t, TEXT("event.reset", target=words(self._named(name, "Target", values))))
        elif name == "WantedMotion":
            follows = bool(values["Following"])
            if follows != bool(before and before["Following"]):
                self.say(t, TEXT("event.leads" if follows else "event.stops"))
            if before and values["Model"] > before["Model"]:
                self.say(t, TEXT("event.model", number=int(values["Model"]) + 1), "good")
        elif "State" in values and (before is None or before["State"] != values["State"]):
            self._report_state(t, name, sender, before, values)

    def _report_state(
        self, t: float, name: str, sender: str, before: Mapping[str, float] | None, values: Mapping[str, float]
    ) -> None:
        if name == STATUS:
            self.say(t, TEXT("event.steering", state=steering_words(self.steering(), True, "")))
            return
        if name.endswith(_BEAT) and name.removesuffix(_BEAT) + _FEEDBACK in self.catalogue.frames:
            return  # its feedback says more
        state, health = self._named(name, "State", values), name == "ModelHealth"
        drive = name.endswith(_FEEDBACK)
        what = "model" if health else sender if drive else f"node {sender}"
        came = "" if before is None else f"{words(self._named(name, 'State', before))} → "
        change = self._named(name, "Change", values) if values.get("Change") else ""
        how = f" ({change} change)" if change and state in ("doubtful", "broken") else ""
        kind = "model" if health else "drive" if drive else "controller" if sender == "controller" else "sensor"
        grade = grade_of(state)
        how += f": {TEXT(f'{kind}.{state}')}" if grade in ("bad", "doubt") else ""
        self.say(t, f"{what}: {came}{words(state)}{how}", grade)

    def _sender(self, name: str) -> str:
        return words(self.catalogue[name].sender)

    def _named(self, name: str, signal: str, values: Mapping[str, float]) -> str:
        return self.catalogue[name].field(signal).names.get(int(values[signal]), "?")


def readings(watch: FrameWatch) -> dict[str, str]:
    """The large numbers of the page; dashes for what is not known, or not any more."""
    motion, wanted = (watch.newest(name) for name in ("BelievedMotion", "WantedMotion"))
    if motion is None or motion["Wall"] == _LOST:
        position, band = DASH, ""
    else:
        position, band = f"{fixed(1e3 * motion['Position_m'], 2)} mm", f"± {quantity(2 * motion['Std_m'], 'm', 2)} (2σ)"
    if wanted is None or not wanted["Following"]:
        return {"position": position, "band": band, "reference": DASH, "speed": "", "error": DASH}
    off = DASH if position == DASH or motion is None else quantity(motion["Position_m"] - wanted["Position_m"], "m", 2)
    return {
        "position": position,
        "band": band,
        "reference": f"{fixed(1e3 * wanted['Position_m'], 2)} mm",
        "speed": f"{fixed(1e3 * wanted['Velocity_m_s'], 2)} mm/s",
        "error": off,
    }
