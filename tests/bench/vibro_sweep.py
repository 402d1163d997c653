"""Mean speed of vibro drives on the gut over drive frequency, held against paper A's claim about the wall's 0.05 s.

`python -m tests.bench.vibro_sweep DIR` sweeps 24 drives (a quarter of a minute), prints for which the claim holds,
and draws all into DIR.
"""

import argparse
from dataclasses import asdict, dataclass
from itertools import product
from pathlib import Path
from typing import Any, Final

import numpy as np
import plotly.graph_objects as go
from plotly.subplots import make_subplots

from hil.app.console import json_text
from hil.report.builder import page
from hil.report.theme import INK, styled
from models.laws.geometry import Capsule
from plant import layout as at
from plant.drives import TrueVibro
from plant.experiments.profile import pulse_width
from plant.rig import STEP_S, Plant, Truth
from plant.tables import Floats

CLAIM: Final = "A Section 5.3: a vibrating drive hardly moves the capsule unless its period is below the wall's 0.05 s"
WALL_HZ: Final = 20.0
FREQUENCIES_HZ: Final = (
    2.0, 3.0, 4.0, 6.0, 8.0, 10.0, 12.5, 15.0, 18.0, 20.0, 22.0, 25.0, 28.0, 32.0, 36.0, 40.0, 50.0, 60.0,
)  # fmt: skip
HARDLY_M_S: Final = 0.5e-3  # below: it does not move to speak of
SLOW_SHARE: Final = 0.2  # the claim holds when slow drives reach less than this share of the fast ones' speed
_SETTLE_S, _MEASURE_S, _EVERY = 1.0, 3.0, 10
_BODY: Final = Capsule(mass_kg=1.67e-3)
_COLOURS: Final = {True: "#0072b2", False: "#d55e00"}


@dataclass(frozen=True)
class SweepDrive:
    """One vibro drive: 1.8 g inner mass, force pulses of 30 % duty; `front_stop` at 1.6 mm."""

    force_N: float
    spring_N_per_m: float
    on_board: bool
    front_stop: bool

    @property
    def name(self) -> str:
        """A short label."""
        drive, stop = "on board" if self.on_board else "field", "front stop" if self.front_stop else "no stop"
        return f"{self.force_N * 1e3:.0f} mN, {self.spring_N_per_m:.0f} N/m, {drive}, {stop}"

    def rig(self) -> Truth:
        """The drive in a 1.67 g shell of the default capsule's size on the gut."""
        stiffness = 27.9e3 if self.front_stop else 0.0
        vibro = TrueVibro(1.8e-3, self.spring_N_per_m, 0.0156, self.force_N, self.on_board, 1.6e-3, stiffness)
        return Truth(vibro, capsule=_BODY)


def sweep_drives() -> list[SweepDrive]:
    """On board from weak to strong, and weak ones from outside; soft and stiff springs, with and without a stop."""
    on_board = product((0.06, 0.12, 0.25, 0.5), (62.0, 150.0), (True,), (False, True))
    field = product((0.06, 0.12), (62.0, 150.0), (False,), (False, True))
    return [SweepDrive(*numbers) for numbers in (*on_board, *field)]


def mean_speed(rig: Truth, frequency_Hz: float, duty: float = 0.3) -> float:
    """Mean speed in m/s over whole periods of a PWM drive, after a second to settle."""
    vibro = rig.drive
    if not isinstance(vibro, TrueVibro):
        raise ValueError(f"drive must be a vibro drive; got {vibro.kind}")
    cycles = round(_MEASURE_S * frequency_Hz)
    start = round(_SETTLE_S * frequency_Hz) / frequency_Hz
    end = start + cycles / frequency_Hz
    rows = Plant(rig).advance(vibro.force_N * pulse_width(1 / frequency_Hz, duty, end + 0.01, STEP_S), _EVERY)
    x = np.interp([start, end], rows[:, at.O_T], rows[:, at.O_X])
    return float((x[1] - x[0]) / (end - start))


def judge(speeds: Floats) -> str:
    """`holds`, `fails`, or `does not move` for the speeds of one drive over `FREQUENCIES_HZ`."""
    size, frequency = np.abs(speeds), np.asarray(FREQUENCIES_HZ)
    slow, fast = float(np.max(size[frequency < WALL_HZ])), float(np.max(size[frequency > WALL_HZ]))
    if max(slow, fast) < HARDLY_M_S:
        return "does not move"
    return "holds" if slow < max(SLOW_SHARE * fast, HARDLY_M_S) else "fails"


