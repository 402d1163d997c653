"""Where plant and controller meet: bus, nodes, logs and the command line."""

import sys
from importlib.abc import MetaPathFinder
from typing import Any


class _Unneeded(MetaPathFinder):
    """python-can would load asammdf and pandas for MF4 files, which we read otherwise: a second of each start."""

    def find_spec(self, name: str, path: Any = None, target: Any = None) -> None:
        """Refuses asammdf to the module of python-can that is being loaded, and finds nothing."""
        asking = sys.modules.get("can.io.mf4")
        if name == "asammdf" and asking is not None and not hasattr(asking, "MF4Reader"):
            raise ModuleNotFoundError(name)


sys.meta_path.insert(0, _Unneeded())
