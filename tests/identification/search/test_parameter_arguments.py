"""Scales, ties, inequalities and priors: what they make of a fit, and what is refused."""

from __future__ import annotations

import math
from functools import cache
from typing import TYPE_CHECKING, Any

import numpy as np
import pytest
from scipy.optimize import minimize

import piezotrack as pt
from records import BOX, HELD, TABLE_1, entries, quick, quick_fit, search_of

if TYPE_CHECKING:
    from collections.abc import Callable
    from pathlib import Path

    from numpy.typing import NDArray

    Array = NDArray[np.float64]

SMALL = pt.ParticleSwarm(particles=4, iterations=2, polish=False)
FIXED: dict[str, Any] = {"mass": TABLE_1.mass, **HELD}
# The three parameters that a slow sine then determines.
SEARCHED = ("damping", "stiffness", "piezo_coefficient")
RATIO = TABLE_1.piezo_coefficient / TABLE_1.stiffness


def deviation(values: Array) -> float:
    """RMS deviation of a stage on the quick record, its mean taken off [m]."""
    found: dict[str, Any] = dict(zip(SEARCHED, values.tolist(), strict=True))
    stage = pt.DahlStage(**found, **FIXED, b0=0.0, up=30.0)
    rest = quick().y - stage.simulate(quick().u, quick().dt).x
    return float(rest.std())


def minimum(cost: Callable[[Array], float], around: Array) -> Array:
    """The minimum of a cost of values that are a few per cent of some others apart."""
    minimised = minimize(
        lambda z: cost(around * (1.0 + 0.01 * z)),
        np.zeros(around.size),
        method="Nelder-Mead",
        options={"xatol": 1e-6, "fatol": 1e-10, "maxiter": 4000, "maxfev": 4000},
    )
    assert minimised.success
    values: Array = around * (1.0 + 0.01 * minimised.x)
    return values


def alike(fit: pt.identification.Identification, other: pt.identification.Identification) -> None:
    """Assert that two fits found the same values, and are as sure of them."""
    for name in SEARCHED:
        estimate, same = fit.parameters[name], other.parameters[name]
        assert estimate.deviation is not None
        assert estimate.value == pytest.approx(same.value, abs=0.01 * estimate.deviation)
        assert estimate.deviation == pytest.approx(same.deviation, rel=1e-3)


# Ties.


def test_a_tied_parameter_follows_from_the_others() -> None:
    tie = f"{RATIO!r} * stiffness"
    fit = quick_fit(
        fixed=FIXED,
        bounds={name: BOX[name] for name in ("damping", "stiffness")},
        ties={"piezo_coefficient": tie},
    )
    stiffness, piezo = fit.parameters["stiffness"], fit.parameters["piezo_coefficient"]
    assert piezo.value == pytest.approx(RATIO * stiffness.value, rel=1e-14)
    assert piezo.value == fit.model.piezo_coefficient
    assert (piezo.tie, piezo.free, piezo.bounds, piezo.scale) == (tie, False, None, None)
    assert stiffness.deviation is not None
    assert piezo.deviation == pytest.approx(RATIO * stiffness.deviation, rel=1e-6)
    assert abs(stiffness.value - TABLE_1.stiffness) < 4 * stiffness.deviation
    # The tie is true, and takes an unknown away: what remains is known better.
    free = quick_fit(fixed=FIXED, bounds={name: BOX[name] for name in SEARCHED})
    assert free.parameters["stiffness"].deviation > 2 * stiffness.deviation  # type: ignore[operator]

    def cost(values: Array) -> float:
        damping, stiffness = values
        return 1e6 * deviation(np.array([damping, stiffness, RATIO * stiffness]))

    found = minimum(cost, np.array([TABLE_1.damping, TABLE_1.stiffness]))
    assert stiffness.value == pytest.approx(found[1], abs=0.05 * stiffness.deviation)


