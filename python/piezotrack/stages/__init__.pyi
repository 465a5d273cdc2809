# The public names and their homes, each written once: type checkers read them here, and
# _support/lazy.py does at run time. One name a line, as `ruff format` keeps it.
from .apparatus import Amplifier as Amplifier
from .apparatus import Preconditioning as Preconditioning
from .apparatus import Sensor as Sensor
from .base import Stage as Stage
from .feedback.bouc_wen_oscillator import BoucWenOscillator as BoucWenOscillator
from .feedback.dahl import DahlStage as DahlStage
from .feedback.dahl import DahlState as DahlState
from .feedback.first_order_dahl import FirstOrderDahlStage as FirstOrderDahlStage
from .feedback.lugre import LuGreStage as LuGreStage
from .feedback.lugre import LuGreState as LuGreState
from .feedback.parallel_dahl import ParallelDahlStage as ParallelDahlStage
from .feedback.parallel_dahl import ParallelDahlState as ParallelDahlState
from .input.asymmetric_bouc_wen import AsymmetricBoucWenStage as AsymmetricBoucWenStage
from .input.bouc_wen import BoucWenStage as BoucWenStage
from .input.bouc_wen import BoucWenState as BoucWenState
from .inverse import Inverse as Inverse
from .inverse import InverseSession as InverseSession
from .inverse import PlayedVoltage as PlayedVoltage
from .motion import ForceState as ForceState
from .motion import Response as Response
from .motion import StageState as StageState
from .plays.asymmetric_prandtl_ishlinskii import (
    AsymmetricPrandtlIshlinskiiStage as AsymmetricPrandtlIshlinskiiStage,
)
from .plays.generalised_prandtl_ishlinskii import (
    GeneralisedPrandtlIshlinskiiStage as GeneralisedPrandtlIshlinskiiStage,
)
from .plays.maxwell_slip import MaxwellSlipStage as MaxwellSlipStage
from .plays.polynomial_prandtl_ishlinskii import (
    PolynomialPrandtlIshlinskiiStage as PolynomialPrandtlIshlinskiiStage,
)
from .plays.prandtl_ishlinskii import PrandtlIshlinskiiStage as PrandtlIshlinskiiStage
from .plays.prandtl_ishlinskii import PrandtlIshlinskiiState as PrandtlIshlinskiiState
from .plays.rate_dependent_prandtl_ishlinskii import (
    RateDependentPrandtlIshlinskiiStage as RateDependentPrandtlIshlinskiiStage,
)
from .relays.duhem import DuhemStage as DuhemStage
from .relays.duhem import DuhemState as DuhemState
from .relays.preisach import PreisachStage as PreisachStage
from .relays.preisach import PreisachState as PreisachState
from .slow_loop import SlowLoop as SlowLoop
from .virtual import VirtualResponse as VirtualResponse
from .virtual import VirtualStage as VirtualStage
from .xy import XYLog as XYLog
from .xy import XYResponse as XYResponse
from .xy import XYStage as XYStage
