# The public names and their homes, each written once: type checkers read them here, and
# _support/lazy.py does at run time. One name a line, as `ruff format` keeps it.
from .moves import move as move
from .parse import parse_path as parse_path
from .parse import parse_reference as parse_reference
from .paths import circle as circle
from .paths import lissajous as lissajous
from .paths import raster as raster
from .paths import spiral as spiral
from .reference import Reference as Reference
from .reference import SampledReference as SampledReference
from .reference import read_reference as read_reference
from .waveforms import chirp as chirp
from .waveforms import multisine as multisine
from .waveforms import sine as sine
from .waveforms import staircase as staircase
from .waveforms import triangle as triangle
from .xy_reference import XYReference as XYReference
from .xy_reference import read_path as read_path
