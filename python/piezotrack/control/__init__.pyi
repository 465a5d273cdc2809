# The public names and their homes, each written once: type checkers read them here, and
# _support/lazy.py does at run time. One name a line, as `ruff format` keeps it.
from .._support.statistics import ErrorStatistics as ErrorStatistics
from .components import Lag as Lag
from .components import LowPass as LowPass
from .components import Notch as Notch
from .components import Pid as Pid
from .components import Repetitive as Repetitive
from .components import StateSpace as StateSpace
from .components import ZeroPhase as ZeroPhase
from .contouring import Contour as Contour
from .contouring import Workspace as Workspace
from .contouring import contour as contour
from .contouring import workspace as workspace
from .controller import Controller as Controller
from .linear_systems import to_control as to_control
from .plant import Plant as Plant
from .session import Command as Command
from .session import RefusedReadings as RefusedReadings
from .session import Session as Session
from .stability import LoopCheck as LoopCheck
from .stability import LoopReport as LoopReport
from .stability import LoopResponse as LoopResponse
from .stability import check_loop as check_loop
from .tracking import Metrics as Metrics
from .tracking import Tracking as Tracking
from .tracking import track as track
