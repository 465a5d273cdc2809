# The public names and their homes, each written once: type checkers read them here, and
# _support/lazy.py does at run time. One name a line, as `ruff format` keeps it.
from .approximation import MultiAxisResponse as MultiAxisResponse
from .approximation import approximate_axes as approximate_axes
from .distortion import Distortion as Distortion
from .distortion import ModalForce as ModalForce
from .distortion import Regressors as Regressors
from .identify import identify_axes as identify_axes
from .loop.closed_loop import AxesMargins as AxesMargins
from .loop.closed_loop import MultiAxisTracking as MultiAxisTracking
from .loop.closed_loop import check_axes as check_axes
from .loop.closed_loop import track_axes as track_axes
from .loop.decoupling import decoupling_matrix as decoupling_matrix
from .loop.decoupling import repeating_drive as repeating_drive
from .modal_model import AxesLevel as AxesLevel
from .modal_model import MultiAxisModel as MultiAxisModel
from .modal_model import MultiAxisMotion as MultiAxisMotion
from .modal_terms import ModalTerms as ModalTerms
from .model_file import load_axes as load_axes
from .reading import read_axes as read_axes
from .record import MultiAxisRecord as MultiAxisRecord
from .virtual import VirtualAxes as VirtualAxes
