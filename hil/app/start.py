"""Where the program begins: an interruption while it is still being loaded ends with a sentence, too."""

from __future__ import annotations

import sys

from hil.app.interruption import INTERRUPTED, INTERRUPTION


def main() -> None:
    """Run the command line and end with its status."""
    try:
        from hil.app.main import run

        status = run(sys.argv[1:])
    except KeyboardInterrupt:
        print("capsule:", INTERRUPTION, file=sys.stderr)
        status = INTERRUPTED
    sys.exit(status)


if __name__ == "__main__":
    main()
