"""Arrays of every layout, type and shape, at every public function that takes one.

The answer has the bits of that for a contiguous copy as float64, or is the same refusal. A new
function is one more line of a table.
"""

from __future__ import annotations

import contextlib
import dataclasses
import inspect
import json
import re
import tempfile
import warnings
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal, NamedTuple

import hypothesis.extra.numpy as arrays
import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

import piezotrack as pt
from all_stages import STAGES

if TYPE_CHECKING:
    from collections.abc import Callable

    from numpy.typing import NDArray

    Array = NDArray[Any]

DT = 0.01
CIRCLE = pt.circle(frequency=0.1, radius=10e-6)
FIGURE = pt.lissajous(frequencies=(0.2, 0.3), sizes=(20e-6, 20e-6))
VIRTUAL = dataclasses.replace(pt.VirtualStage.xu_li_2010(), preconditioning=None, step=1e-3)
XY = pt.XYStage(x=VIRTUAL, y=VIRTUAL, cross_talk=(0.01, 0.02))
MODEL = pt.identification.IdentifiedModel(
    model=STAGES["prandtl-ishlinskii"],
    offset=1e-6,
    offset_fitted=True,
    scale_assumed=False,
    stroke=1e-4,
    delay=0.004,
)
# A record that the model is judged on.
RECORD = pt.Dataset(u=np.linspace(0.0, 10.0, 40), y=np.linspace(0.0, 1e-5, 40), dt=DT)


class Taker(NamedTuple):
    """A function of one array, or of several alike; its answer is whatever holds numbers."""

    call: Callable[..., Any]
    arrays: int = 1
    # Factor on volts, where the function takes something else.
    scale: float = 1.0


def exported(table: Any) -> Any:
    """The table of a feedforward as a file has it."""
    loop = pt.Controller(dt=DT, limits=(-1e9, 1e9))
    with tempfile.TemporaryDirectory() as folder:
        done = pt.control.export_controller(loop, folder, to="json", table=table)
        return json.loads(done.files[0].read_text(encoding="utf-8"))["feedforward_table_V"]


TAKERS: dict[str, Taker] = {
    **{
        f"{name}.simulate": Taker(lambda u, stage=stage: stage.simulate(u, DT, accuracy=1e-7))
        for name, stage in STAGES.items()
    },
    "DahlStage.simulate, rk45": Taker(
        lambda u: pt.DahlStage.xu_li_2010().simulate(u, DT, method="rk45", accuracy=1e-6)
    ),
    "VirtualStage.simulate": Taker(lambda u: VIRTUAL.simulate(u, DT)),
    "measure": Taker(
        lambda u: pt.measure(pt.hardware.VirtualDevice(VIRTUAL, limits=(-1e9, 1e9)), u, 1.0 / DT).y
    ),
    "control.export_controller": Taker(exported),
    "VirtualStage.record": Taker(lambda u: VIRTUAL.record(u, DT).y),
    "XYStage.simulate": Taker(lambda u, w: XY.simulate(u, w, DT), arrays=2),
    "XYStage.record": Taker(lambda u, w: XY.record(u, w, DT).y.y, arrays=2),
    "IdentifiedModel.extrapolation_notes": Taker(
        lambda u: np.array([len(MODEL.extrapolation_notes(u, DT))])
    ),
    "IdentifiedModel.displacement": Taker(lambda u: MODEL.displacement(u, DT)),
    "IdentifiedModel.prediction_band": Taker(
        lambda u: MODEL.prediction_band(u, DT, records=[RECORD]).upper
    ),
    "Dataset": Taker(
        lambda u, y, c: (
            (log := pt.Dataset(u=u, y=y, dt=DT, columns={"c": c})).columns["c"] + log.u + log.y
        ),
        arrays=3,
    ),
    "Dataset, t": Taker(lambda t: pt.Dataset(u=t, y=t, t=t).t),
    "Reference.from_samples": Taker(
        lambda x: pt.Reference.from_samples(x, DT).sample(DT), scale=1e-6
    ),
    "IterativeLearning.update": Taker(
        lambda y: pt.control.IterativeLearning(
            STAGES["prandtl-ishlinskii"],
            pt.sine(frequency=1.0, low=0.0, high=10e-6, duration=1.0),
            pt.Controller(dt=0.1, limits=(0.0, 75.0)),
        ).update(y),
        scale=1e-6,
    ),
    "Reference.at": Taker(lambda t: CIRCLE.x.at(t), scale=0.1),
    "XYReference.errors, circle": Taker(CIRCLE.errors, arrays=2, scale=1e-6),
    "XYReference.errors, path": Taker(FIGURE.errors, arrays=2, scale=1e-6),
    "staircase, levels": Taker(
        lambda levels: pt.staircase(levels=levels, dwell=0.1).sample(DT), scale=1e-6
    ),
    "multisine, frequencies": Taker(
        lambda f: pt.multisine(frequencies=f, low=0.0, high=1e-5, duration=1.0).sample(1e-3)
    ),
    "multisine, amplitudes": Taker(
        lambda a: pt.multisine(
            frequencies=[1.0, 2.0, 3.5], amplitudes=a, offset=0.0, duration=1.0
        ).sample(1e-3),
        scale=1e-6,
    ),
    "control.StateSpace": Taker(
        lambda b: (
            pt.Controller(
                dt=DT,
                limits=(0.0, 75.0),
                feedback=pt.control.StateSpace([[0.5]], b, b),
            )
            .start()
            .step(1e-5, 0.0)
        )
    ),
    # Without these the functions of the binding are reached by arrays of the package only.
    "_core.delayed": Taker(lambda x, v: pt._core.delayed(x, v, DT, 0.013), arrays=2),
    "_core.tracking_metrics": Taker(
        lambda x, y: pt._core.tracking_metrics(x, y, DT, None), arrays=2
    ),
    "_core.period_metrics": Taker(lambda x, y: pt._core.period_metrics(x, y, DT, 0.05), arrays=2),
    "_core.residual": Taker(lambda e: pt._core.residual(e, 1)),
    "_core.spread": Taker(lambda e: pt._core.spread(e)),
    "_core.cross_talk_share": Taker(lambda x, y: pt._core.cross_talk_share(x, y), arrays=2),
    "_core.sensor_noise": Taker(lambda x: pt._core.sensor_noise(x, DT)),
    "_core.turns": Taker(lambda x: pt._core.turns(x, 1.0)),
    "_core.read_step": Taker(lambda u, y: pt._core.read_step(u, y, DT, "foh").readings(), arrays=2),
    "_core.Inverse.along": Taker(
        lambda x, v, a: pt.DahlStage.xu_li_2010().inverse()._begun(DT).along(x, v, a),
        arrays=3,
        scale=1e-6,
    ),
}


