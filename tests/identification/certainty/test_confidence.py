"""Intervals of confidence from profiles and refits."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np
import pytest
from iminuit import Minuit
from matplotlib.figure import Figure
from scipy.optimize import brentq, nnls

import piezotrack as pt

if TYPE_CHECKING:
    from pathlib import Path

    from piezotrack.identification import Identification
    from piezotrack.identification.fitted.certainty.confidence import Confidence

DT = 2e-3
TIME = np.arange(0.0, 4.0, DT)
NESTED = 40.0 + 38.0 * (1.0 - TIME / 4.0) * np.sin(2.0 * np.pi * TIME)
STAGE = pt.FirstOrderDahlStage(
    mass=1e-3,
    damping=1e3,
    piezo_coefficient=1.0,
    stiffness=1e6,
    rest_stiffness=2e5,
    coulomb_force=5.0,
)
KNOWN = {"stiffness": 1e6, "mass": 1e-3}
ONE = pt.Descents(seed=1)


def measured(pole: float = 0.0, seed: int = 1, u: np.ndarray = NESTED) -> pt.Dataset:
    """Record of the stage under a drive, with a noise of 20 nm that has a pole."""
    noise = 20e-9 * np.random.default_rng(seed).standard_normal(u.size)
    for k in range(1, u.size):
        noise[k] = pole * noise[k - 1] + math.sqrt(1.0 - pole**2) * noise[k]
    clean = STAGE.simulate(u, DT, initial=STAGE.equilibrium(u[0])).x
    return pt.Dataset(u=u, y=clean + noise, dt=DT)


def fitted(data: pt.Dataset, **parameters: Any) -> Identification:
    known = {**KNOWN, **parameters}
    return pt.identify(
        data,
        "first-order-dahl",
        parameters=known,
        history="virgin",
        method=ONE,
    )


def widths(confidence: Confidence) -> dict[str, float]:
    return {
        name: one.interval.upper - one.interval.lower for name, one in confidence.parameters.items()
    }


def test_profiles_end_where_those_of_minos_do() -> None:
    """James and Roos 1975, doi 10.1016/0010-4655(75)90039-9: an independent optimiser."""
    data = measured()
    fit = fitted(data)
    sure = fit.confidence()
    names = list(sure.parameters)
    scale = np.array([sure.parameters[name].value for name in names])

    def squares(shares: np.ndarray) -> float:
        stage = replace(STAGE, **dict(zip(names, (shares * scale).tolist(), strict=True)))
        left = data.y - stage.simulate(data.u, DT, initial=stage.equilibrium(data.u[0])).x
        return float(np.sum((left - left.mean()) ** 2))

    variance = squares(np.ones(4)) / (data.y.size - 5)
    minuit = Minuit(lambda shares: squares(shares) / variance, np.ones(4), name=names)
    minuit.migrad()
    for i, name in enumerate(names):
        # Drawn white noise is not quite uncorrelated.
        minuit.errordef = sure.parameters[name].factor
        minuit.hesse()
        minuit.minos(name, cl=0.95)
        error = minuit.merrors[name]
        ends = scale[i] * (minuit.values[name] + np.array([error.lower, error.upper]))
        assert np.allclose(ends, sure.interval(name), atol=0.015 * widths(sure)[name], rtol=0.0)


@pytest.mark.parametrize("pole", [0.0, 0.7])
def test_profiles_refits_and_covariance_agree_on_a_record_that_determines_all(pole: float) -> None:
    data = measured(pole)
    fit = fitted(data, damping=1e3)
    profiles, refits = fit.confidence(), fit.confidence(method="bootstrap")
    assert fit.covariance is not None
    for name, width in widths(profiles).items():
        assert profiles.parameters[name].shape == "bounded"
        of_covariance = 2.0 * 1.959964 * fit.covariance.deviation(name)
        assert width == pytest.approx(of_covariance, rel=0.05)
        # 200 refits tell the ends of their distribution to some per cent.
        assert widths(refits)[name] == pytest.approx(width, rel=0.2)
        low, high = profiles.interval(name)
        assert low < getattr(STAGE, name) < high
    assert np.mean([widths(refits)[name] / w for name, w in widths(profiles).items()]) == (
        pytest.approx(1.0, abs=0.1)
    )


def test_correlated_noise_widens_profiles_and_refits() -> None:
    wide, narrow = (fitted(measured(pole), damping=1e3) for pole in (0.9, 0.0))
    pairs = [widths(one.confidence()) for one in (wide, narrow)]
    assert all(pairs[0][name] > 2.0 * pairs[1][name] for name in pairs[0])
    refits = widths(wide.confidence(method="bootstrap"))
    assert all(refits[name] > 2.0 * pairs[1][name] for name in refits)


def test_an_interval_grows_with_its_level() -> None:
    fit = fitted(measured(), damping=1e3)
    half, more = (widths(fit.confidence(level)) for level in (0.5, 0.9))
    assert more["coulomb_force"] / half["coulomb_force"] == pytest.approx(2.4387, rel=0.03)


def test_a_mass_that_the_record_does_not_show_has_an_upper_limit_only() -> None:
    """Within narrow bounds it has none."""
    data = measured()
    wide = fitted(data, damping=1e3, mass=pt.Parameter(bounds=(1e-6, 100.0))).confidence()
    mass = wide.parameters["mass"]
    assert mass.shape == "open below"
    assert mass.interval.lower == -math.inf
    # Its force at 2 Hz, 4 pi^2 M f^2 x, is seen from some nanometres on.
    assert 1e-2 < mass.interval.upper < 10.0
    entry = wide.document()["parameters"]["mass"]
    assert entry["interval"] == [None, mass.interval.upper]
    narrow = fitted(data, damping=1e3, mass=pt.Parameter(bounds=(1e-6, 1e-3))).confidence()
    assert narrow.parameters["mass"].shape == "flat"
    assert not narrow.parameters["mass"].determined


def test_the_slow_record_of_the_paper_limits_ratios_of_forces_but_no_mass() -> None:
    """Xu and Li 2010, section 3: 0.25 Hz, where inertia is some 1e-6 of the force of the spring."""
    stage = pt.DahlStage.xu_li_2010()
    u = 37.5 - 37.5 * np.cos(2.0 * np.pi * 0.25 * TIME)
    noise = 50e-9 * np.random.default_rng(3).standard_normal(u.size)
    data = pt.Dataset(u=u, y=stage.simulate(u, DT).x + noise, dt=DT)

    def of(scale: float) -> dict[str, Any]:
        """Fit with the stiffness held at a multiple of the true one."""
        known = {name: getattr(stage, name) for name in ("a1", "a2")}
        known["damping"] = scale * stage.damping
        fit = pt.identify(
            data,
            "dahl",
            parameters={
                **known,
                "stiffness": scale * stage.stiffness,
                "mass": pt.Parameter(bounds=(1e-3 * scale * stage.mass, scale * stage.mass)),
            },
            history="virgin",
            method=ONE,
        )
        return dict(fit.confidence().parameters)

    once, twice = of(1.0), of(2.0)
    assert once["mass"].shape == "flat"
    for name in ("b1", "piezo_coefficient"):
        assert once[name].shape == "bounded"
        ends = 2.0 * np.array(once[name].interval)
        width = ends[1] - ends[0]
        assert np.allclose(ends, twice[name].interval, rtol=0.0, atol=0.05 * width)


def test_a_drive_that_repeats_gives_two_minima_of_a_delay() -> None:
    u = 40.0 - 38.0 * np.cos(2.0 * np.pi * TIME)
    before = np.tile(u[:500], 8)
    settled = STAGE.simulate(before, DT, initial=STAGE.equilibrium(u[0])).x[-u.size :]
    noise = 20e-9 * np.random.default_rng(1).standard_normal(u.size)
    data = pt.Dataset(u=u, y=np.roll(settled, 50) + noise, dt=DT)[2.0:]
    fit = pt.identify(
        data,
        "first-order-dahl",
        history="settled",
        delay=(0.0, 1.3),
        parameters={**KNOWN, "damping": 1e3},
        method=ONE,
    )
    delay = fit.confidence().parameters["delay"]
    assert delay.shape == "several minima"
    assert delay.interval.lower == pytest.approx(0.1, abs=1e-3)
    assert delay.interval.upper == pytest.approx(1.1, abs=1e-3)


def test_a_lower_minimum_is_taken_and_named() -> None:
    data, few = measured(), pt.ParticleSwarm(iterations=4, runs=1, polish=False, seed=1)
    poor = pt.identify(data, "first-order-dahl", parameters=KNOWN, history="virgin", method=few)
    good = fitted(data)
    sure = poor.confidence()
    assert sure.lower is not None
    assert sure.lower.fitted_cost == pytest.approx(poor.cost)
    assert sure.lower.cost == pytest.approx(good.cost, rel=1e-6)
    assert sure.lower.values["coulomb_force"] == pytest.approx(good.model.coulomb_force, rel=1e-3)
    for name, width in widths(good.confidence()).items():
        assert widths(sure)[name] == pytest.approx(width, rel=0.02)
    assert good.confidence().lower is None


def test_ties_and_priors_hold_along_profiles_and_in_refits() -> None:
    prior = pt.Parameter(prior=(5.0, 1e-4))
    fit = fitted(measured(), coulomb_force=prior, rest_stiffness="2e5 * damping / 1e3")
    profiles, refits = fit.confidence(), fit.confidence(method="bootstrap")
    assert "rest_stiffness" not in profiles.parameters
    # The record alone tells it to some 1e-2, the prior to 1e-4.
    assert widths(profiles)["coulomb_force"] == pytest.approx(3.92e-4, rel=0.03)
    assert widths(refits)["coulomb_force"] == pytest.approx(3.92e-4, rel=0.2)
    drawn = {name: one.values for name, one in refits.parameters.items()}
    # Sorted alike, as one is a multiple of the other.
    assert np.allclose(drawn["rest_stiffness"], 200.0 * drawn["damping"])


def test_a_record_of_rest_and_one_with_a_drift_are_fitted_again_as_they_were() -> None:
    """The cost around a fit is that of the fit."""
    u = NESTED + 20.0
    rest = STAGE.equilibrium(0.0)
    y = STAGE.simulate(np.r_[0.0, u], DT, initial=rest).x[1:]
    jumped = pt.Dataset(u=u, y=y + 1e-9 * np.random.default_rng(2).standard_normal(u.size), dt=DT)
    drifting = replace_y(measured(), 1e-6 * np.exp(-TIME / 2.0))
    for data, arguments in ((jumped, {"history": "rest"}), (drifting, {"drift": True})):
        fit = pt.identify(data, "first-order-dahl", parameters=KNOWN, method=ONE, **arguments)
        sure = fit.confidence()
        assert sure.cost == pytest.approx(fit.cost, rel=2e-2)
        low, high = sure.interval("rest_stiffness")
        assert low <= fit.model.rest_stiffness <= high


def replace_y(data: pt.Dataset, added: np.ndarray) -> pt.Dataset:
    return pt.Dataset(u=data.u, y=data.y + added, dt=data.dt)


def test_several_records_share_their_intervals() -> None:
    """Two records of one stage determine each parameter better than one."""
    one = fitted(measured(seed=1), damping=1e3)
    both = pt.identify(
        [measured(seed=1), measured(seed=2)],
        "first-order-dahl",
        parameters={**KNOWN, "damping": 1e3},
        history="virgin",
        method=ONE,
    )
    pair = [widths(fit.confidence()) for fit in (both, one)]
    for name, width in pair[0].items():
        assert width / pair[1][name] == pytest.approx(math.sqrt(0.5), rel=0.1)


def test_refits_have_the_same_bits_in_every_call_and_a_panel_for_each_parameter() -> None:
    fit = fitted(measured(), damping=1e3)
    first, again = (fit.confidence(method="bootstrap") for _ in range(2))
    assert first.draws == 200
    for name, one in first.parameters.items():
        assert one.values.tobytes() == again.parameters[name].values.tobytes()
    for sure in (first, fit.confidence()):
        figure = sure.plot(fig=Figure(layout="constrained"))
        shown = [ax.get_xlabel() for ax in figure.axes if ax.axison]
        assert [one.split(" [")[0] for one in shown] == list(sure.parameters)


def test_what_has_no_intervals_is_refused_in_a_sentence(tmp_path: Path) -> None:
    fit = fitted(measured(), damping=1e3)
    for level in (0.0, 1.0, 95.0, math.nan):
        with pytest.raises(pt.ParameterError, match="level"):
            fit.confidence(level)
    with pytest.raises(pt.ParameterError, match="method"):
        fit.confidence(method="bayes")  # type: ignore[arg-type]
    loaded = pt.load(fit.save(tmp_path / "model.json"))
    with pytest.raises(pt.ParameterError, match="record"):
        loaded.confidence()
    short = fitted(measured(u=np.ascontiguousarray(NESTED[::40])), damping=1e3)
    with pytest.raises(pt.DataError, match="short"):
        short.confidence(method="bootstrap")


THRESHOLDS = np.array([4.0, 10.0, 20.0, 30.0])
WEIGHTS = np.array([0.2e-6, 0.0, 0.05e-6, 0.01e-6])


def of_plays(noise: float, weights: np.ndarray = WEIGHTS) -> pt.Dataset:
    """Record of a stage of plays, by default one of weight 0 and one near it."""
    stage = pt.stages.PrandtlIshlinskiiStage(
        linear=1e-6, thresholds=tuple(THRESHOLDS.tolist()), weights=tuple(weights.tolist())
    )
    clean = stage.simulate(NESTED, DT, initial=stage.equilibrium(NESTED[0])).x
    added = noise * np.random.default_rng(1).standard_normal(TIME.size)
    return pt.Dataset(u=NESTED, y=clean + added, dt=DT)


def with_thresholds(data: pt.Dataset, *, offset: bool = True) -> Identification:
    method = pt.LeastSquares(
        thresholds=THRESHOLDS.tolist(), dynamics=None, dead_zones=0, creep=False
    )
    return pt.identify(data, "prandtl-ishlinskii", history="virgin", method=method, offset=offset)


def play(threshold: float) -> np.ndarray:
    """Brokate and Sprekels 1996, Hysteresis and Phase Transitions, 2.3: from rest at 0 V on."""
    w, values = 0.0, []
    for u in NESTED:
        w = max(u - threshold, min(u + threshold, w))
        values.append(w)
    return np.array(values)


def test_profiles_of_weights_end_where_those_of_nonnegative_least_squares_do() -> None:
    """Lawson and Hanson's algorithm (SciPy) on plays of the test's own."""
    data = of_plays(50e-9)
    fit = with_thresholds(data)
    sure = fit.confidence()
    columns = np.array([NESTED, *(play(r) for r in THRESHOLDS), np.ones_like(NESTED)]).T
    columns = np.column_stack([columns, -columns[:, -1]])
    size = np.array([1e-6, *np.full(4, 1e-7), 1e-6, 1e-6])

    def squares(held: int | None = None, value: float = 0.0) -> float:
        left = data.y if held is None else data.y - value * columns[:, held]
        rest = np.delete(columns * size, held, axis=1) if held is not None else columns * size
        return float(nnls(rest * 1e6, left * 1e6)[1]) ** 2

    least, freedom = squares(), data.y.size - 6
    names = ["linear", *(f"weights[{k}]" for k in range(4))]
    for k, name in enumerate(names):
        one = sure.parameters[name]
        limit = one.factor * 1.959964**2

        def rise(value: float, k: int = k, limit: float = limit) -> float:
            return freedom * (squares(k, value) / least - 1.0) - limit

        width = 20.0 * fit.covariance.deviation("weights[0]")  # type: ignore[union-attr]
        upper = brentq(rise, one.value, one.value + width)
        assert one.interval.upper == pytest.approx(upper, abs=2e-3 * width)
        if rise(max(one.value - width, 0.0)) < 0.0:
            assert one.shape == "open below"
        else:
            lower = brentq(rise, max(one.value - width, 0.0), one.value)
            assert one.interval.lower == pytest.approx(lower, abs=2e-3 * width)
    assert sure.parameters["weights[1]"].shape == "open below"
    assert sure.parameters["weights[0]"].shape == "bounded"


def test_profiles_refits_and_covariance_of_plays_agree_away_from_0() -> None:
    fit = with_thresholds(of_plays(20e-9, np.array([0.2e-6, 0.1e-6, 0.05e-6, 0.08e-6])))
    profiles, refits = fit.confidence(), fit.confidence(method="bootstrap")
    assert fit.covariance is not None
    for name, width in widths(profiles).items():
        of_covariance = 2.0 * 1.959964 * fit.covariance.deviation(name)
        assert width == pytest.approx(of_covariance, rel=0.02)
        assert widths(refits)[name] == pytest.approx(width, rel=0.2)
    # A record that has nothing of its own determines the gain better.
    known = with_thresholds(of_plays(20e-9), offset=False).confidence()
    free = with_thresholds(of_plays(20e-9)).confidence()
    assert widths(known)["linear"] < widths(free)["linear"]
    at_zero = with_thresholds(of_plays(20e-9)).confidence(method="bootstrap")
    assert float(at_zero.parameters["weights[1]"].values.min()) == 0.0


def test_the_dynamics_behind_plays_have_profiles_too() -> None:
    """A mode, in which the motion is not linear; a falling stage is the mirror image."""
    stage = pt.stages.PrandtlIshlinskiiStage(
        linear=1e-6, thresholds=(10.0,), weights=(0.2e-6,), frequency=40.0, damping_ratio=0.1
    )
    steps = np.repeat([0.0, 30.0, 10.0, 60.0, 20.0, 75.0, 0.0], 250)
    y = stage.simulate(steps, DT, initial=stage.equilibrium(0.0)).x
    y += 20e-9 * np.random.default_rng(3).standard_normal(steps.size)
    method = pt.LeastSquares(thresholds=[10.0], dynamics="second", dead_zones=0, creep=False)
    found = []
    for sign in (1.0, -1.0):
        fit = pt.identify(
            pt.Dataset(u=steps, y=sign * y, dt=DT),
            "prandtl-ishlinskii",
            method=method,
            history="virgin",
        )
        found.append(fit.confidence())
    for name, value in (("frequency", 40.0), ("damping_ratio", 0.1)):
        low, high = found[0].interval(name)
        assert low < value < high < 1.1 * value
        assert found[1].interval(name) == pytest.approx((low, high), rel=1e-4)
    rising, falling = (one.interval("weights[0]") for one in found)
    assert falling == pytest.approx((-rising.upper, -rising.lower), rel=1e-3)
