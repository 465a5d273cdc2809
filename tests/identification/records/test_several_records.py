"""One model from several records, each with its own offset, delay, beginning and weight."""

from __future__ import annotations

import json
from dataclasses import replace
from functools import cache
from typing import TYPE_CHECKING, Any

import numpy as np
import pytest

import piezotrack as pt
from piezotrack.identification.solve.selecting import selection
from records import search_of, selection_of
from reference import multisine

if TYPE_CHECKING:
    from pathlib import Path

    from numpy.typing import NDArray

    Array = NDArray[np.float64]

# A mode at 60 Hz with a damping ratio of 0.14, in a stage with hysteresis.
STAGE = replace(pt.DahlStage.xu_li_2010(), damping=20.0)
NOISE = 20e-9
# Measured beforehand, as the records here hardly show the shape of the hysteresis.
ASKED: dict[str, Any] = {
    "model": "dahl",
    "parameters": {"stiffness": STAGE.stiffness, "a1": STAGE.a1, "a2": STAGE.a2},
    "history": "virgin",
    "method": pt.Descents(seed=1),
    "progress": False,
}
# Beside records that have a history of their own.
OF_STAGE = {name: value for name, value in ASKED.items() if name != "history"}
SEARCHED = ("mass", "damping", "piezo_coefficient", "b1")


def record(
    u: Array,
    dt: float,
    *,
    offset: float = 0.0,
    late: int = 0,
    seed: int = 0,
    initial: Any = None,
    noise: float = NOISE,
) -> pt.Dataset:
    """A record of the stage: `late` samples behind the drive, with noise."""
    x = STAGE.simulate(u, dt, initial=initial).x
    read = np.concatenate([np.full(late, x[0]), x[: x.size - late]])
    errors = noise * np.random.default_rng(seed).standard_normal(x.size)
    return pt.Dataset(u=u, y=read + offset + errors, dt=dt)


def large(count: int = 1000, dt: float = 4e-3) -> Array:
    """Large loops at 0.5 Hz, which show the hysteresis [V]."""
    u: Array = 37.5 * (1.0 - np.cos(np.pi * dt * np.arange(count)))
    return u


def small(count: int = 1000, dt: float = 5e-4) -> Array:
    """Small quick motions up to 120 Hz, which show the mode [V]."""
    t, rng = dt * np.arange(count), np.random.default_rng(3)
    f = 4.0 * np.arange(1, 31)
    phases = rng.uniform(0.0, 2.0 * np.pi, f.size)
    u: Array = 0.3 * np.cos(2.0 * np.pi * np.outer(t, f) + phases).sum(axis=1)
    u -= u[0]
    return u


@cache
def slow() -> pt.Dataset:
    return record(large(), 4e-3, seed=1)


@cache
def quick() -> pt.Dataset:
    return record(small(), 5e-4, offset=3e-6, seed=2)


@cache
def both() -> pt.identification.Identification:
    return pt.identify([slow(), quick()], **ASKED)


def with_each(records: list[pt.Dataset], **values: Any) -> list[pt.Record]:
    """Records with arguments of their own, each in a list."""
    each = [dict(zip(values, row, strict=True)) for row in zip(*values.values(), strict=True)]
    return [
        pt.Record(data, **{"history": "virgin"} | one)
        for data, one in zip(records, each, strict=True)
    ]


def errors(fit: pt.identification.Identification) -> dict[str, float]:
    """Relative errors of the parameters."""
    return {n: abs(getattr(fit.model, n) / getattr(STAGE, n) - 1.0) for n in SEARCHED}


def weighted(fit: pt.identification.Identification, weights: list[float]) -> float:
    """The cost as NumPy computes it from the motion of the model on each record."""
    squares = samples = 0.0
    for one, weight in zip(fit.records, weights, strict=True):
        assert one.data is not None
        rest = one.data.y - fit.simulate(one.data, offset=one.offset).x
        squares += weight * float(rest @ rest)
        samples += weight * rest.size
    return float(np.sqrt(squares / samples))


