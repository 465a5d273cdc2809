# The public names and their homes, each written once: type checkers read them here, and
# _support/lazy.py does at run time. One name a line, as `ruff format` keeps it.
from .comparison import Compared as Compared
from .comparison import Comparison as Comparison
from .comparison import compare as compare
from .cross_talk import CrossTalk as CrossTalk
from .cross_talk import identify_cross_talk as identify_cross_talk
from .estimates import Estimate as Estimate
from .estimates import Progress as Progress
from .estimates import Run as Run
from .identified import Score as Score
from .least_squares import PlaysIdentification as PlaysIdentification
from .least_squares import identify_plays as identify_plays
from .model_file import IdentifiedModel as IdentifiedModel
from .model_file import IdentifiedPlays as IdentifiedPlays
from .model_file import load as load
from .search import Identification as Identification
from .search import identify as identify
from .sensor_noise import Noise as Noise
from .sensor_noise import identify_noise as identify_noise
from .step_readings import StepReadings as StepReadings
from .step_response import StepResult as StepResult
from .step_response import StepTrace as StepTrace
from .step_response import identify_step as identify_step
from .swarm import ParticleSwarm as ParticleSwarm
