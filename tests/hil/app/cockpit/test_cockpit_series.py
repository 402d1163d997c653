"""What is drawn: a minute in fixed memory, only what is new, least and largest of each pixel."""

import numpy as np
import pytest

from hil.app.cockpit.panels import Line, panels_of
from hil.app.cockpit.source import BIN_S, HEAD, KEPT_S, LineFeed, Ring, Samples
from hil.bus.catalogue import load_catalogue
from hil.nodes.frame_map import FRAME_MAPS

CATALOGUE = load_catalogue()
LINE = Line("x", "CapsuleLocalisation", "Position_m", "teal")
NAME = LINE.frame


def unpacked(data: bytes, lines: int = 1) -> tuple[int, float, float, np.ndarray]:
    first, count, start, span = HEAD.unpack_from(data)
    return first, start, span, np.frombuffer(data[HEAD.size :], dtype="<f4").reshape(lines, count, 2)


def say(x: float) -> dict[str, dict[str, float]]:
    return {NAME: {"Position_m": x}}


def test_every_kind_of_drive_has_panels_of_frames_that_there_are() -> None:
    for frame_map in FRAME_MAPS.values():
        for panel in panels_of(frame_map, CATALOGUE):
            assert panel.document()["lines"]
            assert all(line.frame in CATALOGUE.frames for line in panel.lines)


def test_a_bin_has_the_least_and_the_largest_and_holds_what_is_fresh() -> None:
    ring = Ring(LineFeed([LINE], CATALOGUE))
    for t, x in ((0.001, 1.0), (0.011, -2.0), (0.021, 3.0)):
        ring.add(t, NAME, say(x))
    ring.close(0.3)
    first, start, span, values = unpacked(ring.since(0))
    assert (first, start, span) == (0, 0.0, BIN_S)
    assert values[0, 0].tolist() == [-2.0, 3.0]
    assert values[0, 1].tolist() == [3.0, 3.0]  # the next one is still to come
    assert np.isnan(values[0, 3]).all()  # five cycles have gone by


def test_only_what_is_new_is_sent() -> None:
    ring = Ring(LineFeed([LINE], CATALOGUE))
    ring.add(0.001, NAME, say(1.0))
    ring.close(1.0)
    assert ring.head == round(1.0 / BIN_S)
    assert len(ring.since(ring.head - 1)) == HEAD.size + 8
    assert len(ring.since(ring.head)) == HEAD.size


@pytest.mark.parametrize("seconds", [KEPT_S + 1.0, 3 * KEPT_S, 1e5])
def test_memory_and_message_are_bounded_however_long_it_lasts(seconds: float) -> None:
    ring = Ring(LineFeed([LINE], CATALOGUE))
    size = ring.bins.nbytes
    ring.add(0.001, NAME, say(1.0))
    ring.close(seconds)
    ring.add(seconds + 0.001, NAME, say(2.0))
    ring.close(seconds + 2 * BIN_S)
    first, _, _, values = unpacked(ring.since(0))
    assert ring.bins.nbytes == size
    assert first == ring.head - round(KEPT_S / BIN_S)
    assert values.shape[1] == round(KEPT_S / BIN_S)
    assert (values[0, -2:] == 2.0).any()


def test_a_window_of_a_log_shows_every_peak() -> None:
    samples = Samples(LineFeed([LINE], CATALOGUE))
    rng = np.random.default_rng(1)
    xs = rng.normal(size=5000)
    xs[3210] = 50.0
    for k, x in enumerate(xs):
        samples.add(0.01 * k, NAME, say(float(x)))
    _, start, span, values = unpacked(samples.window(0.0, 50.0, 100))
    assert (start, span) == (0.0, 0.5)
    assert np.nanmax(values) == 50.0
    blocks = xs.reshape(100, 50).astype("f4")
    assert (values[0, :, 0] <= blocks.min(axis=1) + 1e-6).sum() >= 99  # an edge may round to the other side
    assert (values[0, :, 1] >= blocks.max(axis=1) - 1e-6).sum() >= 99
    assert len(samples.window(0.0, 50.0, 10**9)) < 40_000


def test_a_window_finer_than_the_samples_holds_them_and_ends_where_they_are_old() -> None:
    samples = Samples(LineFeed([LINE], CATALOGUE))
    samples.add(0.0, NAME, say(1.0))
    samples.add(0.01, NAME, say(2.0))
    values = unpacked(samples.window(0.0, 0.2, 200))[3][0]
    assert (values[1:9] == 1.0).all()
    assert (values[12:80] == 2.0).all()
    assert np.isnan(values[120:]).all()
    assert np.isnan(unpacked(samples.window(5.0, 6.0, 10))[3]).all()
