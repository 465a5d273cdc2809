# The public names and their homes, each written once: type checkers read them here, and
# _support/lazy.py does at run time. One name a line, as `ruff format` keeps it.
from .addresses import connect as connect
from .device import Device as Device
from .device import Exchanging as Exchanging
from .device import Rates as Rates
from .device import Record as Record
from .drives import Drive as Drive
from .drives import decaying as decaying
from .drives import parse_drive as parse_drive
from .epics import ophyd_player as ophyd_player
from .epics import serve_epics as serve_epics
from .gcs.device import GcsDevice as GcsDevice
from .gcs.server import GcsServer as GcsServer
from .measuring import measure as measure
from .ni import NiDevice as NiDevice
from .pacing import RoundTrip as RoundTrip
from .pacing import play_paced as play_paced
from .pacing import round_trip as round_trip
from .scpi import ScpiBuffer as ScpiBuffer
from .scpi import ScpiDevice as ScpiDevice
from .virtual import VirtualDevice as VirtualDevice
from .virtual_scpi import VirtualScpi as VirtualScpi