def test_two_records_determine_what_neither_does_alone() -> None:
    alone = [pt.identify(one, **ASKED) for one in (slow(), quick())]
    # The slow one has nothing of the mode, the quick one little of the hysteresis.
    assert alone[0].parameters["mass"].deviation == np.inf
    assert errors(alone[0])["mass"] > 0.5
    assert (alone[1].parameters["b1"].deviation or 0.0) > 0.03 * STAGE.b1
    off, least = errors(both()), {"mass": 5e-4, "damping": 2e-3, "b1": 2e-3}
    assert off["piezo_coefficient"] < 3e-4
    for name, most in least.items():
        assert off[name] < most, name
        estimate = both().parameters[name]
        assert estimate.identified
        assert estimate.deviation is not None
        # The deviations say how far the values are off, and so they are normal ones.
        assert abs(estimate.value - getattr(STAGE, name)) < 4.0 * estimate.deviation, name
    assert errors(alone[0])["damping"] > 5.0 * off["damping"]
    assert both().cost == pytest.approx(NOISE, rel=0.05)


def test_the_cost_is_the_weighted_rms_of_all_samples() -> None:
    assert both().cost == pytest.approx(weighted(both(), [1.0, 1.0]), rel=1e-3)
    counts = [len(slow()), len(quick())]
    costs = [one.cost for one in both().records]
    assert both().cost == pytest.approx(np.sqrt(np.average(np.square(costs), weights=counts)))
    # Unequal windows and weights, on a model that does not fit them.
    parts = [slow()[0.4:2.0], quick()]
    given = OF_STAGE | {"parameters": ASKED["parameters"] | {"b1": 0.0}}
    fit = pt.identify(with_each(parts, weight=[3.0, 0.5]), **given)
    assert fit.records[0].cost > 10.0 * NOISE
    assert fit.cost == pytest.approx(weighted(fit, [3.0, 0.5]), rel=1e-3)
    assert [one.weight for one in fit.records] == [3.0, 0.5]


def test_each_record_has_its_own_score_offset_and_stroke() -> None:
    fit = both()
    assert [one.offset for one in fit.records] == pytest.approx([0.0, 3e-6], abs=5e-9)
    assert (fit.offset, fit.data, fit.start) == (
        fit.records[0].offset,
        slow(),
        fit.records[0].start,
    )
    assert [one.stroke for one in fit.records] == [slow().stroke, quick().stroke]
    assert fit.stroke == slow().stroke
    for fitted, score, data in zip(fit.records, fit.scores, (slow(), quick()), strict=True):
        assert score.rms == pytest.approx(fitted.cost, rel=1e-3)
        assert score.stroke == data.stroke
        # A record that was fitted is known again, and gets the offset that suits it.
        assert fit.score(data).offset == pytest.approx(fitted.offset, abs=1e-10)
        assert fit.fitted_on(data)
    assert fit.drive_range == (min(quick().u), max(slow().u))


def test_no_state_goes_from_one_record_to_the_next() -> None:
    # The first ends with the stage far from rest; the second begins at rest.
    ends_high = record(large(750), 4e-3, seed=1)
    assert ends_high.u[-1] > 70.0
    fit = pt.identify([ends_high, quick()], **ASKED)
    other_way = pt.identify([quick(), ends_high], **ASKED)
    for name in SEARCHED:
        assert getattr(other_way.model, name) == pytest.approx(getattr(fit.model, name), rel=1e-6)
    assert other_way.cost == pytest.approx(fit.cost, rel=1e-9)
    costs = [one.cost for one in fit.records]
    assert [one.cost for one in reversed(other_way.records)] == pytest.approx(costs, rel=1e-6)
    # The same model alone on each record: nothing of the other is in its score.
    for fitted in fit.records:
        assert fitted.data is not None
        assert fitted.start is not None
        assert fitted.start.state.x == 0.0
        alone = pt.identification.IdentifiedModel(
            model=fit.model, offset=fitted.offset, offset_fitted=True, stroke=fitted.stroke
        )
        assert alone.score(fitted.data, history="virgin").rms == pytest.approx(
            fitted.cost, rel=1e-3
        )
    # Were the second one simulated from where the first one ended, it would be far off.
    end = fit.model.simulate(ends_high.u, ends_high.dt).final
    carried = fit.score(quick(), initial=replace(end, v=0.0))
    assert carried.rms > 10.0 * fit.records[1].cost


