"""A displacement that is late behind the drive."""

from __future__ import annotations

import json
from typing import TYPE_CHECKING

import numpy as np
import pytest

import piezotrack as pt
from reference import multisine

if TYPE_CHECKING:
    from pathlib import Path

    from numpy.typing import NDArray

DT = 1e-3
HELD = {"mass": 0.1828, "a1": 121.9874, "a2": 1.1773e6, "b1": 1.8485e6}


def late(delay: float) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Drive and displacement of a stage that gets its drive late, from a finer simulation."""
    fine = 20
    u = multisine(2000 * fine, DT / fine, 0.5)
    u -= u[0]
    shift = round(delay / DT * fine)
    held_back = np.concatenate([np.zeros(shift), u[: u.size - shift]])
    x = pt.DahlStage.xu_li_2010().simulate(held_back, DT / fine).x
    return u[::fine], x[::fine]


# Whole samples, parts of one, none.
@pytest.mark.parametrize("delay", [0.0, 0.35e-3, 1e-3, 3.45e-3, 17.8e-3])
def test_a_delay_is_found(delay: float) -> None:
    u, y = late(delay)
    noise = 10e-9 * np.random.default_rng(2).standard_normal(y.size)
    data = pt.Dataset(u=u, y=y + noise, dt=DT)
    fit = pt.identify(data, "dahl", parameters=HELD, delay=True, method=pt.Descents(seed=1, runs=2))
    assert fit.cost < 10.5e-9
    assert fit.delay == pytest.approx(delay, abs=5e-6)
    assert fit.model.damping == pytest.approx(2597.3, rel=2e-3)
    deviation = fit.parameters["delay"].deviation
    assert deviation is not None
    assert deviation < 5e-6
    assert fit.fitted.rms == pytest.approx(fit.cost, rel=1e-3)


@pytest.mark.parametrize("delay", [0.0, 3.45e-3])
def test_a_search_finds_a_delay_that_is_not_given(delay: float) -> None:
    u, y = late(delay)
    noise = 10e-9 * np.random.default_rng(2).standard_normal(y.size)
    fit = pt.identify(pt.Dataset(u=u, y=y + noise, dt=DT), "dahl", parameters=HELD)
    assert fit.cost < 10.5e-9
    assert fit.delay == pytest.approx(delay, abs=5e-6)


def test_a_known_delay_is_used_and_bounds_are_kept() -> None:
    u, y = late(3.45e-3)
    data = pt.Dataset(u=u, y=y, dt=DT)
    known = pt.identify(data, "dahl", parameters=HELD, delay=3.45e-3, method=pt.Descents(seed=1))
    none = pt.identify(data, "dahl", parameters=HELD, delay=False)
    assert known.delay == 3.45e-3
    assert known.cost < 2e-9 < 10 * known.cost < none.cost
    assert not known.parameters["delay"].free
    assert "delay" not in none.parameters
    bound = pt.identify(
        data, "dahl", parameters=HELD, delay=(0.0, 2e-3), method=pt.Descents(seed=1)
    )
    assert bound.delay == pytest.approx(2e-3)
    assert bound.parameters["delay"].at_bound
    assert not bound.parameters["delay"].identified
    assert "delay" in bound.summary()


def test_the_delay_is_in_the_file_and_in_what_the_model_shows(tmp_path: Path) -> None:
    u, y = late(3.45e-3)
    data = pt.Dataset(u=u, y=y, dt=DT)
    fit = pt.identify(data, "dahl", parameters=HELD, delay=True, method=pt.Descents(seed=1))
    path = fit.save(tmp_path / "dahl.json")
    entry = json.loads(path.read_text())["delay"]
    assert entry["value"] == fit.delay
    assert entry["unit"] == "s"
    assert entry["free"] is True
    loaded = pt.load(path)
    assert loaded.delay == fit.delay
    assert loaded.score(data) == fit.score(data)
    shown = loaded.displacement(u, DT)
    assert np.abs(shown - y).max() < 5e-9
    # The stage itself is not late.
    assert np.abs(loaded.model.simulate(u, DT).x - y).max() > 1e-7
    assert loaded.save(tmp_path / "again.json").read_bytes() == path.read_bytes()


def test_a_file_without_a_delay_is_read(tmp_path: Path) -> None:
    u, y = late(0.0)
    fit = pt.identify(
        pt.Dataset(u=u, y=y, dt=DT), "dahl", parameters=HELD, method=pt.Descents(seed=1)
    )
    document = json.loads(fit.save(tmp_path / "dahl.json").read_text())
    del document["delay"]
    document["schema_version"] = 1
    (tmp_path / "old.json").write_text(json.dumps(document))
    assert pt.load(tmp_path / "old.json").delay == 0.0


def foreign(u: NDArray[np.float64], dt: float, delay: float) -> NDArray[np.float64]:
    """Plays, and a mode of 60 Hz by a recursion of its own; readings come late [m]."""
    from scipy.signal import lsim

    fine = 20
    t = np.arange((u.size - 1) * fine + 1) * dt / fine
    drive = np.interp(t, np.arange(u.size) * dt, u)
    force = drive.copy()
    for threshold, weight in ((5.0, 0.2), (20.0, 0.15)):
        place = 0.0
        for k, volts in enumerate(drive):
            place = min(max(place, volts - threshold), volts + threshold)
            force[k] += weight * place
    w = 2.0 * np.pi * 60.0
    x = lsim(([w * w], [1.0, 0.1 * w, w * w]), force, t)[1]
    return 1e-7 * np.asarray(np.interp(t[::fine] - delay, t, x))


@pytest.mark.parametrize("delay", [0.0, 1.7e-3, 3e-3])
def test_least_squares_find_a_delay_that_is_not_given(delay: float) -> None:
    t = np.arange(3000) * DT
    u = 50.0 * np.sin(2.0 * np.pi * (1.0 * t + 5.0 * t**2)) * np.minimum(1.0, 4.0 * t)
    noise = 5e-9 * np.random.default_rng(5).standard_normal(t.size)
    data = pt.Dataset(u=u, y=foreign(u, DT, delay) + noise, dt=DT)
    fit = pt.identify(data, "prandtl-ishlinskii")
    assert fit.delay == pytest.approx(delay, abs=0.1e-3)
    assert fit.cost < 1.3 * 5e-9
    assert fit.model.frequency == pytest.approx(60.0, rel=0.02)
    if delay:
        assert pt.identify(data, "prandtl-ishlinskii", delay=False).cost > 3.0 * fit.cost


def test_a_slow_sine_shows_no_delay() -> None:
    t = np.arange(4000) * DT
    u = 50.0 - 50.0 * np.cos(2.0 * np.pi * t)
    noise = 5e-9 * np.random.default_rng(6).standard_normal(t.size)
    data = pt.Dataset(u=u, y=foreign(u, DT, 0.0) + noise, dt=DT)
    assert pt.identify(data, "prandtl-ishlinskii").delay == 0.0
