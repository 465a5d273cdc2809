"""A search goes on from its checkpoint, and gives the bits of one that was not interrupted."""

from __future__ import annotations

import contextlib
import json
import random
import subprocess
import sys
import textwrap
import time
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import piezotrack as pt
from commands import ran, refusal
from piezotrack.data.log_file import write_log

DT = 1e-3


def record(seed: int = 0, count: int = 2000) -> pt.Dataset:
    """Two tones on a Dahl stage, with a noisy sensor."""
    t = DT * np.arange(count)
    u = 40.0 - 25.0 * np.cos(2 * np.pi * t) - 12.0 * np.cos(14 * np.pi * t)
    x = pt.DahlStage.xu_li_2010().simulate(u, DT).x
    return pt.Dataset(u=u, y=x + np.random.default_rng(seed).normal(0.0, 5e-9, t.size), dt=DT)


def outcome(fit: pt.identification.Identification) -> Any:
    """All that a search says."""
    search = fit.search
    course = search and (search.history.tolist(), search.runs, search.npolish)
    return fit.document(), course, fit.nfev


def interrupted(path: Path, after: int, log: pt.Dataset | None = None, **settings: Any) -> bool:
    """Search for so many iterations, and tell whether that was too few."""
    left = iter(range(after))
    try:
        pt.identify(
            log or record(),
            checkpoint=path,
            callback=lambda _: next(left, None) is None,
            **settings,
        )
    except pt.Interrupted:
        return True
    return False


@pytest.mark.parametrize(
    "settings",
    [
        {"model": "dahl"},
        {
            "model": "dahl",
            "creep": (0.1, 1.0),
            "parameters": {"stiffness": pt.Parameter(prior=(2.6e4, 1e3))},
        },
        {"model": "bouc-wen", "method": pt.ParticleSwarm(runs=2)},
        {"model": "first-order-dahl", "delay": True, "history": "fit"},
        {"model": "auto"},
    ],
    ids=lambda one: "-".join(one),
)
def test_a_search_goes_on_to_the_same_bits(settings: dict[str, Any], tmp_path: Path) -> None:
    path, log = tmp_path / "search.checkpoint", record(count=600)
    expected = outcome(pt.identify(log, **settings))
    assert interrupted(path, 3, log, **settings)
    sizes = [path.stat().st_size]
    assert interrupted(path, 9, log, **settings)
    sizes.append(path.stat().st_size)
    fit = pt.identify(log, checkpoint=path, **settings)
    sizes.append(path.stat().st_size)
    assert outcome(fit) == expected
    assert sizes == sorted(set(sizes))
    # A third time nothing is left to simulate, on any number of threads.
    content = path.read_bytes()
    assert outcome(pt.identify(log, checkpoint=path, threads=1, **settings)) == expected
    assert path.read_bytes() == content


def test_descents_after_a_swarm_go_on_too(tmp_path: Path) -> None:
    stage = pt.FirstOrderDahlStage(
        mass=0.16,
        damping=500.0,
        stiffness=1e6,
        piezo_coefficient=1.8,
        rest_stiffness=2.5e5,
        coulomb_force=8.0,
    )
    u = 40.0 + 35.0 * np.sin(2 * np.pi * DT * np.arange(2000))
    x = stage.simulate(u, DT, initial=stage.equilibrium([75.0, u[0]])).x
    log, path = pt.Dataset(u=u, y=x, dt=DT), tmp_path / "search.checkpoint"
    swarm = pt.ParticleSwarm(iterations=10, runs=1)
    settings: dict[str, Any] = {"model": "first-order-dahl", "method": swarm}
    seen: list[pt.identification.Progress] = []
    fit = pt.identify(log, callback=seen.append, **settings)
    assert fit.start is not None
    assert fit.start.history == "fit"
    # Within the descents.
    assert len(seen) > swarm.iterations + 5
    assert interrupted(path, swarm.iterations + 4, log, **settings)
    assert outcome(pt.identify(log, checkpoint=path, **settings)) == outcome(fit)


@pytest.mark.slow
def test_fifty_interruptions_change_nothing(tmp_path: Path) -> None:
    settings: dict[str, Any] = {"model": "dahl", "method": pt.ParticleSwarm(runs=2)}
    expected = outcome(pt.identify(record(), **settings))
    path = tmp_path / "search.checkpoint"
    draws, after = random.Random(1), 0
    for _ in range(50):
        after += draws.randrange(6)
        assert interrupted(path, after, **settings)
    assert outcome(pt.identify(record(), checkpoint=path, **settings)) == expected


SEARCH = """
    import sys
    import numpy as np
    import piezotrack as pt
    u, y = np.load(sys.argv[1])
    print("begun", flush=True)
    log, swarm = pt.Dataset(u=u, y=y, dt=1e-3), pt.ParticleSwarm(runs=3)
    fit = pt.identify(log, "bouc-wen", method=swarm, checkpoint=sys.argv[2])
    print(repr((fit.cost, fit.parameters, fit.nfev, fit.search.history.tolist())))
"""


def killed(arguments: list[str], after: float) -> str:
    """Search in another process that is killed so many seconds after its first checkpoint is there.

    Returns what it says if it ends before.
    """
    command = [sys.executable, "-c", textwrap.dedent(SEARCH), *arguments]
    with subprocess.Popen(command, stdout=subprocess.PIPE, text=True) as process:
        assert process.stdout is not None
        assert process.stdout.readline() == "begun\n"
        while not Path(arguments[1]).exists() and process.poll() is None:
            time.sleep(0.01)
        with contextlib.suppress(subprocess.TimeoutExpired):
            process.wait(after)
        process.kill()
        return process.stdout.read()