def test_ties_may_refer_to_tied_parameters_in_any_order() -> None:
    ties = {"damping": "2 * mass", "mass": "piezo_coefficient ** 2 / 4 + 0.1"}
    fit = quick_fit(
        fixed=HELD, bounds={n: BOX[n] for n in ("stiffness", "piezo_coefficient")}, ties=ties
    )
    stage = fit.model
    assert stage.mass == pytest.approx(stage.piezo_coefficient**2 / 4 + 0.1, rel=1e-14)
    assert stage.damping == 2 * stage.mass


def test_a_tie_to_what_is_held_fixes_the_scale_of_the_forces() -> None:
    fit = quick_fit(fixed={**HELD, "b1": 1.0} | {"b0": 0.0}, ties={}, bounds={})
    assert not fit.scale_assumed
    held = {"a1": HELD["a1"], "a2": HELD["a2"]}
    tied = quick_fit(fixed=held, ties={"b1": "1.57 * a2"}, bounds={})
    assert not tied.scale_assumed
    assert tied.model.b1 == pytest.approx(1.57 * HELD["a2"], rel=1e-14)


def test_a_candidate_without_a_stage_fails_and_the_search_goes_on() -> None:
    # The root has no value in a fifth of the box, where the truth is not.
    tie = f"{TABLE_1.piezo_coefficient} + sqrt(damping - 1800) * 1e-9"
    fit = quick_fit(
        fixed=FIXED,
        bounds={name: BOX[name] for name in ("damping", "stiffness")},
        ties={"piezo_coefficient": tie},
    )
    assert search_of(fit).nfail > 20
    assert abs(fit.model.damping / TABLE_1.damping - 1.0) < 0.02


# Inequalities.


def test_an_inequality_that_the_truth_breaks_makes_the_two_equal() -> None:
    # With damping and stiffness as true, D/K is 0.1 s; the search is told that it is 1 s or more.
    bounds = {"damping": (1e2, 5e4), "stiffness": (1e2, 5e4), "piezo_coefficient": (1e-4, 0.1)}
    fit = quick_fit(fixed=FIXED, bounds=bounds, constraints=["stiffness <= damping"])
    (constraint,) = fit.constraints
    assert constraint == ("stiffness <= damping", "stiffness", "damping", True)
    assert fit.model.stiffness == pytest.approx(fit.model.damping, rel=1e-12)
    # The same by another way.
    tied = {name: bounds[name] for name in ("damping", "piezo_coefficient")}
    other = quick_fit(fixed=FIXED, bounds=tied, ties={"stiffness": "damping"})
    assert fit.cost == pytest.approx(other.cost, rel=1e-7)
    assert fit.model.damping == pytest.approx(other.model.damping, rel=1e-4)
    assert "stiffness <= damping  active: the two are equal" in fit.summary()
    row = next(line for line in fit.summary().splitlines() if line.startswith("  stiffness "))
    assert "on a constraint" in row
    assert not fit.parameters["stiffness"].identified


def test_an_inequality_that_the_truth_keeps_changes_nothing() -> None:
    bounds = {"damping": (1e3, 5e4), "stiffness": (1e3, 5e4), "piezo_coefficient": (1e-3, 0.1)}
    free = quick_fit(fixed=FIXED, bounds=bounds)
    fit = quick_fit(fixed=FIXED, bounds=bounds, constraints=["stiffness > damping"])
    assert not fit.constraints[0].active
    assert fit.cost == pytest.approx(free.cost, rel=1e-9)
    # The smaller one's coordinate depends on the larger: the spread is propagated.
    alike(fit, free)


def test_every_candidate_keeps_a_chain_of_inequalities() -> None:
    seen: list[dict[str, float]] = []

    def keep(progress: pt.identification.Progress) -> None:
        seen.append(progress.parameters)

    quick_fit(
        fixed={"mass": TABLE_1.mass, "a1": HELD["a1"], "b1": HELD["b1"]},
        bounds={"damping": (1.0, 1e6), "stiffness": (100.0, 3e5), "a2": (1e4, 1e6)},
        constraints=["a2 < damping", "stiffness < damping", "a2 > stiffness"],
        swarm=pt.ParticleSwarm(particles=8, iterations=40, polish=False),
        callback=keep,
    )
    assert len(seen) > 10
    for one in seen:
        assert one["stiffness"] <= one["a2"] <= one["damping"]


