"""The judge of the fuzzers sees every fault: without that, no failures would mean nothing."""

from __future__ import annotations

import itertools
import math
import warnings
from typing import TYPE_CHECKING, Any

import numpy as np
import pytest

import piezotrack as pt
from soak import (
    NAMES,
    PACKAGE,
    REFUSED,
    Script,
    Tally,
    literal,
    not_finite,
    repeated,
    table,
    verdict_of,
)

if TYPE_CHECKING:
    from collections.abc import Callable


def raising(error: BaseException) -> Callable[[], object]:
    def call() -> object:
        raise error

    return call


class Panic(BaseException):
    """As PyO3 raises one."""


@pytest.mark.parametrize(
    ("call", "fault"),
    [
        (raising(TypeError("x")), "TypeError outside: x"),
        (raising(Panic("please report")), "Panic: please report"),
        (raising(MemoryError("x" * 600)), "message too long"),
        (raising(MemoryError("a\x1b[31m")), "raw control character in a message"),
        (raising(pt.NumericalError("please report this")), "panic"),
        (lambda: warnings.warn("odd", RuntimeWarning, stacklevel=1), "RuntimeWarning: odd"),
        (lambda: np.float64(1e308) * 10, "RuntimeWarning: overflow encountered in scalar multiply"),
    ],
)
def test_a_fault_is_named(call: Callable[[], object], fault: str) -> None:
    assert verdict_of(call)[0] == [fault]


def test_a_fault_of_the_package_is_told_from_one_beside_it() -> None:
    """Also where the checkout is in a folder of its name, as that of this code pretends to be."""
    beside: dict[str, Any] = {}
    exec(
        compile("def fail(): raise TypeError('x')", "/piezotrack/tests/helpers/x.py", "exec"),
        beside,
    )
    assert verdict_of(beside["fail"])[0] == ["TypeError outside: x"]
    source = str(PACKAGE / "control" / "controller.py")
    exec(compile("def fail(): raise TypeError('x')", source, "exec"), beside)
    assert verdict_of(beside["fail"])[0] == ["TypeError in controller.py:fail: x"]


def test_an_error_of_an_argument_has_its_name() -> None:
    faults, _ = verdict_of(raising(pt.ParameterError("dt is 0: expected more")))
    assert [fault.partition(" outside")[0] for fault in faults] == ["no argument"]


def test_what_may_come_is_no_fault() -> None:
    assert verdict_of(lambda: 1) == ([], 1)
    assert verdict_of(raising(pt.ParameterError("dt", "0", "more"))) == ([], REFUSED)
    assert verdict_of(raising(MemoryError())) == ([], REFUSED)


def test_results_are_searched_for_numbers_that_are_not_finite() -> None:
    stage = pt.DahlStage.xu_li_2010()
    assert not list(not_finite(stage.simulate([0.0, 1.0], 0.01)))
    assert list(not_finite((1.0, [np.array([1.0, math.nan])]))) == [".1.0"]
    assert list(not_finite(pt.stages.StageState(x=math.inf))) == [".x"]


def test_another_result_is_seen() -> None:
    counter = itertools.count()
    assert repeated(lambda: float(next(counter)), -1.0) == ["differs when repeated"]
    assert repeated(lambda: np.zeros(3), np.zeros(3)) == []
    assert repeated(lambda: np.zeros(3), -np.zeros(3)) == ["differs when repeated"]


def test_a_script_makes_its_calls_again() -> None:
    tally = Tally("made")
    script = Script(tally)
    controller = script.new("pt.Controller", dt=0.02, limits=(0.0, 75.0))
    session = script.on(controller, "start", again=False)
    volts = script.on(session, "step", 1e-5, math.nan, feedforward=np.float64(3.0), again=False)
    script.on(session, "step", "x", 0.0)
    assert script.refused
    script.judge(volts > 5.0, "too low", "{} > 5")
    assert tally.row() == ("made", 4, 3, 1, 0, 1)
    text = tally.finds[0].replace("assert v3 > 5", "").replace(script.text().split("\n")[3], "")
    names: dict[str, Any] = dict(NAMES)
    exec(text, names)
    assert names["v2"] == volts == 3.0
    with pytest.raises(AssertionError, match="1 x too low"):
        tally.verdict()


@pytest.mark.parametrize(
    "value",
    [
        *(None, True, 10**400, -math.inf, "a\x00", b"1", 1j, [], (1.0,), {"a": [1.0]}),
        *(np.float32(1.5), np.int8(3), np.bool_(True), np.arange(3.0), np.zeros(2, np.float16)),
        pt.control.Lag(),
    ],
)
def test_a_value_is_written_as_it_is(value: Any) -> None:
    again = eval(literal(value), dict(NAMES))
    assert type(again) is type(value)
    assert np.array_equal(again, value) if isinstance(value, np.ndarray) else again == value


def test_the_table_adds_up() -> None:
    assert table([("b", 1000, 1, 2, 0, 0), ("a", 2345, 1, 0, 4, 5)]).splitlines()[2:] == [
        "| a | 2 345 | 1 | 0 | 4 | 5 |",
        "| b | 1 000 | 1 | 2 | 0 | 0 |",
        "| all | 3 345 | 2 | 2 | 4 | 5 |",
    ]
