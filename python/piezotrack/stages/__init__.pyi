# The public names and their homes, each written once: type checkers read them here, and
# _support/lazy.py does at run time. One name a line, as `ruff format` keeps it.
from .apparatus import Amplifier as Amplifier
from .apparatus import Preconditioning as Preconditioning
from .apparatus import Sensor as Sensor
from .asymmetric_bouc_wen import AsymmetricBoucWenStage as AsymmetricBoucWenStage
from .asymmetric_prandtl_ishlinskii import (
    AsymmetricPrandtlIshlinskiiStage as AsymmetricPrandtlIshlinskiiStage,
)
from .base import Stage as Stage
from .bouc_wen import BoucWenStage as BoucWenStage
from .bouc_wen import BoucWenState as BoucWenState
from .bouc_wen_oscillator import BoucWenOscillator as BoucWenOscillator
from .dahl import DahlStage as DahlStage
from .dahl import DahlState as DahlState
from .duhem import DuhemStage as DuhemStage
from .duhem import DuhemState as DuhemState
from .first_order_dahl import FirstOrderDahlStage as FirstOrderDahlStage
from .generalised_prandtl_ishlinskii import (
    GeneralisedPrandtlIshlinskiiStage as GeneralisedPrandtlIshlinskiiStage,
)
from .inverse import Inverse as Inverse
from .inverse import InverseSession as InverseSession
from .inverse import PlayedVoltage as PlayedVoltage
from .lugre import LuGreStage as LuGreStage
from .lugre import LuGreState as LuGreState
from .maxwell_slip import MaxwellSlipStage as MaxwellSlipStage
from .motion import ForceState as ForceState
from .motion import Response as Response
from .motion import StageState as StageState
from .parallel_dahl import ParallelDahlStage as ParallelDahlStage
from .parallel_dahl import ParallelDahlState as ParallelDahlState
from .polynomial_prandtl_ishlinskii import (
    PolynomialPrandtlIshlinskiiStage as PolynomialPrandtlIshlinskiiStage,
)
from .prandtl_ishlinskii import PrandtlIshlinskiiStage as PrandtlIshlinskiiStage
from .prandtl_ishlinskii import PrandtlIshlinskiiState as PrandtlIshlinskiiState
from .preisach import PreisachStage as PreisachStage
from .preisach import PreisachState as PreisachState
from .rate_dependent_prandtl_ishlinskii import (
    RateDependentPrandtlIshlinskiiStage as RateDependentPrandtlIshlinskiiStage,
)
from .virtual import VirtualResponse as VirtualResponse
from .virtual import VirtualStage as VirtualStage
from .xy import XYLog as XYLog
from .xy import XYResponse as XYResponse
from .xy import XYStage as XYStage