def test_offsets_and_delays_of_their_own() -> None:
    dt = 1e-3
    u = multisine(2000, dt, 0.5)
    u = u - u[0]
    first = record(u, dt, seed=3)
    second = record(0.7 * u[::-1] - 0.7 * u[-1], dt, offset=3e-6, late=5, seed=4)
    settings = ASKED | {"parameters": ASKED["parameters"] | {"b1": STAGE.b1}}
    of_stage = OF_STAGE | {"parameters": settings["parameters"]}
    fit = pt.identify(with_each([first, second], delay=[0.0, True]), **of_stage)
    assert [one.delay for one in fit.records] == [0.0, pytest.approx(5e-3, abs=2e-5)]
    assert [one.offset for one in fit.records] == pytest.approx([0.0, 3e-6], abs=1e-8)
    assert fit.delay == 0.0
    assert "delay" not in fit.parameters
    spread = fit.records[1].parameters["delay"].deviation
    assert spread is not None
    assert 0.0 < spread < 2e-5
    assert fit.model.mass == pytest.approx(STAGE.mass, rel=5e-3)
    for one in fit.records:
        assert one.data is not None
        assert fit.score(one.data).rms == pytest.approx(one.cost, rel=1e-2)
    # One delay for both, or no offset, is worse.
    assert pt.identify([first, second], delay=0.0, **settings).cost > 5.0 * fit.cost
    fixed = pt.identify(
        with_each([first, second], delay=[0.0, 5e-3], offset=[True, False]), **of_stage
    )
    assert fixed.records[1].offset == 0.0
    assert fixed.records[1].cost > 2e-6
    # As the records are, also where both delays are fitted.
    free = pt.identify([second, first], delay=True, **settings)
    assert [one.delay for one in free.records] == pytest.approx([5e-3, 0.0], abs=2e-5)


def test_histories_of_their_own() -> None:
    u = large()
    records = [
        record(u, 4e-3, seed=5),
        record(u, 4e-3, seed=6, initial=STAGE.equilibrium([60.0, 0.0])),
    ]
    settings = ASKED | {"parameters": ASKED["parameters"] | {"mass": STAGE.mass}}
    own_history = {name: value for name, value in settings.items() if name != "history"}
    fit = pt.identify(with_each(records, history=["virgin", "fit"]), **own_history)
    assert [one.start.history for one in fit.records if one.start] == ["virgin", "fit"]
    assert "voltage_before" not in fit.parameters
    assert fit.records[1].parameters["voltage_before"].value == pytest.approx(60.0, abs=2.0)
    assert fit.cost == pytest.approx(NOISE, rel=0.05)
    for one in fit.records:
        assert one.data is not None
        assert fit.score(one.data).rms == pytest.approx(one.cost, rel=1e-2)
    wrong = pt.identify(records, **settings | {"history": "virgin"})
    assert wrong.records[1].cost > 2.0 * fit.records[1].cost
    # The same where nothing is said: what each record shows.
    shown = pt.identify(records, **settings | {"history": None})
    assert [one.start.history for one in shown.records if one.start] == ["virgin", "fit"]
    assert shown.cost == pytest.approx(fit.cost, rel=1e-3)


def test_a_weight_of_two_is_a_record_given_twice() -> None:
    heavy = pt.identify(with_each([slow(), quick()], weight=[2.0, 1.0]), **OF_STAGE)
    twice = pt.identify([slow(), slow(), quick()], **ASKED)
    assert heavy.cost == pytest.approx(twice.cost, rel=1e-9)
    for name in SEARCHED:
        assert getattr(heavy.model, name) == pytest.approx(getattr(twice.model, name), rel=1e-6)
    # Only ratios matter, and a large weight is nearly the record alone.
    tenfold = pt.identify(with_each([slow(), quick()], weight=(20, 10)), **OF_STAGE)
    assert tenfold.cost == pytest.approx(heavy.cost, rel=1e-12)
    alone = pt.identify(quick(), **ASKED)
    most = pt.identify(with_each([slow(), quick()], weight=[1e-9, 1.0]), **OF_STAGE)
    assert most.model.mass == pytest.approx(alone.model.mass, rel=1e-5)


