"""From a log of a piezo nanopositioner to an identified hysteresis model.

>>> import piezotrack as pt
>>> stage = pt.DahlStage.xu_li_2010()
>>> stage.stiffness
26065.0
"""

from ._core import __version__
from .dataset import Dataset
from .errors import (
    DataError,
    Interrupted,
    NumericalError,
    ParameterError,
    PiezotrackError,
    ShapeError,
)
from .estimates import Estimate, Progress, Run
from .identification import Identification, identify
from .io import read, read_drive
from .modelfile import IdentifiedModel, Score, load
from .models import DahlStage, Response, StageState
from .swarm import ParticleSwarm

__all__ = [
    "DahlStage",
    "DataError",
    "Dataset",
    "Estimate",
    "Identification",
    "IdentifiedModel",
    "Interrupted",
    "NumericalError",
    "ParameterError",
    "ParticleSwarm",
    "PiezotrackError",
    "Progress",
    "Response",
    "Run",
    "Score",
    "ShapeError",
    "StageState",
    "__version__",
    "identify",
    "load",
    "read",
    "read_drive",
]
