# The public names and their homes, each written once: type checkers read them here, and
# _support/lazy.py does at run time. One name a line, as `ruff format` keeps it.
from .device import GcsDevice as GcsDevice
from .device import from_address as from_address
from .server import GcsServer as GcsServer