def test_a_list_of_one_is_that_record() -> None:
    alone, listed = (
        pt.identify(slow(), **ASKED),
        pt.identify([pt.Record(slow(), history="virgin", weight=2.0)], **OF_STAGE),
    )
    assert listed.model == alone.model
    assert listed.cost == alone.cost
    assert len(alone.records) == 1
    assert alone.records[0].data is slow()
    assert (alone.records[0].cost, alone.records[0].offset) == (alone.cost, alone.offset)


def test_the_same_bits_on_any_number_of_threads_and_by_a_swarm() -> None:
    again = pt.identify([slow(), quick()], threads=1, **ASKED)
    assert again.model == both().model
    assert search_of(again).history.tobytes() == search_of(both()).history.tobytes()
    swarm = pt.identify([slow(), quick()], **ASKED | {"method": pt.ParticleSwarm(seed=1, runs=1)})
    assert swarm.cost == pytest.approx(both().cost, rel=1e-4)


def test_priors_enter_once() -> None:
    free, (mean, width) = both().parameters["damping"], (20.04, 0.006)
    known = {"damping": pt.Parameter(prior=(mean, width))}
    given = ASKED | {"parameters": ASKED["parameters"] | known}
    pulled = pt.identify([slow(), quick()], **given)
    weights = np.array([1.0 / (free.deviation or np.nan), 1.0 / width]) ** 2
    # The mean of what the records and the prior say, each as precise as it is.
    expected = float(np.average([free.value, mean], weights=weights))
    assert pulled.model.damping == pytest.approx(expected, abs=0.1 * abs(mean - free.value))
    minimised = search_of(pulled).cost_with_priors
    assert minimised is not None
    assert minimised > pulled.cost == pytest.approx(both().cost, rel=0.01)
    # Weights are shares: the same for both change nothing.
    again = pt.identify(
        with_each([slow(), quick()], weight=[7.0, 7.0]),
        **OF_STAGE | {"parameters": given["parameters"]},
    )
    assert again.model.damping == pytest.approx(pulled.model.damping, rel=1e-9)


def test_a_file_keeps_the_records(tmp_path: Path) -> None:
    dt = 1e-3
    u = multisine(1000, dt, 0.5)
    first, second = record(u - u[0], dt, seed=3), record(u - u[0], dt, late=5, seed=4)
    fit = pt.identify(with_each([first, second], delay=[0.0, 5e-3], weight=[1, 2]), **OF_STAGE)
    path = fit.save(tmp_path / "two.json")
    read = pt.load(path)
    for fitted, kept in zip(fit.records, read.records, strict=True):
        assert kept.data is None
        assert (kept.weight, kept.delay, kept.offset) == (
            fitted.weight,
            fitted.delay,
            fitted.offset,
        )
        assert (kept.start, kept.cost, kept.stroke) == (fitted.start, fitted.cost, fitted.stroke)
    for data in (first, second, first[0.2:0.7]):
        assert read.score(data) == fit.score(data)
        assert np.array_equal(read.simulate(data).x, fit.simulate(data).x)
    # Each with its own delay.
    assert fit.score(second).rms < 2.0 * NOISE
    assert read.fitted_on(second)
    assert read.free_count == fit.free_count == len(SEARCHED) + 2
    written = json.loads(path.read_text(encoding="utf-8"))
    assert json.loads(json.dumps(read.document())) == written
    assert json.loads(json.dumps(fit.document())) == written
    # A file of one record says nothing of records.
    alone = pt.load(pt.identify(first, **ASKED).save(tmp_path / "one.json"))
    assert (alone.records, "records" in alone.document()) == ((), False)


def test_a_file_with_broken_records_is_refused(tmp_path: Path) -> None:
    document = both().document()
    for change, message in (
        ({"records": 3}, "two.json: records is int: expected a list of records"),
        ({"records": [{}, {}]}, "two.json: the entry 'weight' is missing"),
    ):
        path = tmp_path / "two.json"
        path.write_text(json.dumps(document | change), encoding="utf-8")
        with pytest.raises(pt.DataError, match=r"two\.json") as caught:
            pt.load(path)
        assert str(caught.value) == message
    document["records"][1]["delay"]["unit"] = "ms"
    path.write_text(json.dumps(document), encoding="utf-8")
    with pytest.raises(
        pt.DataError, match=r"the unit of records\[1\]: delay is 'ms': expected 's'"
    ):
        pt.load(path)


