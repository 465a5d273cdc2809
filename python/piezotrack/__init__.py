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
from .reference_text import parse_reference
from .references import Reference, SampledReference, read_reference
from .swarm import ParticleSwarm
from .waveforms import chirp, multisine, sine, staircase, triangle

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
    "Reference",
    "Response",
    "Run",
    "SampledReference",
    "Score",
    "ShapeError",
    "StageState",
    "__version__",
    "chirp",
    "identify",
    "load",
    "multisine",
    "parse_reference",
    "read",
    "read_drive",
    "read_reference",
    "sine",
    "staircase",
    "triangle",
]
