# The public names and their homes, each written once: type checkers read them here, and
# _support/lazy.py does at run time. One name a line, as `ruff format` keeps it.
from .apparatus import Apparatus as Apparatus
from .experiments.table_2 import Table2 as Table2
from .experiments.table_2 import run_table_2 as run_table_2
from .reproduction import Reproduction as Reproduction
from .reproduction import reproduce as reproduce
