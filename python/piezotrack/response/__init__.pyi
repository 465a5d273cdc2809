# The public names and their homes, each written once: type checkers read them here, and
# _support/lazy.py does at run time. One name a line, as `ruff format` keeps it.
from .excitation import RandomPhaseMultisine as RandomPhaseMultisine
from .measuring import frequency_response as frequency_response
from .modal_fit import ModalFit as ModalFit
from .modal_fit import fit_modes as fit_modes
from .response_data import FrequencyResponse as FrequencyResponse
from .response_file import load_response as load_response
from .views.response_plot import plot_amplitudes as plot_amplitudes