def test_an_inequality_to_what_is_held_bounds_the_other() -> None:
    fit = quick_fit(
        fixed=FIXED | {"damping": TABLE_1.damping},
        bounds={"stiffness": (1e3, 5e4), "piezo_coefficient": (0.01, 0.1)},
        constraints=["stiffness < damping"],
    )
    assert fit.parameters["stiffness"].bounds == (1e3, TABLE_1.damping)
    assert fit.constraints[0].active


# Priors.


def test_a_prior_is_weighed_against_the_record_as_scipy_does() -> None:
    # Four widths beside the truth, which is as sure by the record as by the prior.
    mean, width = 25700.0, 60.0
    bounds = {name: BOX[name] for name in SEARCHED}
    fit = quick_fit(fixed=FIXED, bounds=bounds, priors={"stiffness": (mean, width)})

    def objective(values: Array) -> float:
        prior = float((values[1] - mean) / width) ** 2
        return len(quick()) * math.log(deviation(values)) + 0.5 * prior

    around = np.array([fit.parameters[name].value for name in SEARCHED])
    lowest = minimum(objective, around)
    # The curvature of minus the logarithm of the posterior, by differences over a twentieth of the
    # deviations, as the parameters are correlated.
    deviations = [fit.parameters[name].deviation for name in SEARCHED]
    steps: Array = 0.05 * np.array(deviations, dtype=float)
    at = np.eye(3) * steps

    def second(i: int, j: int) -> float:
        signs = ((1, 1, 1), (1, -1, -1), (-1, 1, -1), (-1, -1, 1))
        total: float = sum(s * objective(lowest + a * at[i] + b * at[j]) for a, b, s in signs)
        return total / (4.0 * float(steps[i]) * float(steps[j]))

    curvature = np.array([[second(i, j) for j in range(3)] for i in range(3)])
    spread = np.sqrt(np.diag(np.linalg.inv(curvature)))
    for i, name in enumerate(SEARCHED):
        one = fit.parameters[name]
        assert one.deviation == pytest.approx(spread[i], rel=0.05)
        assert one.value == pytest.approx(lowest[i], abs=0.02 * spread[i])
    # It is between the two, and the record alone is not.
    free = quick_fit(fixed=FIXED, bounds=bounds)
    assert mean + 10.0 < fit.model.stiffness < free.model.stiffness - 10.0
    assert fit.cost > free.cost
    distance = (fit.model.stiffness - mean) / width
    factor = math.exp(0.5 * distance**2 / len(quick()))
    assert search_of(fit).cost_with_priors == pytest.approx(fit.cost * factor, rel=1e-12)
    assert fit.cost == pytest.approx(deviation(around), rel=1e-4)
    assert search_of(fit).agreeing_runs > 1


def test_what_the_record_says_nothing_of_is_what_the_prior_says() -> None:
    fit = quick_fit(
        fixed=HELD,
        bounds={name: BOX[name] for name in SEARCHED},
        priors={"mass": (0.15, 0.01)},
    )
    mass = fit.parameters["mass"]
    assert mass.value == pytest.approx(0.15, abs=2e-4)
    assert mass.deviation == pytest.approx(0.01, rel=0.01)
    assert mass.from_prior
    assert not mass.identified
    assert mass.bounds == pytest.approx((0.07, 0.23))
    summary = fit.summary()
    assert "prior 0.15 +- 0.01 kg" in summary
    assert "Known by their priors, not by this record: mass." in summary
    assert "not determined: M/K" in summary


