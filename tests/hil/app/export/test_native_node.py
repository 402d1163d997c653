"""The native node's frames and guard against the Python node's, called in this process."""

import ctypes
import math
import random

import pytest

from controller.drives import envelope_of
from hil.app.export.controller import STANDALONE
from hil.app.export.native_node import knots, node_sources
from hil.app.scenario.deployment import load_deployment
from hil.bus.codec import Refusal
from hil.bus.protection import Receiver, Sender, crc8
from hil.nodes.frame_map import answer_of, frames
from hil.nodes.guard import Evidence, Fence, Passed, passed
from tests.hil.app.export.tools import compiled, tool
from tests.places import ROOT

DEPLOYMENT = ROOT / "examples" / "deployment" / "deployment.toml"
VERDICTS = ("accepted", "length", "crc", "counter", "repeated", "range")
REASONS = ("", "controller late", "feedback lost", "drive not enabled", "localisation lost")
IN_RANGE = ctypes.CFUNCTYPE(ctypes.c_int, ctypes.POINTER(ctypes.c_uint8))
ALWAYS = IN_RANGE(lambda data: 1)


class FrameReceiver(ctypes.Structure):
    _fields_ = (
        *((name, ctypes.c_uint8) for name in ("data_id",)),
        *((name, ctypes.c_double) for name in ("cycle_s", "stamp_s")),
        *((name, ctypes.c_int) for name in ("counter", "candidate", "row")),
    )


class FrameSender(ctypes.Structure):
    _fields_ = (("data_id", ctypes.c_uint8), ("counter", ctypes.c_uint8))


class CarriageCommand(ctypes.Structure):
    _fields_ = (
        *((name, ctypes.c_uint8) for name in ("crc", "counter")),
        ("position_m", ctypes.c_int32),
        ("velocity_m_s", ctypes.c_int16),
        *((name, ctypes.c_uint8) for name in ("time_to_live_ms", "mode")),
    )


class CFence(ctypes.Structure):
    _fields_ = (
        *((name, ctypes.c_double) for name in ("low", "high", "rate")),
        ("rests", ctypes.c_int),
        *((name, ctypes.c_double) for name in ("tick_s", "feedback_s", "braking", "derate_s", "stop_s")),
        *((name, ctypes.c_double) for name in ("first_share", "growth")),
    )

    @classmethod
    def of(cls, fence: Fence) -> "CFence":
        return cls(*(getattr(fence, name) for name, _ in cls._fields_))


class CEvidence(ctypes.Structure):
    _fields_ = (("localisation_s", ctypes.c_double), ("feedback_s", ctypes.c_double), ("state", ctypes.c_int))


class CPassed(ctypes.Structure):
    _fields_ = (
        *((name, ctypes.c_double) for name in ("value", "rate")),
        *((name, ctypes.c_int) for name in ("mode", "missed", "reason")),
    )


@pytest.fixture(scope="module")
def native(tmp_path_factory: pytest.TempPathFactory) -> ctypes.CDLL:
    folder = tmp_path_factory.mktemp("node")
    deployment = load_deployment(DEPLOYMENT)
    envelope = envelope_of(deployment.believed(deployment.values).drive, deployment.limits)
    for name, text in node_sources(deployment, envelope).items():
        (folder / name).write_text(text)
    node = STANDALONE / "node"
    sources = [folder / "frames.c", node / "protection.c", node / "guard.c"]
    found = compiled(tool("cc"), folder / "node.so", sources, folder, node)
    found.crc8.restype = ctypes.c_uint8
    found.answer_of.restype = ctypes.c_uint32
    found.guarded.restype, found.fence_after.restype = CPassed, CFence
    found.guarded.argtypes = [ctypes.c_double, ctypes.c_int, CEvidence, CPassed, ctypes.c_double, CFence]
    found.fence_after.argtypes = [CFence, ctypes.c_double]
    encode = found.frames_carriage_command_position_m_encode, found.frames_carriage_command_velocity_m_s_encode
    for one, made in zip(encode, (ctypes.c_int32, ctypes.c_int16), strict=True):
        one.argtypes, one.restype = [ctypes.c_double], made
    return found


def test_crc_and_answer(native: ctypes.CDLL) -> None:
    draw = random.Random(1)
    for _ in range(500):
        data, number = draw.randbytes(7), draw.getrandbits(32)
        assert native.crc8(data, 7, ctypes.c_uint8(data[0])) == crc8(data, data[0])
        assert native.answer_of(ctypes.c_uint32(number), ctypes.c_uint8(1)) == answer_of(number, 1)


