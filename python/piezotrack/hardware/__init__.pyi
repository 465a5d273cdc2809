# The public names and their homes, each written once: type checkers read them here, and
# _support/lazy.py does at run time. One name a line, as `ruff format` keeps it.
from ..adapters.epics import ophyd_player as ophyd_player
from ..adapters.epics import serve_epics as serve_epics
from ..adapters.firmware.device import FirmwareDevice as FirmwareDevice
from ..adapters.gcs.device import GcsDevice as GcsDevice
from ..adapters.ni import NiDevice as NiDevice
from ..adapters.scpi import ScpiBuffer as ScpiBuffer
from ..adapters.scpi import ScpiDevice as ScpiDevice
from ..adapters.simulators.converters import Converters as Converters
from ..adapters.simulators.gcs.server import GcsServer as GcsServer
from ..adapters.simulators.virtual_scpi import VirtualScpi as VirtualScpi
from .addresses import connect as connect
from .device import Device as Device
from .device import Exchanging as Exchanging
from .device import Rates as Rates
from .device import Record as Record
from .excitations import Drive as Drive
from .excitations import decaying as decaying
from .excitations import parse_drive as parse_drive
from .measuring import measure as measure
from .pacing import RoundTrip as RoundTrip
from .pacing import play_paced as play_paced
from .pacing import round_trip as round_trip
from .virtual import VirtualDevice as VirtualDevice
