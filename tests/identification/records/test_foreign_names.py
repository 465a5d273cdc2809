"""Names and units from outside in pictures: shown as they are, whatever is in them."""

from __future__ import annotations

import xml.etree.ElementTree as ET
from functools import cache
from typing import TYPE_CHECKING

import matplotlib as mpl
import numpy as np
import pytest

import piezotrack as pt
from piezotrack._support.files.writing import save_figures
from piezotrack.identification.views.plot import plot_loop
from records import published, quick

if TYPE_CHECKING:
    from pathlib import Path

    from matplotlib.figure import Figure

# A name, and how it is shown.
NAMES = {
    r"$\foo$": r"$\foo$",
    "$": "$",
    r"\$x$ \$": r"\$x$ \$",
    "a_b^c": "a_b^c",
    "\x1b[31mred\r": r"\x1b[31mred\r",
    "\N{RIGHT-TO-LEFT OVERRIDE}x": r"\u202ex",
    "\udcff": r"\udcff",
    # The font of the pictures has no such letters: a box each.
    "\u540d\u524d \N{PILE OF POO}": "\u540d\u524d \N{PILE OF POO}",
}


@cache
def parts() -> tuple[pt.XYStage, pt.Controller]:
    return pt.XYStage.xu_li_2010(seed=1), pt.Controller(
        dt=0.02, limits=(0.0, 75.0), feedback=pt.Pid.xu_li_2010()
    )


def compared(name: str, folder: Path) -> Figure:
    file = published().save(folder / "model.json")
    log = pt.Dataset(u=quick().u, y=quick().y, dt=quick().dt, drive_unit=name)
    other = pt.Dataset(u=quick().u, y=quick().y, dt=quick().dt, source=name)
    found = pt.compare(log[:2.0], [file], test=other[2.0:])
    object.__setattr__(found.rows[0], "title", name)
    return found.plot()


def loop(name: str, folder: Path) -> Figure:
    del folder
    log = pt.Dataset(u=quick().u, y=quick().y, dt=quick().dt, drive_unit=name)
    return plot_loop(log, published().simulate(log)).figure  # type: ignore[return-value]


def step(name: str, folder: Path) -> Figure:
    del folder
    t = np.arange(-100, 2000) / 5000.0
    late = np.maximum(t, 0.0)
    y = 118e-6 * (1.0 - np.exp(-65.0 * late) * np.cos(1000.0 * late))
    u = np.where(t >= 0.0, 75.0, 0.0)
    log = pt.Dataset(u=u, y=y, dt=2e-4, hold="zoh", drive_unit=name)
    return pt.identification.identify_step(log).plot()


def path(name: str, folder: Path) -> Figure:
    del folder
    stage, controller = parts()
    circle = pt.circle(frequency=1.0, radius=5e-6, duration=2.0)
    object.__setattr__(circle, "name", name)
    return pt.contour(stage, (controller, controller), circle, beyond_reach=True).plot()


SLOW = [pytest.param(picture, marks=pytest.mark.slow) for picture in (compared, step, path)]


@pytest.mark.parametrize("picture", [loop, *SLOW])
@pytest.mark.parametrize("name", NAMES)
def test_a_name_is_shown_as_it_is(picture: object, name: str, tmp_path: Path) -> None:
    assert callable(picture)
    with mpl.rc_context({"svg.fonttype": "none"}):
        # A warning would be an error here.
        save_figures({"picture": picture(name, tmp_path)}, tmp_path)
    assert (tmp_path / "picture.png").stat().st_size > 1000
    texts = ET.parse(tmp_path / "picture.svg").getroot().iter("{http://www.w3.org/2000/svg}text")
    shown = ["".join(text.itertext()) for text in texts]
    assert any(NAMES[name] in text for text in shown), shown