def outcome(taker: Taker, given: tuple[Any, ...]) -> tuple[Any, ...]:
    """The bits of the answer, or the refusal; nothing else may happen."""
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        try:
            return ("answer", *bits(taker.call(*given)))
        except pt.PiezotrackError as error:
            return ("refusal", type(error).__name__, str(error))


def bits(answer: Any) -> list[bytes]:
    if dataclasses.is_dataclass(answer) and not isinstance(answer, pt.stages.Stage):
        return bits([getattr(answer, field.name) for field in dataclasses.fields(answer)])
    if isinstance(answer, (list, tuple)):
        return [one for part in answer for one in bits(part)]
    return [np.asarray(answer).tobytes() if not isinstance(answer, str) else answer.encode()]


def field(values: Array, before: int, behind: int, order: Literal["<", ">"]) -> Array:
    """A field of packed records, as `numpy.fromfile` gives them of a binary log."""
    layout: Any = {
        "names": ["u"],
        "formats": [values.dtype.newbyteorder(order)],
        "offsets": [before],
        "itemsize": before + values.itemsize + behind,
    }
    kind: np.dtype[Any] = np.dtype(layout)
    records = np.frombuffer(b"\xa5" * (kind.itemsize * values.size), kind).copy()
    records["u"] = values
    return np.asarray(records["u"])


def unaligned(values: Array, offset: int) -> Array:
    raw = np.frombuffer(bytearray(offset) + values.tobytes(), np.uint8)
    return raw[offset:].view(values.dtype)


def stepped(values: Array, step: int) -> Array:
    """Every so many entries of a longer array; from its end where `step` is below 0."""
    longer = np.full(values.size * abs(step), 7, values.dtype)
    view = longer[::step][: values.size]
    view[:] = values
    return view


def read_only(values: Array) -> Array:
    copy = values.copy()
    copy.setflags(write=False)
    return copy


def row_of_two_dimensions(values: Array) -> Array:
    both: Array = np.asfortranarray(np.stack([values, values + 1]))
    return both[0, :]


BYTES = st.integers(0, 13)
BOTH: list[Literal["<", ">"]] = ["<", ">"]
ORDERS = st.sampled_from(BOTH)
LAYOUTS: st.SearchStrategy[Callable[[Array], Any]] = st.one_of(
    st.tuples(BYTES, BYTES, ORDERS).map(lambda chosen: lambda values: field(values, *chosen)),
    st.integers(1, 15).map(lambda offset: lambda values: unaligned(values, offset)),
    st.sampled_from([-3, -2, -1, 1, 2, 5]).map(lambda step: lambda values: stepped(values, step)),
    st.sampled_from([read_only, row_of_two_dimensions, np.ma.masked_array, np.copy]),
    ORDERS.map(lambda order: lambda values: values.astype(values.dtype.newbyteorder(order))),
)
KINDS = st.sampled_from(["f8", "f8", "f4", "f2", "g", "u1", "i1", "u2", "i2", "i4", "i8", "u8"])
SIZES = st.integers(0, 40)
# Odd values, which only the wider types have.
ODD = st.sampled_from([np.nan, np.inf, -np.inf, 1e300, -0.0, 5e-324])


@st.composite
def values(draw: st.DrawFn) -> Array:
    kind = np.dtype(draw(KINDS))
    # Whole volts are exact in every type; all are different, and small enough for each function.
    drawn: Array = draw(
        arrays.arrays(np.int64, draw(SIZES), elements=st.integers(0, 75), fill=st.nothing())
    )
    floats = drawn.astype(kind)
    if kind == np.float64 and drawn.size and draw(st.integers(0, 9)) == 0:
        floats[draw(st.integers(0, drawn.size - 1))] = draw(ODD)
    return floats


