"""From a log of a piezo nanopositioner to an identified hysteresis model.

>>> import piezotrack as pt
>>> stage = pt.DahlStage.xu_li_2010()
>>> stage.stiffness
26065.0
"""

from ._core import __version__
from .bouc_wen import BoucWenStage, BoucWenState
from .control import Command, Controller, LowPass, Notch, Pid, Repetitive, Session, StateSpace
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
from .inverse import Inverse, InverseSession
from .io import read, read_drive
from .loopcheck import LoopCheck, LoopReport, LoopResponse, check_loop
from .modelfile import IdentifiedModel, Score, load
from .models import DahlStage, Response, StageState
from .reference_text import parse_reference
from .references import Reference, SampledReference, read_reference
from .swarm import ParticleSwarm
from .tracking import Metrics, Tracking, track
from .virtual import VirtualResponse, VirtualStage
from .waveforms import chirp, multisine, sine, staircase, triangle

__all__ = [
    "BoucWenStage",
    "BoucWenState",
    "Command",
    "Controller",
    "DahlStage",
    "DataError",
    "Dataset",
    "Estimate",
    "Identification",
    "IdentifiedModel",
    "Interrupted",
    "Inverse",
    "InverseSession",
    "LoopCheck",
    "LoopReport",
    "LoopResponse",
    "LowPass",
    "Metrics",
    "Notch",
    "NumericalError",
    "ParameterError",
    "ParticleSwarm",
    "Pid",
    "PiezotrackError",
    "Progress",
    "Reference",
    "Repetitive",
    "Response",
    "Run",
    "SampledReference",
    "Score",
    "Session",
    "ShapeError",
    "StageState",
    "StateSpace",
    "Tracking",
    "VirtualResponse",
    "VirtualStage",
    "__version__",
    "check_loop",
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
    "track",
    "triangle",
]
