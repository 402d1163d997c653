"""Settings of the identification: search, fits, verdict, residual, proposed experiments, and single kinds of rig."""

from typing import Final

from models.files.settings import Settings

SET: Final = Settings(__file__)
