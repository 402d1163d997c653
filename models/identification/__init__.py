"""Measured records in; what the model lacks, and the better model, out."""

from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from models.identification.identify import close
    from models.identification.model import Model

__all__ = ["Model", "close"]


def __getattr__(name: str) -> Any:
    """The search is loaded once it is asked for: what only reads records or writes a template starts without it."""
    if name not in __all__:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    return getattr(import_module(f"{__name__}.{'identify' if name == 'close' else 'model'}"), name)
