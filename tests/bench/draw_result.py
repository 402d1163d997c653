"""The head of the report on `examples/own_record` as the picture of README and docs: `python -m
tests.bench.draw_result docs/result.png`, with Debian's chromium.
"""

import subprocess
import sys
import tempfile
from pathlib import Path

from hil.app.main import run
from tests.places import ROOT

FOLDER = ROOT / "examples" / "own_record"
WIDTH, HEIGHT = 900, 1330  # pixels: down to the table of the errors and the effect's equation


def main(target: Path) -> None:
    """Close the loop on the example and draw the page's first part to `target`."""
    with tempfile.TemporaryDirectory() as folder:
        records = [str(FOLDER / f"pull_{k}.csv") for k in (1, 2)]
        held, rig = str(FOLDER / "held_out.csv"), str(FOLDER / "rig.toml")
        if run(["close-loop", *records, "--rig", rig, "--holdout", held, "--out", folder]):
            raise SystemExit(1)
        page = (Path(folder) / "report.html").as_uri()
        size = f"--window-size={WIDTH},{HEIGHT}"
        command = ["chromium", "--headless", "--no-sandbox", "--disable-gpu", "--hide-scrollbars", size]
        subprocess.run([*command, "--virtual-time-budget=20000", f"--screenshot={target}", page], check=True)


if __name__ == "__main__":
    main(Path(sys.argv[1]))
