"""Entry point: interruption, full streams and too little memory end with a sentence."""

import os
import sys

from hil.app.system import INTERRUPTED, INTERRUPTION, Streams, shortage, too_little

BAD_INPUT = 2  # exit status


def leave_current_folder() -> None:
    """Keep every process from running code of the current folder: modules, or what `.numba_config.yaml` names."""
    os.environ["PYTHONSAFEPATH"] = "1"
    for setting in ("NUMBA_CACHE_DIR", "NUMBA_CACHE_LOCATOR_CLASSES"):
        os.environ.setdefault(setting, "")


def main() -> None:
    streams = Streams()
    sys.exit(streams.status(_status(sys.argv[1:])))


def _status(arguments: list[str]) -> int:
    leave_current_folder()
    if words := too_little(arguments):
        print("capsule:", words, file=sys.stderr)
        return BAD_INPUT
    try:
        from hil.app.main import run

        return run(arguments)
    except KeyboardInterrupt:
        print("capsule:", INTERRUPTION, file=sys.stderr)
        return INTERRUPTED
    except (MemoryError, ImportError, OSError) as error:
        if not (words := shortage(error)):
            raise
        print("capsule:", words, file=sys.stderr)
        return BAD_INPUT


if __name__ == "__main__":
    main()
