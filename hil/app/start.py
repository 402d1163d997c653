"""Where the program begins: an interruption while it is still being loaded ends with a sentence, too."""

from __future__ import annotations

import os
import sys

from hil.app.interruption import INTERRUPTED, INTERRUPTION


def leave_current_folder() -> None:
    """Let neither this process nor one that it begins run what lies in the current folder: modules, and compiled code
    that a `.numba_config.yaml` there names.
    """
    os.environ["PYTHONSAFEPATH"] = "1"
    for setting in ("NUMBA_CACHE_DIR", "NUMBA_CACHE_LOCATOR_CLASSES"):
        os.environ.setdefault(setting, "")


def main() -> None:
    """Run the command line and end with its status."""
    leave_current_folder()
    try:
        from hil.app.main import run

        status = run(sys.argv[1:])
    except KeyboardInterrupt:
        print("capsule:", INTERRUPTION, file=sys.stderr)
        status = INTERRUPTED
    sys.exit(status)


if __name__ == "__main__":
    main()