@pytest.mark.parametrize("name", TAKERS)
@settings(max_examples=25, deadline=None, suppress_health_check=list(HealthCheck))
@given(values=values(), layout=LAYOUTS)
def test_the_layout_of_an_array_changes_nothing(
    name: str, values: Array, layout: Callable[[Array], Any]
) -> None:
    taker = TAKERS[name]
    with np.errstate(over="ignore", under="ignore"):
        if values.dtype.kind == "f" and taker.scale != 1.0:
            values = (values * taker.scale).astype(values.dtype)
    plain = np.array(values, dtype=np.float64)
    expected = outcome(taker, (plain,) * taker.arrays)
    assert outcome(taker, (layout(values),) * taker.arrays) == expected


WRONG: dict[str, Any] = {
    "no dimension": np.float64(1.0),
    "two dimensions": np.zeros((3, 3)),
    "many dimensions": np.zeros((1,) * 32),
    "masked": np.ma.array(np.ones(9), mask=[False] * 8 + [True]),
    "complex": np.ones(9, dtype=complex),
    "text": np.array(["1"] * 9),
    "objects": np.array([1, None, 10**400] * 3),
    "times": np.array(["2026-01-01"] * 9, dtype="datetime64[D]"),
    "a hundred billion": np.broadcast_to(1.0, (10**11,)),
    "beyond float64": np.full(9, np.longdouble("1e4000")),
}


@pytest.mark.parametrize("wrong", WRONG)
@pytest.mark.parametrize("name", TAKERS)
def test_what_is_no_array_of_numbers_is_refused_in_words(name: str, wrong: str) -> None:
    if name == "Reference.at" and wrong in ("no dimension", "two dimensions", "many dimensions"):
        pytest.skip("times may have any shape")
    if wrong in ("no dimension", "many dimensions") and name.partition(",")[0] in (
        "multisine",
        "control.StateSpace",
    ):
        pytest.skip("one number is a list of one")
    taker = TAKERS[name]
    found = outcome(taker, (WRONG[wrong],) * taker.arrays)
    assert found[0] == "refusal", found[:1]
    assert len(found[2]) < 500


class Interrupting:
    """What asks for an array while Ctrl-C is pressed."""

    size = 3

    def __array__(self, dtype: Any = None, copy: Any = None) -> Array:
        del dtype, copy
        raise KeyboardInterrupt


@pytest.mark.parametrize("name", ["dahl.simulate", "Dataset", "XYReference.errors, circle"])
def test_an_interruption_is_no_fault_of_the_array(name: str) -> None:
    taker = TAKERS[name]
    with pytest.raises(KeyboardInterrupt):
        taker.call(*[Interrupting()] * taker.arrays)


def test_an_interruption_is_no_fault_of_a_number() -> None:
    class Number:
        def __float__(self) -> float:
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        pt.sine(frequency=Number(), low=0.0, high=1e-5, duration=1.0)  # type: ignore[arg-type]


# Matrices of 2 by 2, which no record gives.
NO_RECORD = (
    *("XYReference.transformed", "contour", "run_table_2", "control.StateSpace"),
    "control.MixedSensitivity",
    *("Objective.descend", "Objective.parameters"),
)
ROOMS = (pt, pt.control, pt.data, pt.identification, pt.references, pt.stages, pt.xu_li_2010)


def takers() -> set[str]:
    """Names of the public functions and methods with an argument that is like an array."""
    functions = set()
    public = [(name, getattr(room, name)) for room in ROOMS for name in room.__all__]
    for name, public_value in public:
        if inspect.isclass(public_value) and not issubclass(public_value, Exception):
            methods = {f"{name}.{key}": value for key, value in vars(public_value).items()}
            inside = {name: public_value, **methods}
        else:
            inside = {name: public_value}
        for called, value in inside.items():
            function = getattr(value, "__func__", value)
            if callable(function) and not called.rpartition(".")[2].startswith("_"):
                with contextlib.suppress(TypeError, ValueError):
                    if "ArrayLike" in str(inspect.signature(function)):
                        functions.add(called)
    return functions


def test_every_public_function_of_an_array_is_in_the_table() -> None:
    classes = {type(stage).__name__: name for name, stage in STAGES.items()}
    known = {name.partition(",")[0].removeprefix("control.") for name in TAKERS}
    for name in takers() - {one.removeprefix("control.") for one in NO_RECORD}:
        owner, dot, method = name.partition(".")
        owner = classes.get(owner, owner)
        assert owner in ("Identification", "Stage") or owner + dot + method in known, name


def test_buffers_are_touched_in_one_file() -> None:
    for path in (Path(__file__).parents[1] / "rust/py/src").rglob("*.rs"):
        text = path.read_text(encoding="utf-8")
        touches = re.search(r"readonly|as_array|as_slice|PyArrayMethods|PyBuffer", text)
        assert touches is None or path.name == "arrays.rs", path