def vibro_sweep(out: Path) -> dict[str, Any]:
    """Sweep all drives over 2 to 60 Hz; write `vibro_sweep.html` and `.json` to the folder `out` and return the JSON's
    object.

    The claim holds for a drive when its fastest speed at periods above 0.05 s stays below a fifth of that at shorter
    ones (or below 0.5 mm/s). A field from outside also pulls with its mean force, which a drive on board cannot.
    """
    out.mkdir(parents=True, exist_ok=True)
    results = []
    for drive in sweep_drives():
        speeds = np.array([mean_speed(drive.rig(), f) for f in FREQUENCIES_HZ])
        told = {"name": drive.name, **asdict(drive), "mean_speed_m_s": speeds.round(7).tolist()}
        results.append({**told, "claim": judge(speeds)})
    median = np.median(np.abs([r["mean_speed_m_s"] for r in results]), axis=0)
    found: dict[str, Any] = {
        "claim": CLAIM,
        "frequency_Hz": list(FREQUENCIES_HZ),
        "median_speed_m_s": median.round(7).tolist(),
        "verdicts": {v: [r["name"] for r in results if r["claim"] == v] for v in ("holds", "fails", "does not move")},
        "drives": results,
    }
    (out / "vibro_sweep.json").write_text(json_text(found), encoding="utf-8")
    counts = ", ".join(f"{len(names)} {verdict}" for verdict, names in found["verdicts"].items())
    lead = f"{CLAIM}: {counts}. The dashed line is a period of 0.05 s."
    told = {"eyebrow": f"{len(results)} drives", "title": "Vibro drives on the gut", "lead": lead}
    text = page("plot.html.j2", **told, heading="Mean speed", drawn=_figure(found))
    (out / "vibro_sweep.html").write_text(text, encoding="utf-8")
    return found


def _figure(found: dict[str, Any]) -> go.Figure:
    """A panel for each verdict, a line for each drive (named where the pointer is), the median of the sizes in all."""
    verdicts = [(verdict, names) for verdict, names in found["verdicts"].items() if names]
    titles = [f"{verdict} ({len(names)} drives)" for verdict, names in verdicts]
    figure = make_subplots(rows=len(verdicts), cols=1, shared_xaxes=True, vertical_spacing=0.08, subplot_titles=titles)
    rows = {verdict: row for row, (verdict, _) in enumerate(verdicts, 1)}
    median = 1e3 * np.asarray(found["median_speed_m_s"])
    seen: set[bool] = set()
    for drive in found["drives"]:
        on_board = bool(drive["on_board"])
        figure.add_scatter(
            x=found["frequency_Hz"],
            y=1e3 * np.asarray(drive["mean_speed_m_s"]),
            name="driven on board" if on_board else "driven by a field",
            line={"color": _COLOURS[on_board], "dash": "solid" if on_board else "dot", "width": 1.3},
            hovertemplate=f"{drive['name']}: %{{y:.3g}} mm/s at %{{x}} Hz<extra></extra>",
            showlegend=on_board not in seen,
            row=rows[drive["claim"]],
            col=1,
        )
        seen.add(on_board)
    for row in rows.values():
        figure.add_scatter(
            x=found["frequency_Hz"], y=median, name="median of all sizes", line={"color": INK, "width": 2.5},
            showlegend=row == 1, row=row, col=1,
        )  # fmt: skip
        figure.add_vline(x=WALL_HZ, line_dash="dash", line_width=1, row=row, col=1)
        figure.update_yaxes(title="mean speed in mm/s", row=row, col=1)
    styled(figure, 300 * len(rows))
    figure.update_xaxes(title="drive frequency in Hz", row=len(rows), col=1)
    return figure


def main() -> None:
    """Sweep, draw, and print the verdicts."""
    parser = argparse.ArgumentParser(prog="python -m tests.bench.vibro_sweep", description=CLAIM)
    parser.add_argument("out", type=Path, metavar="DIR", help="folder for vibro_sweep.html and vibro_sweep.json")
    out = parser.parse_args().out
    found = vibro_sweep(out)
    for verdict, names in found["verdicts"].items():
        print(f"{verdict} ({len(names)}): {'; '.join(names)}")
    pairs = zip(found["frequency_Hz"], found["median_speed_m_s"], strict=True)
    print("median of the sizes, mm/s: " + ", ".join(f"{1e3 * v:.2g} at {f:g} Hz" for f, v in pairs))
    print(out / "vibro_sweep.html")


if __name__ == "__main__":
    main()