def test_a_prior_of_the_stiffness_fixes_the_scale_of_the_forces() -> None:
    held = {"a1": HELD["a1"], "a2": HELD["a2"]}
    fit = quick_fit(fixed=held, bounds={}, priors={"stiffness": (2.6e4, 1e3)}, swarm=None)
    assert not fit.scale_assumed
    assert fit.parameters["stiffness"].deviation == pytest.approx(1e3, rel=0.01)
    assert fit.model.stiffness == pytest.approx(2.6e4, abs=10.0)
    assert fit.model.damping / fit.model.stiffness == pytest.approx(
        TABLE_1.damping / TABLE_1.stiffness, rel=0.02
    )


def test_a_prior_of_a_tied_parameter_counts() -> None:
    fit = quick_fit(
        fixed=HELD,
        bounds={name: BOX[name] for name in SEARCHED},
        ties={"mass": "0.1 + 1e-6 * stiffness"},
        priors={"mass": (0.12, 1e-6)},
    )
    assert fit.model.stiffness == pytest.approx(2e4, abs=100.0)
    assert fit.model.mass == pytest.approx(0.12, abs=1e-4)


def test_a_wide_prior_changes_nothing() -> None:
    bounds = {name: BOX[name] for name in SEARCHED}
    free = quick_fit(fixed=FIXED, bounds=bounds)
    fit = quick_fit(fixed=FIXED, bounds=bounds, priors={"stiffness": (2e4, 1e7)})
    alike(fit, free)


def test_a_prior_far_from_where_the_search_begins_is_found() -> None:
    # A width of a millionth of the bounds: the factor overflows nearly everywhere.
    fit = quick_fit(
        fixed=FIXED,
        bounds={name: BOX[name] for name in SEARCHED},
        priors={"stiffness": (12345.0, 0.01)},
    )
    assert fit.model.stiffness == pytest.approx(12345.0, abs=0.05)
    assert search_of(fit).nfail < 50


# Scales.


def test_a_scale_spreads_the_particles_and_the_minimum_stays() -> None:
    low, high = 1e-3, 1e5
    first: dict[str, list[float]] = {"linear": [], "log": []}
    for scale, seen in first.items():
        # Of some seeds the same particle is the better one on both scales.
        for seed in range(12):
            quick_fit(
                fixed=HELD,
                bounds=BOX | {"damping": (low, high)},
                scales={"damping": scale},
                swarm=pt.ParticleSwarm(particles=2, iterations=1, polish=False),
                runs=1,
                seed=seed,
                callback=lambda progress, seen=seen: (
                    seen.append(progress.parameters["damping"]) if progress.nit == 0 else None
                ),
            )
    places = np.array([one / high for one in first["linear"]])
    powers = np.log(np.array(first["log"]) / low) / math.log(high / low)
    assert np.sum(np.abs(places - powers) < 1e-6) >= 4
    linear = quick_fit(scales={"damping": "linear"})
    log = quick_fit(scales={"damping": "log"})
    assert log.parameters["damping"].scale == "log"
    assert log.cost == pytest.approx(linear.cost, rel=1e-6)
    assert "log scale" in log.summary()


# Summary and file.


@cache
def with_everything() -> pt.identification.Identification:
    return quick_fit(
        fixed=HELD,
        bounds={name: BOX[name] for name in ("damping", "stiffness")},
        scales={"damping": "log"},
        ties={"piezo_coefficient": "  1.8e-6\n*  stiffness "},
        constraints=["damping < stiffness"],
        priors={"mass": (0.18, 0.01)},
    )


def test_summary_and_notebook_show_what_was_said() -> None:
    text = with_everything().summary()
    for words in (
        "tied: 1.8e-6 * stiffness",
        "prior 0.18 +- 0.01 kg",
        "log scale",
        "damping < stiffness  not active",
        "with the priors was minimised",
    ):
        assert words in text
    html = with_everything()._repr_html_()
    assert "tied: 1.8e-6 * stiffness" in html
    assert "damping &lt; stiffness" in html


