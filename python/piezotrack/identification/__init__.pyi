# The public names and their homes, each written once: type checkers read them here, and
# _support/lazy.py does at run time. One name a line, as `ruff format` keeps it.
from .comparison import Comparison as Comparison
from .comparison import ModelScore as ModelScore
from .comparison import compare as compare
from .cross_talk import CrossTalk as CrossTalk
from .cross_talk import identify_cross_talk as identify_cross_talk
from .estimates import Estimate as Estimate
from .estimates import LagRange as LagRange
from .estimates import Progress as Progress
from .estimates import SwarmRun as SwarmRun
from .fit import identify as identify
from .history import Start as Start
from .identified import IdentifiedModel as IdentifiedModel
from .identified import Score as Score
from .identified import load as load
from .least_squares import LeastSquares as LeastSquares
from .result import Identification as Identification
from .selection import Trial as Trial
from .sensor_noise import Noise as Noise
from .sensor_noise import identify_noise as identify_noise
from .step_readings import StepReadings as StepReadings
from .step_response import StepResult as StepResult
from .step_response import StepTrace as StepTrace
from .step_response import identify_step as identify_step
from .swarm import ParticleSwarm as ParticleSwarm