def test_command_frames_are_the_same_bytes(native: ctypes.CDLL) -> None:
    draw, frame = random.Random(2), frames()["CarriageCommand"]
    here, there, data = Sender(frame), FrameSender(frame.data_id, 0), (ctypes.c_uint8 * 8)()
    for _ in range(500):
        position_m, speed, life, mode = draw.uniform(-1.1, 1.1), draw.uniform(-0.4, 0.4), draw.randint(1, 100), 2
        m = CarriageCommand(0, 0, native.frames_carriage_command_position_m_encode(position_m))
        m.velocity_m_s = native.frames_carriage_command_velocity_m_s_encode(speed)
        m.time_to_live_ms, m.mode = life, mode
        native.frames_carriage_command_pack(data, ctypes.byref(m), 8)
        native.protect(ctypes.byref(there), data)
        values = {"Position_m": position_m, "Velocity_m_s": speed, "TimeToLive_ms": life, "Mode": mode}
        assert bytes(data) == here.frame(values)


@pytest.mark.parametrize("name", ["CarriageFeedback", "CarriageFault", "CarriageHeartbeat"])
def test_received_frames_are_judged_the_same(name: str, native: ctypes.CDLL) -> None:
    """Frames that are lost, repeated, corrupted, cut short and late, in random order."""
    draw, frame = random.Random(3), frames()[name]
    sender, here, there = Sender(frame), Receiver(frame), FrameReceiver()
    native.receiver_init(ctypes.byref(there), ctypes.c_uint8(frame.data_id), ctypes.c_double(frame.cycle_s))
    values, now, last, found = {f.name: float(f.lower) for f in frame.fields}, 0.0, b"", set()
    for _ in range(5000):
        now += draw.choice([0.5, 1.0, 1.0, 1.0, 2.0, 8.0]) * (frame.cycle_s or 0.01)
        sender.skip(draw.choice([0, 0, 0, 0, 1, 5]))
        data = last if last and draw.random() < 0.05 else sender.frame(values)
        last = data
        if draw.random() < 0.05:
            data = bytes([*data[:5], data[5] ^ draw.randint(1, 255), *data[6:]])
        data = data[:7] if draw.random() < 0.02 else data
        judged = native.receive(ctypes.byref(there), data, len(data), ctypes.c_double(now), ALWAYS)
        expected = here.accept(data, now)
        found.add(VERDICTS[judged])
        assert VERDICTS[judged] == (expected.reason if isinstance(expected, Refusal) else "accepted")
    assert found >= {"accepted", "length", "crc", "repeated"}


@pytest.mark.parametrize("rests", [True, False])
def test_guard_passes_the_same(rests: bool, native: ctypes.CDLL) -> None:
    draw = random.Random(4)
    rate = 0.25 if rests else math.inf
    basis = Fence(-1.0, 1.0, rate, rests, 2e-3, 0.0215, 25.0 if rests else math.inf, first_share=0.08, growth=1.0)
    reasons, before, native_before = set(), Passed(0.0, 0.0, 0), CPassed()
    for _ in range(20_000):
        wanted = draw.choice([math.nan, math.inf, *(before.value + draw.gauss(0, 1e-3) for _ in range(20)), 2.0])
        mode, since_s = draw.choice([0, 1, 2, 2, 2, 2, 2, 2, 2, 2]), draw.choice([0.0, 0.3, 2.0, math.inf])
        age_s = draw.choice([0.0, 0.01, 0.04, 0.06, 0.06, 0.16, math.inf, -0.1]) if draw.random() < 0.3 else 0.01
        seen = age_s, draw.choice([0.001] * 20 + [0.03]), draw.choice([4, 4, 4, 4, 4, 3, 5, 2])
        dt = draw.choice([2e-3, 2e-3, 0.0, 0.1])
        fence = basis.after(since_s)
        here = passed(wanted, mode, Evidence(*seen), before, dt, fence)
        there_fence = native.fence_after(CFence.of(basis), since_s)
        there = native.guarded(wanted, mode, CEvidence(*seen), native_before, dt, there_fence)
        assert (there.value, there.rate, there.mode, there.missed) == (here.value, here.rate, here.mode, here.missed)
        if here.mode == 3:
            assert REASONS[there.reason] == here.reason
            reasons.add(here.reason)
        before, native_before = here, there
    assert reasons == set(REASONS[1:])


def test_reference_is_straight_between_its_knots() -> None:
    reference = load_deployment(DEPLOYMENT).reference
    times_s, places_m = knots(reference)
    assert len(times_s) < reference.positions.size / 10
    grid = [1e-3 * k for k in range(reference.positions.size)]
    import numpy as np

    np.testing.assert_allclose(np.interp(grid, times_s, places_m), reference.positions, rtol=0, atol=1e-10)
