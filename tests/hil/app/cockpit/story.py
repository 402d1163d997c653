"""What a bus says while a carriage is led: the drive comes up, the capsule moves, the model breaks, frames are bad."""

import math
from collections.abc import Iterator
from typing import Final

from hil.bus.catalogue import load_catalogue
from hil.bus.protection import Sender
from hil.log.blf_file import RECEIVED, SENT, Logged
from hil.nodes.frame_map import ENABLE, ENABLED, STANDBY, WAITING

CATALOGUE: Final = load_catalogue()
UP_S: Final = 0.3
"""When the drive is enabled and the controller leads."""
BREAKS_S: Final = 2.0
"""When the monitor calls the model broken."""
SPEED_M_S: Final = 2e-3
_SENT: Final = ("Controller",)
_MS: Final = 1_000_000


def wanted(t: float) -> float:
    """The reference in m."""
    return SPEED_M_S * max(t - UP_S, 0.0)


def story(seconds: float, *, bad: bool = True) -> list[Logged]:
    """The frames of so many seconds; with `bad` one localisation a second is spoilt on the way."""
    senders = {name: Sender(frame) for name, frame in CATALOGUE.frames.items()}
    found: list[Logged] = []
    for ms in range(round(1e3 * seconds)):
        for name, values in said(ms):
            data = bytearray(senders[name].frame(values))
            if bad and name == "CapsuleLocalisation" and ms % 1000 == 500:
                data[3] ^= 0x10
            way = SENT if CATALOGUE[name].sender in _SENT else RECEIVED
            found.append(Logged(ms * _MS, CATALOGUE[name].id, bytes(data), way))
    return found


def said(ms: int) -> Iterator[tuple[str, dict[str, float]]]:
    """Who says what in a millisecond."""
    t, leads = 1e-3 * ms, 1e-3 * ms >= UP_S
    x, state = wanted(t) + 2e-4 * math.sin(4 * t), ENABLED if leads else WAITING if t > 0.1 else STANDBY
    if ms % 2 == 0:
        yield "Sync", {"Tick": ms // 2, "Period_s": 2e-3}
        drive = {"Position_m": x + 3e-3, "Velocity_m_s": SPEED_M_S if leads else 0.0}
        yield "CarriageFeedback", {**drive, "State": state, "Temperature_degC": 25}
        yield "CarriageCommand", {**drive, "TimeToLive_ms": 18, "Mode": ENABLE if leads else 1}
    if ms % 10 == 0:
        noise = 3e-4 * math.sin(91.0 * t)
        yield "CapsuleLocalisation", {"Position_m": x + noise, "Quality": 1.0, "Age_s": 0.002, "Valid": 1}
    if ms % 20 == 0:
        beat = {"Uptime_s": t, "Catalogue": CATALOGUE.fingerprint}
        yield "ControllerHeartbeat", {**beat, "State": 2 if leads else 1}
        yield "CarriageHeartbeat", {**beat, "State": 2}
        yield "LocaliserHeartbeat", {**beat, "State": 2}
    if ms % 40 == 0:
        slips = math.sin(9 * t) > 0
        surprise = 1.2 * math.sin(37 * t) + (1.5 if t > BREAKS_S else 0.0)
        yield "BelievedMotion", {"Position_m": x, "Std_m": 1.2e-4, "Wall": float(slips), "Surprise": surprise}
        pull = 0.06 + 0.02 * math.sin(9 * t)
        yield "BelievedForces", {"Drive_N": pull, "Wall_N": pull - 0.004, "Lacking_N": -0.004}
        following = {"Position_m": wanted(t), "Velocity_m_s": SPEED_M_S, "Following": float(leads)}
        yield "WantedMotion", {**following, "Model": 0}
    if ms % 100 == 0:
        broken, evidence = t >= BREAKS_S, min(0.6 * t / BREAKS_S + (0.5 if t > 0.9 * BREAKS_S else 0.0), 2.0)
        health = {"State": 2 if broken else 0, "Change": float(broken), "Since_s": BREAKS_S if broken else 0.0}
        yield "ModelHealth", {**health, "Evidence": evidence, "Alarms": float(broken)}
