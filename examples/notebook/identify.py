# %% [markdown]
# # From records to a better model, in Python
# Three simulated pulls of `examples/own_record`; what is hidden in them are folds 7.3 mm apart.

# %%
from pathlib import Path

import numpy as np
import plotly.graph_objects as go

import hil
from hil import api

folder = Path(hil.__file__).parents[1] / "examples" / "own_record"
rig = api.load_rig(folder / "rig.toml")
train = [api.load_record(folder / f"pull_{k}.csv", rig) for k in (1, 2)]
held_out = api.load_record(folder / "held_out.csv", rig)

# %% [markdown]
# A record may as well come from arrays or a data frame: `api.make_record(frame, rig)`.

# %%
found = api.identify(rig, train, [held_out])
print(found.finding.verdict, [effect.id for effect in found.finding.effects])
print({stage: f"{1e3 * error:.2f} mN" for stage, error in found.finding.error["holdout"].items()})

# %% [markdown]
# Measured and predicted force of the pull that no fit has seen. The prediction runs free: it sees the position alone.

# %%
predictions = {
    stage: api.predict(found.model, rig, held_out, stage)["force_N"] for stage in ("calibrated", "augmented")
}
figure = go.Figure()
for name, force in {"measured": held_out["force_N"], **predictions}.items():
    figure.add_scatter(x=held_out["t_s"], y=1e3 * force, name=name)
figure.update_layout(xaxis_title="time in s", yaxis_title="force in mN")

# %% [markdown]
# A closed loop in simulation under a controller by name.

# %%
run = api.track(Path(hil.__file__).parent / "scenarios" / "track_magnetic_ramp.toml", "feedforward", seed=1)
print(f"rms error {1e3 * run.scores['tracking_rmse_m']:.3f} mm; largest command {np.max(run.columns['command']):.4f} m")
