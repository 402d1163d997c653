"""Measured records in; what the model lacks, and the better model, out."""

from models.identification.identify import close
from models.identification.model import Model

__all__ = ["Model", "close"]