def test_summary_table_and_pictures_show_every_record() -> None:
    fit = both()
    text = fit.summary()
    assert "from 2 records" in text
    for one in fit.records:
        assert f"({one.cost_percent:.3g} % of stroke), largest " in text
    page = fit._repr_html_()
    assert page.count("<th") >= 8
    assert all(f"{one.cost_percent:.3g}" in page for one in fit.records)
    figure = fit.plot()
    loops = [ax for ax in figure.axes if ax.get_xlabel() == "drive [V]"]
    assert len(loops) == 2
    assert len(figure.axes) == 7
    # One record of the two.
    assert len(fit.plot(quick()).axes) == 4


def test_the_best_kind_is_chosen_on_the_rest_of_each_record() -> None:
    dt = 4e-3
    records = [record(large(2000, dt), dt, seed=1), record(0.5 * large(2000, dt), dt, seed=2)]
    fit = pt.identify(records, method=pt.Descents(seed=1), history="virgin", progress=False)
    chosen = selection_of(fit)
    assert chosen.trials
    assert {one.model for one in chosen.trials} <= {*selection.LEAST_SQUARES, *selection.SEARCHED}
    assert chosen.trials[0].rms <= chosen.trials[-1].rms
    assert 0.4 < chosen.fitted_until / records[0].duration < 0.8
    assert len(fit.records) == 2
    assert [one.data for one in fit.records] == records


def test_an_interrupted_search_keeps_the_best() -> None:
    with pytest.raises(pt.Interrupted) as caught:
        pt.identify([slow(), quick()], callback=lambda now: now.nit >= 2, **ASKED)
    partial = caught.value.partial
    assert partial is not None
    assert len(partial.records) == 2
    assert partial.cost == pytest.approx(weighted(partial, [1.0, 1.0]), rel=1e-2)


def test_a_search_of_several_goes_on_from_its_checkpoint(tmp_path: Path) -> None:
    kept = tmp_path / "search.checkpoint"
    with pytest.raises(pt.Interrupted):
        pt.identify([slow(), quick()], callback=lambda now: now.nit >= 2, checkpoint=kept, **ASKED)
    on = pt.identify([slow(), quick()], checkpoint=kept, **ASKED)
    assert on.model == both().model
    assert on.records == tuple(
        replace(one, data=other.data) for one, other in zip(both().records, on.records, strict=True)
    )
    with pytest.raises(pt.DataError):
        pt.identify([quick(), slow()], checkpoint=kept, **ASKED)


def test_windows_of_one_log_are_told_apart() -> None:
    log = record(large(1500), 4e-3, seed=7)
    late = pt.Dataset(u=log.u, y=log.y, dt=log.dt)
    fit = pt.identify(with_each([log[0.0:2.0], late[3.0:5.0]], offset=[True, False]), **OF_STAGE)
    for window, i in ((log[0.5:1.5], 0), (log[3.5:4.5], 1), (log[3.0:5.0], 1)):
        assert fit.score(window).stroke == fit.records[i].stroke
    # No offset where none was fitted.
    assert fit.score(log[3.5:4.5]).offset == 0.0 != fit.score(log[0.5:1.5]).offset


def test_a_lag_that_fits_at_two_rates_is_not_said_to_hold_at_one() -> None:
    stage, dt = pt.DahlStage.xu_li_2010(), 4e-3

    def at(rate: float, count: int = 1000) -> pt.Dataset:
        u = 37.5 * (1.0 - np.cos(2.0 * np.pi * rate * dt * np.arange(count)))
        return pt.Dataset(u=u, y=stage.simulate(u, dt).x, dt=dt)

    # Another kind of stage than the one that made them, so that the residual is not white.
    asked: dict[str, Any] = {"model": "bouc-wen", "history": "virgin", "progress": False}
    for records, message in (([at(0.5), at(0.5, 1200)], True), ([at(0.5), at(2.0)], False)):
        fit = pt.identify(records, **asked)
        assert fit.lags is not None
        assert any("holds at this rate only" in note for note in fit.notes) == message