def test_the_file_keeps_what_was_said(tmp_path: Path) -> None:
    first = with_everything().save(tmp_path / "first.json")
    again = pt.load(first).save(tmp_path / "again.json")
    assert again.read_text() == first.read_text()
    details = pt.load(again).details
    assert details["parameters"]["piezo_coefficient"]["tie"] == "1.8e-6 * stiffness"
    assert details["parameters"]["mass"]["prior"] == [0.18, 0.01]
    assert details["parameters"]["damping"]["scale"] == "log"
    assert details["constraints"] == [{"text": "damping < stiffness", "active": False}]
    assert details["fit"]["cost_with_priors"]["value"] >= details["fit"]["cost"]["value"]


def test_threads_make_no_difference() -> None:
    def tied_fit(threads: int) -> tuple[str, str]:
        fit = quick_fit(
            fixed=HELD,
            bounds={name: BOX[name] for name in ("damping", "stiffness")},
            ties={"piezo_coefficient": "1.8e-6 * stiffness"},
            constraints=["damping < stiffness"],
            priors={"mass": (0.18, 0.01)},
            threads=threads,
        )
        return repr(fit.model), fit.cost.hex()

    assert tied_fit(1) == tied_fit(2)


# Refusals.

F = {"mass": TABLE_1.mass, "a1": HELD["a1"]}
REFUSED: list[tuple[dict[str, Any], str]] = [
    ({"ties": {"b1": "1.57 * * a2"}}, "tie of b1 .* bracket at character 8, where '\\*' is"),
    ({"ties": {"b1": "1.57 * foo"}}, "tie of b1 .* at character 8, not 'foo'"),
    ({"ties": {"b1": ""}}, "tie of b1 .* at its end"),
    ({"ties": {"b1": "(a2"}}, "tie of b1 .* closing bracket at its end"),
    ({"ties": {"b1": "(" * 300 + "a2"}}, "tie of b1 .* 40 levels"),
    ({"ties": {"b1": "1 + " * 200 + "a2"}}, "tie of b1 .* 500 characters"),
    ({"ties": {"b1": "__import__('os').getcwd()"}}, "tie of b1 .* not '__import__'"),
    ({"ties": {"b1": 3}}, "tie is 3: expected a text"),
    ({"ties": {"foo": "a2"}}, "parameters is 'foo': expected one of"),
    ({"ties": {"up": "a2"}}, "tie of up"),
    ({"ties": {"b1": "b1"}}, "ties is a circle, b1 -> b1"),
    (
        {"ties": {"b1": "2 * a2", "a2": "stiffness", "stiffness": "b1", "damping": "b1"}},
        "ties is a circle, b1 -> a2 -> stiffness -> b1",
    ),
    ({"ties": {"b1": "log(0 - a2)"}}, "tie of b1 .*, NaN N/m.2 in the middle of the bounds"),
    ({"ties": {"damping": "0 - stiffness"}}, "tie of damping .*, -.* N s/m in the middle"),
    ({"ties": {"b1": "a2"}, "fixed": F | {"b1": 1.0}}, "expected no value of b1 in addition"),
    ({"ties": {"b1": "a2"}, "bounds": {"b1": (1.0, 2.0)}}, "expected no bounds of b1 in addition"),
    ({"ties": {"b1": "a2"}, "scales": {"b1": "log"}}, "expected no scale of b1 in addition"),
    (
        {"ties": {"stiffness": "2 * piezo_coefficient"}, "fixed": {"a1": 1.0}},
        "tie of stiffness .* determine only their ratios",
    ),
    ({"constraints": ["a2 << b1"]}, "constraint is 'a2 << b1': expected two parameters with"),
    ({"constraints": ["a2 = b1"]}, "constraint is 'a2 = b1': expected two parameters with"),
    ({"constraints": ["a2 < 5"]}, "constraint is 'a2 < 5': .* bounds keep"),
    ({"constraints": ["a2 < a2"]}, "expected two different parameters"),
    ({"constraints": ["a2 < b1", "b1 < a2"]}, "constraints is .* not in a circle"),
    ({"constraints": "a2 < b1"}, "constraints is 'a2 < b1': expected texts in a list"),
    ({"constraints": [5]}, "constraint is 5: expected a text"),
    ({"constraints": ["a1 < mass"]}, "both held"),
    (
        {"constraints": ["b1 < a2"], "bounds": {"b1": (5.0, 6.0), "a2": (1.0, 2.0)}},
        "with b1 from 5 and a2 up to 2: expected bounds within which it can hold",
    ),
    ({"constraints": ["b1 < a2"], "ties": {"b1": "a2"}}, "not tied, as b1 is"),
    ({"scales": {"damping": "ln"}}, "scale of damping is 'ln': expected 'linear' or 'log'"),
    ({"scales": {"a1": "log"}}, "scale of a1 is 'log': expected none, as .* not free"),
    ({"scales": {"b1": "log"}, "bounds": {"b1": (-1.0, 1.0)}}, "scale of b1 .* bounds above 0"),
    ({"priors": {"mass": (0.2, 0.1)}}, "prior of mass is 0.2 .- 0.1 kg: expected none"),
    ({"priors": {"b1": 3}}, "prior is 3: expected .value, standard deviation"),
    ({"priors": {"b1": (1.0, 0.0)}}, "prior of b1 is 1 .- 0 N/m.2: expected"),
    ({"priors": {"b1": (math.nan, 1.0)}}, "prior of b1 is NaN"),
    ({"priors": {"stiffness": (-1.0, 1.0)}}, "prior of stiffness is -1 .- 1 N/m: expected"),
    (
        {"priors": {"stiffness": (2e4, 1e3)}, "bounds": {"stiffness": (3e4, 4e4)}},
        "prior of stiffness .* expected a value in its bounds",
    ),
    (
        {"priors": {"stiffness": (2e4, 1e3)}, "fixed": {"stiffness": 1e4}},
        "prior of stiffness .* held",
    ),
]


