"""Settings of the identification: search, fits, verdict, residual, proposed experiments, and single kinds of rig."""

from models.parameter import settings

SET = settings(__file__)
