"""From a log of a piezo nanopositioner to an identified hysteresis model.

>>> import piezotrack as pt
>>> stage = pt.DahlStage.xu_li_2010()
>>> stage.stiffness
26065.0
"""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING, Any

from ._core import __version__
from .errors import (
    DataError,
    Interrupted,
    NumericalError,
    ParameterError,
    PiezotrackError,
    ShapeError,
)

if TYPE_CHECKING:
    from .bouc_wen import BoucWenStage, BoucWenState
    from .comparison import Compared, Comparison, compare
    from .contouring import Contour, contour
    from .control import Command, Controller, Session
    from .cross_talk import CrossTalk, identify_cross_talk
    from .dataset import Dataset
    from .driven import FeedbackState
    from .estimates import Estimate, Progress, Run
    from .first_order_dahl import FirstOrderDahlStage
    from .identification import Identification, identify
    from .identified import Score
    from .inverse import Inverse, InverseSession
    from .io import read, read_drive
    from .laws import LowPass, Notch, Pid, Repetitive, StateSpace
    from .loopcheck import LoopCheck, LoopReport, LoopResponse, check_loop
    from .modelfile import IdentifiedModel, load
    from .models import DahlStage, Response, StageState
    from .noise import Noise, identify_noise
    from .oscillator import BoucWenOscillator
    from .path_text import parse_path
    from .paths import circle, lissajous, raster, spiral
    from .plays import PlaysResponse, PlaysState, PrandtlIshlinskiiStage
    from .playsfile import IdentifiedPlays
    from .playsfit import PlaysIdentification, identify_plays
    from .readings import StepReadings
    from .reference_text import parse_reference
    from .references import Reference, SampledReference, read_reference
    from .reproduce import Reproduction, reproduce_xu_li_2010
    from .step import StepResult, StepTrace, identify_step
    from .swarm import ParticleSwarm
    from .table_2 import Table2, run_table_2
    from .tracking import Metrics, Spread, Tracking, track
    from .virtual import VirtualResponse, VirtualStage
    from .waveforms import chirp, multisine, sine, staircase, triangle
    from .xyreference import XYReference, read_path
    from .xystage import XYStage

__all__ = [
    "BoucWenOscillator",
    "BoucWenStage",
    "BoucWenState",
    "Command",
    "Compared",
    "Comparison",
    "Contour",
    "Controller",
    "CrossTalk",
    "DahlStage",
    "DataError",
    "Dataset",
    "Estimate",
    "FeedbackState",
    "FirstOrderDahlStage",
    "Identification",
    "IdentifiedModel",
    "IdentifiedPlays",
    "Interrupted",
    "Inverse",
    "InverseSession",
    "LoopCheck",
    "LoopReport",
    "LoopResponse",
    "LowPass",
    "Metrics",
    "Noise",
    "Notch",
    "NumericalError",
    "ParameterError",
    "ParticleSwarm",
    "Pid",
    "PiezotrackError",
    "PlaysIdentification",
    "PlaysResponse",
    "PlaysState",
    "PrandtlIshlinskiiStage",
    "Progress",
    "Reference",
    "Repetitive",
    "Reproduction",
    "Response",
    "Run",
    "SampledReference",
    "Score",
    "Session",
    "ShapeError",
    "Spread",
    "StageState",
    "StateSpace",
    "StepReadings",
    "StepResult",
    "StepTrace",
    "Table2",
    "Tracking",
    "VirtualResponse",
    "VirtualStage",
    "XYReference",
    "XYStage",
    "__version__",
    "check_loop",
    "chirp",
    "circle",
    "compare",
    "contour",
    "identify",
    "identify_cross_talk",
    "identify_noise",
    "identify_plays",
    "identify_step",
    "lissajous",
    "load",
    "multisine",
    "parse_path",
    "parse_reference",
    "raster",
    "read",
    "read_drive",
    "read_path",
    "read_reference",
    "reproduce_xu_li_2010",
    "run_table_2",
    "sine",
    "spiral",
    "staircase",
    "track",
    "triangle",
]

# What is heavy is imported when it is first used.
_HOMES = {
    "contouring": (
        "Contour",
        "contour",
    ),
    "cross_talk": (
        "CrossTalk",
        "identify_cross_talk",
    ),
    "noise": (
        "Noise",
        "identify_noise",
    ),
    "paths": (
        "circle",
        "lissajous",
        "raster",
        "spiral",
    ),
    "xyreference": (
        "XYReference",
        "read_path",
    ),
    "xystage": ("XYStage",),
    "path_text": ("parse_path",),
    "table_2": (
        "Table2",
        "run_table_2",
    ),
    "bouc_wen": (
        "BoucWenStage",
        "BoucWenState",
    ),
    "first_order_dahl": ("FirstOrderDahlStage",),
    "driven": ("FeedbackState",),
    "oscillator": ("BoucWenOscillator",),
    "playsfit": (
        "PlaysIdentification",
        "identify_plays",
    ),
    "playsfile": ("IdentifiedPlays",),
    "plays": (
        "PlaysResponse",
        "PlaysState",
        "PrandtlIshlinskiiStage",
    ),
    "step": (
        "StepResult",
        "StepTrace",
        "identify_step",
    ),
    "readings": ("StepReadings",),
    "comparison": (
        "Compared",
        "Comparison",
        "compare",
    ),
    "control": (
        "Command",
        "Controller",
        "Session",
    ),
    "dataset": ("Dataset",),
    "estimates": (
        "Estimate",
        "Progress",
        "Run",
    ),
    "identified": ("Score",),
    "identification": (
        "Identification",
        "identify",
    ),
    "inverse": (
        "Inverse",
        "InverseSession",
    ),
    "io": (
        "read",
        "read_drive",
    ),
    "laws": (
        "LowPass",
        "Notch",
        "Pid",
        "Repetitive",
        "StateSpace",
    ),
    "loopcheck": (
        "LoopCheck",
        "LoopReport",
        "LoopResponse",
        "check_loop",
    ),
    "modelfile": (
        "IdentifiedModel",
        "load",
    ),
    "models": (
        "DahlStage",
        "Response",
        "StageState",
    ),
    "reference_text": ("parse_reference",),
    "references": (
        "Reference",
        "SampledReference",
        "read_reference",
    ),
    "reproduce": (
        "Reproduction",
        "reproduce_xu_li_2010",
    ),
    "swarm": ("ParticleSwarm",),
    "tracking": (
        "Metrics",
        "Spread",
        "Tracking",
        "track",
    ),
    "virtual": (
        "VirtualResponse",
        "VirtualStage",
    ),
    "waveforms": (
        "chirp",
        "multisine",
        "sine",
        "staircase",
        "triangle",
    ),
}


def __getattr__(name: str) -> Any:
    for home, names in _HOMES.items():
        if name in names:
            value = getattr(import_module(f".{home}", __name__), name)
            globals()[name] = value
            return value
    raise AttributeError(f"module 'piezotrack' has no attribute {name!r}")


def __dir__() -> list[str]:
    return sorted({*globals(), *__all__})