@pytest.mark.parametrize(("arguments", "message"), REFUSED)
def test_refuses_in_one_sentence(arguments: dict[str, Any], message: str) -> None:
    text = {"fixed": F} | arguments
    constraints = text.pop("constraints", None)
    with pytest.raises(pt.ParameterError, match=message) as caught:
        pt.identify(
            quick(), "dahl", parameters=entries(**text), constraints=constraints, method=SMALL
        )
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize("model", ["auto", "prandtl-ishlinskii"])
def test_refuses_them_where_no_parameter_of_one_model_is_searched(model: str) -> None:
    with pytest.raises(pt.ParameterError, match=r"parameters is .*: expected none with"):
        pt.identify(quick(), model, parameters={"b1": "a2"})
    with pytest.raises(pt.ParameterError, match=r"constraints is .*: expected none with"):
        pt.identify(quick(), model, constraints=["a < b"])


def test_entries_of_any_form_say_the_same() -> None:
    short: dict[str, Any] = {
        "a1": HELD["a1"],
        "a2": (1e6, 2e6),
        "b1": "1.57 * a2",
        "damping": pt.Parameter(),
    }
    long: dict[str, Any] = {
        "a1": pt.Parameter(HELD["a1"]),
        "a2": pt.Parameter(bounds=(1e6, 2e6)),
        "b1": pt.Parameter(tie="1.57 * a2"),
    }
    fits = [
        pt.identify(quick(), "dahl", parameters=given, history="virgin") for given in (short, long)
    ]
    assert fits[0].model == fits[1].model
    assert fits[0].cost == fits[1].cost


def test_what_the_model_holds_is_searched_where_something_is_said_of_it() -> None:
    held = {name: getattr(pt.DahlStage.xu_li_2010(), name) for name in ("mass", "a1", "a2", "b1")}
    for entry in (pt.Parameter(), (-10.0, 10.0), pt.Parameter(prior=(0.0, 1.0))):
        fit = pt.identify(quick(), "dahl", parameters={**held, "b0": entry}, history="virgin")
        assert fit.parameters["b0"].free
    assert not pt.identify(quick(), "dahl", parameters=held, history="virgin").parameters["b0"].free
