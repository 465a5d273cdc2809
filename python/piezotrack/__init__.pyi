# The public names and their homes, each written once: type checkers read them here, and
# _support/lazy.py does at run time. One name a line, as `ruff format` keeps it; the rest is in
# the packages: pt.control.StateSpace, pt.references.read_path and so on.
from . import control as control
from . import data as data
from . import hardware as hardware
from . import identification as identification
from . import multiaxis as multiaxis
from . import references as references
from . import response as response
from . import stages as stages
from . import xu_li_2010 as xu_li_2010
from ._core import __version__ as __version__
from ._support.display.look import figure_style as figure_style
from .benchmarking.board import benchmark as benchmark
from .benchmarking.record import BenchmarkRecord as BenchmarkRecord
from .control.comparing.compare import compare_controllers as compare_controllers
from .control.controller.controller import Controller as Controller
from .control.controller.load import load_controller as load_controller
from .control.laws.pid import Pid as Pid
from .control.learning.learn import learn as learn
from .control.loop.contouring import contour as contour
from .control.loop.stability import check_loop as check_loop
from .control.on_device.playing import play as play
from .control.parts.filters import LowPass as LowPass
from .control.parts.filters import Notch as Notch
from .control.parts.repetitive import Repetitive as Repetitive
from .control.running.track import track as track
from .control.running.zero import zero as zero
from .control.timing import Timing as Timing
from .control.tuning.goal import Goal as Goal
from .control.tuning.goal import TuningSearch as TuningSearch
from .control.tuning.linear.systems import to_control as to_control
from .control.tuning.margins import Margins as Margins
from .control.tuning.margins import Spread as Spread
from .control.tuning.schedule import schedule as schedule
from .control.tuning.tune import tune as tune
from .control.verifying.verify import verify as verify
from .data import datasets as datasets
from .data.dataset import Dataset as Dataset
from .data.reader import read as read
from .errors import DataError as DataError
from .errors import DeviceError as DeviceError
from .errors import ExecutorError as ExecutorError
from .errors import Interrupted as Interrupted
from .errors import NumericalError as NumericalError
from .errors import ParameterError as ParameterError
from .errors import PiezotrackError as PiezotrackError
from .errors import ShapeError as ShapeError
from .hardware.measuring import measure as measure
from .identification.campaigns.campaign import campaign as campaign
from .identification.comparison.compare import compare as compare
from .identification.confidence.suggestion.suggested_drive import suggest_drive as suggest_drive
from .identification.experiments.step_response import identify_step as identify_step
from .identification.fit import identify as identify
from .identification.fitted.model_file import load as load
from .identification.methods.descents import Descents as Descents
from .identification.methods.least_squares import LeastSquares as LeastSquares
from .identification.methods.particle_swarm import ParticleSwarm as ParticleSwarm
from .identification.problem.parameter import Parameter as Parameter
from .identification.problem.records import Record as Record
from .identification.watching.watch import watch as watch
from .references.moves import move as move
from .references.parse import parse_reference as parse_reference
from .references.paths import circle as circle
from .references.paths import lissajous as lissajous
from .references.paths import raster as raster
from .references.paths import spiral as spiral
from .references.reference import Reference as Reference
from .references.waveforms import chirp as chirp
from .references.waveforms import multisine as multisine
from .references.waveforms import sine as sine
from .references.waveforms import staircase as staircase
from .references.waveforms import triangle as triangle
from .references.xy_reference import XYReference as XYReference
from .response.excitation import RandomPhaseMultisine as RandomPhaseMultisine
from .response.measuring import frequency_response as frequency_response
from .response.modal_fit import fit_modes as fit_modes
from .response.response_data import FrequencyResponse as FrequencyResponse
from .response.response_file import load_response as load_response
from .stages.feedback.bouc_wen_oscillator import BoucWenOscillator as BoucWenOscillator
from .stages.feedback.dahl import DahlStage as DahlStage
from .stages.feedback.first_order_dahl import FirstOrderDahlStage as FirstOrderDahlStage
from .stages.feedback.lugre import LuGreStage as LuGreStage
from .stages.feedback.parallel_dahl import ParallelDahlStage as ParallelDahlStage
from .stages.input.asymmetric_bouc_wen import AsymmetricBoucWenStage as AsymmetricBoucWenStage
from .stages.input.bouc_wen import BoucWenStage as BoucWenStage
from .stages.inverse import Inverse as Inverse
from .stages.plays.asymmetric_prandtl_ishlinskii import (
    AsymmetricPrandtlIshlinskiiStage as AsymmetricPrandtlIshlinskiiStage,
)
from .stages.plays.generalised_prandtl_ishlinskii import (
    GeneralisedPrandtlIshlinskiiStage as GeneralisedPrandtlIshlinskiiStage,
)
from .stages.plays.maxwell_slip import MaxwellSlipStage as MaxwellSlipStage
from .stages.plays.polynomial_prandtl_ishlinskii import (
    PolynomialPrandtlIshlinskiiStage as PolynomialPrandtlIshlinskiiStage,
)
from .stages.plays.prandtl_ishlinskii import PrandtlIshlinskiiStage as PrandtlIshlinskiiStage
from .stages.plays.rate_dependent_prandtl_ishlinskii import (
    RateDependentPrandtlIshlinskiiStage as RateDependentPrandtlIshlinskiiStage,
)
from .stages.relays.duhem import DuhemStage as DuhemStage
from .stages.relays.preisach import PreisachStage as PreisachStage
from .stages.virtual import VirtualStage as VirtualStage
from .stages.xy import XYStage as XYStage
