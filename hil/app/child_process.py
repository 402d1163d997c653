"""What a child process does so that it never outlives the command that began it."""

from multiprocessing import parent_process
from os import _exit
from threading import Thread


def end_with_parent() -> None:
    """End this process with its parent: of one that was killed a child would wait for work for ever."""

    def watch() -> None:
        parent = parent_process()
        if parent is not None:
            parent.join()
            _exit(1)

    Thread(target=watch, daemon=True).start()