@pytest.mark.slow
@pytest.mark.parametrize("kills", [3, 50])
def test_a_killed_search_goes_on(kills: int, tmp_path: Path) -> None:
    # Long enough that it is killed within.
    log = record(count=4_000 if kills < 10 else 10_000)
    np.save(tmp_path / "log.npy", np.array([log.u, log.y]))
    path = tmp_path / "search.checkpoint"
    arguments = [str(tmp_path / "log.npy"), str(path)]
    whole = killed([arguments[0], str(tmp_path / "whole.checkpoint")], 600.0)
    draws, largest = random.Random(1), 0
    for _ in range(kills):
        result = killed(arguments, draws.uniform(0.3, 1.0))
        if result:
            # It came to its end before: the same, and once more from the beginning.
            assert result == whole
            path.unlink()
            largest = 0
            continue
        size = path.stat().st_size
        assert size >= largest
        largest = size
    fit = killed(arguments, 600.0)
    assert fit == whole
    # Nothing but the checkpoints, and at most one that was being written.
    others = {one.name for one in tmp_path.iterdir()} - {"log.npy", path.name, "whole.checkpoint"}
    assert others <= {f".{path.name}.part"}


def test_a_checkpoint_of_another_search_is_refused_and_kept(tmp_path: Path) -> None:
    path = tmp_path / "search.checkpoint"
    assert interrupted(path, 5, model="dahl")
    content = path.read_bytes()
    others: list[dict[str, Any]] = [
        {"method": pt.Descents(seed=2)},
        {"offset": False},
        {"parameters": {"mass": 0.1}},
    ]
    for other in others:
        with pytest.raises(pt.DataError, match=r"search\.checkpoint is that of another search"):
            pt.identify(record(), "dahl", checkpoint=path, **other)
    with pytest.raises(pt.DataError, match="is that of another search"):
        pt.identify(record(seed=1), "dahl", checkpoint=path)
    assert path.read_bytes() == content


@pytest.mark.parametrize("damage", ["cut", "changed", "other", "empty", "newer"])
def test_a_damaged_checkpoint_is_refused_and_kept(damage: str, tmp_path: Path) -> None:
    path = tmp_path / "search.checkpoint"
    assert interrupted(path, 5, model="dahl")
    content = path.read_bytes()
    expected = "is not as it was written"
    if damage == "cut":
        content = content[:-5]
    elif damage == "changed":
        content = content[:-5] + b"x" + content[-4:]
    elif damage == "newer":
        content, expected = content.replace(b"checkpoint 1 ", b"checkpoint 2 "), "is of version '2'"
    else:
        content = b"time,voltage\n0,1\n" if damage == "other" else b""
        expected = "is no checkpoint"
    path.write_bytes(content)
    with pytest.raises(pt.DataError, match=rf"search\.checkpoint {expected}"):
        pt.identify(record(), "dahl", checkpoint=path)
    assert path.read_bytes() == content


def test_what_cannot_be_a_checkpoint_is_refused_before_the_search(tmp_path: Path) -> None:
    def never(_: object) -> bool:
        raise AssertionError("searched")

    missing = tmp_path / "missing" / "search.checkpoint"
    with pytest.raises(pt.DataError, match=r"written: no such file or directory$"):
        pt.identify(record(), "dahl", checkpoint=missing, callback=never)
    with pytest.raises(pt.ParameterError, match="checkpoint is 3: expected the name of a file"):
        pt.identify(record(), "dahl", checkpoint=3, callback=never)  # type: ignore[arg-type]
    with pytest.raises(pt.ParameterError, match="whose parameters follow by least squares"):
        pt.identify(record(), "prandtl-ishlinskii", checkpoint=tmp_path / "c")
    assert not (tmp_path / "c").exists()


def test_several_records_go_on_too(tmp_path: Path) -> None:
    path = tmp_path / "search.checkpoint"
    logs = [record(), record(seed=1, count=1500)]
    expected = outcome(pt.identify(logs, "dahl"))
    left = iter(range(5))
    with pytest.raises(pt.Interrupted):
        pt.identify(logs, "dahl", checkpoint=path, callback=lambda _: next(left, None) is None)
    assert outcome(pt.identify(logs, "dahl", checkpoint=path)) == expected
    with pytest.raises(pt.DataError, match="is that of another search"):
        pt.identify(logs[::-1], "dahl", checkpoint=path)


@pytest.mark.slow
def test_the_command_goes_on(tmp_path: Path) -> None:
    log, path = tmp_path / "log.csv", tmp_path / "search.checkpoint"
    write_log(record(), log)
    arguments = ["identify", str(log), "--model", "dahl"]
    first, second = tmp_path / "first", tmp_path / "second"
    ran(*arguments, "--out", str(first))
    ran(*arguments, "--out", str(second), "--checkpoint", str(path))
    assert path.stat().st_size > 10_000
    files = [json.loads((folder / "dahl.json").read_text()) for folder in (first, second)]
    assert files[0] == files[1]
    both = [*arguments, "--model", "bouc-wen", "--checkpoint", str(path), "--out", str(tmp_path)]
    assert "--checkpoint is given with several models" in refusal(*both)
