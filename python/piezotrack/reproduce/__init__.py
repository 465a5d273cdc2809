"""``piezotrack reproduce``: every figure and table of Xu and Li 2010, published beside obtained."""

from .apparatus import Apparatus
from .observables import Observable, Obtained
from .reproduction import Reproduction, reproduce_xu_li_2010

__all__ = ["Apparatus", "Observable", "Obtained", "Reproduction", "reproduce_xu_li_2010"]