def of_force() -> pt.Dataset:
    return pt.Dataset(u=slow().u, y=slow().y, dt=slow().dt, drive_unit="N", source="force.csv")


def still() -> pt.Dataset:
    return pt.Dataset(u=slow().u, y=np.zeros(len(slow())), dt=slow().dt, source="dead.csv")


def identified(records: Any, given: dict[str, Any]) -> pt.identification.Identification:
    """Identify, with what is said of all records where none says it of its own."""
    listed = records if isinstance(records, list) else [records]
    own_values = any(isinstance(one, pt.Record) for one in listed)
    return pt.identify(records, **(OF_STAGE if own_values else ASKED) | given)


@pytest.mark.parametrize(
    ("records", "given", "said"),
    [
        (list, {}, "data is an empty list: expected at least one Dataset"),
        (lambda: 3.0, {}, "data is float: expected a Dataset"),
        (lambda: [slow(), 3.0], {}, "data is a list whose record 2 is float: expected a Dataset"),
        (
            lambda: [slow(), of_force()],
            {},
            r"the drive of record 2 \(force.csv\) is in N: expected V, as that of record 1",
        ),
        (lambda: [slow(), still()], {}, r"record 2 \(dead.csv\): the displacement is constant"),
        (lambda: [slow(), quick()[0.0:0.003]], {}, "record 2: the window has 6 samples"),
        (
            lambda: with_each([slow(), quick()], weight=[1.0, 0.0]),
            {},
            "record 2: weight is 0: expected a finite number above 0",
        ),
        (lambda: with_each([slow(), quick()], weight=[1.0, -2.0]), {}, "record 2: weight is -2"),
        (lambda: with_each([slow(), quick()], weight=[np.nan, 1.0]), {}, "record 1: weight is NaN"),
        (lambda: with_each([slow(), quick()], weight=[1.0, "x"]), {}, "weight is 'x'"),
        (lambda: pt.Record(slow()), {"delay": True}, "delay is True: expected it in pt.Record"),
        (lambda: [slow(), quick()], {"delay": [0.0, 0.1, 0.2]}, "bounds of delay are"),
        (lambda: with_each([slow(), quick()], delay=[0.0, -1.0]), {}, "record 2: delay is -1"),
        (lambda: with_each([slow(), quick()], delay=[0.0, "x"]), {}, "delay is 'x'"),
        (
            lambda: with_each([slow(), quick()], history=["virgin", "old"]),
            {},
            "history is 'old': expected 'virgin', 'settled', 'fit'",
        ),
        (lambda: with_each([slow(), quick()], offset=[True, 3]), {}, "offset is 3"),
        (lambda: [slow(), quick()], {"creep": [1.0, 0.0]}, r"creep\[1\] is 0 s: expected"),
        (
            lambda: [slow(), quick()[0.0:0.1]],
            {"creep": True},
            "record 2: the window has .* samples: expected at least 400 to show creep",
        ),
        (
            lambda: [slow(), quick()],
            {"model": "prandtl-ishlinskii"},
            "parameters is {.*: expected none with the model 'prandtl-ishlinskii'",
        ),
        (
            lambda: with_each([slow(), quick()], drift=[None, True], offset=[True, False]),
            {},
            "drift is True: expected none with offset=False",
        ),
        (
            lambda: with_each([slow(), quick()], drift=[None, -2.0]),
            {},
            "drift is -2: expected a finite number above 0, in s",
        ),
    ],
)
def test_wrong_input_gets_one_sentence(records: Any, given: dict[str, Any], said: str) -> None:
    with pytest.raises(pt.PiezotrackError, match=f"^{said}") as caught:
        identified(records(), given)
    assert "\n" not in str(caught.value)


def test_what_takes_one_record_refuses_several() -> None:
    with pytest.raises(pt.ParameterError, match=r"data is .*: expected a Dataset"):
        pt.compare([slow(), quick()])  # type: ignore[arg-type]
    with pytest.raises(pt.ParameterError, match="data is several records: expected one record"):
        pt.identification.Objective([slow(), quick()], "dahl")  # type: ignore[arg-type]
    with pytest.raises(pt.ParameterError, match="expected Datasets"):
        pt.campaign([[slow(), quick()]], ["dahl"])  # type: ignore[list-item]
