"""Draws the picture of tracking in docs/control.md, with and without the friction model: `python -m
tests.bench.draw_tracking docs/tracking.png`.

Needs matplotlib, which nothing else here does (`.venv/bin/pip install matplotlib`). The shipped slow traverse, seed 1.
"""

import sys
from importlib import import_module
from pathlib import Path
from typing import Any, Final

from hil.app.scenario.scenario import load_track_scenario
from hil.app.track.loop import believed_model, run_loop
from hil.app.track.score import score
from models.theta import Theta
from plant import layout as at

SCENARIO: Final = Path(__file__).parents[2] / "hil" / "scenarios" / "track_magnetic_ramp.toml"
SHOWN: Final = (
    ("pid", "tuned PID, no friction model", "#c2703d"),
    ("feedforward", "friction-aware estimator and feedforward", "#2f6f8f"),
)
WINDOW_S: Final = (5.0, 15.0)


def draw(path: Path) -> None:
    """Errors of the true position over time, one line a controller, with its RMSE over the whole run."""
    plt: Any = import_module("matplotlib.pyplot")
    scenario = load_track_scenario(SCENARIO)
    model = believed_model(scenario, Theta())
    figure, axes = plt.subplots(figsize=(9, 3.4), dpi=120)
    axes.axhline(0.0, color="#999999", linewidth=1)
    for name, words, colour in SHOWN:
        trace = run_loop(scenario, model, name, 1)
        t, x = trace.rows[:, at.O_T], trace.rows[:, at.O_X]
        inside = (t >= WINDOW_S[0]) & (t <= WINDOW_S[1])
        error = 1e3 * (x - scenario.reference.position(t))
        rmse = 1e3 * score(scenario, trace).tracking_rmse_m
        axes.plot(t[inside][::5], error[inside][::5], color=colour, linewidth=1.2, label=f"{words}: {rmse:.2f} mm rms")
    axes.set(xlabel="time, s", ylabel="position error, mm", xlim=WINDOW_S)
    axes.set_title(
        "Slow traverse at 1 mm/s; localisation 0.5 mm rms, 100 Hz, 8 ms late; friction 7 %, wall 9 %, magnet 3 % off",
        fontsize=10,
        loc="left",
    )
    axes.legend(frameon=False, loc="upper right", fontsize=9)
    axes.spines[["top", "right"]].set_visible(False)
    figure.tight_layout()
    figure.savefig(path)


if __name__ == "__main__":
    draw(Path(sys.argv[1]))
