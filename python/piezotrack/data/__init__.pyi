# The public names and their homes, each written once: type checkers read them here, and
# _support/lazy.py does at run time. One name a line, as `ruff format` keeps it.
from . import datasets as datasets
from .checks.drive_features import Determination as Determination
from .checks.drive_features import DriveFeatures as DriveFeatures
from .checks.drive_features import TimeFeatures as TimeFeatures
from .checks.log_info import ColumnInfo as ColumnInfo
from .checks.log_info import LogInfo as LogInfo
from .checks.log_info import info as info
from .dataset import Dataset as Dataset
from .reader import DriveRecord as DriveRecord
from .reader import read as read
from .reader import read_drive as read_drive
