"""What `capsule run` and `capsule plant` load before they begin, machine code of the solvers included."""

import hil.app.run.run
import hil.app.run.simulated_plant  # noqa: F401
from hil.drives.makers import ACTUATORS  # noqa: F401
from tests.hil.app.sil.sil_runs import run

run("magnetic", 0.2)
