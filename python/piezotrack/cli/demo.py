"""``piezotrack demo``: the whole story without any file."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from .options import Out, can_be_folder, list_files
from .words import in_words

if TYPE_CHECKING:
    from ..identification import Identification

__all__ = ["demo_command"]


@in_words
def demo_command(
    out: Out = Path("demo"),
    seed: Annotated[int, typer.Option(help="Same seed, same result.")] = 1,
) -> None:
    """Show the way from a log to a model, on a log of a built-in stage."""
    from ..demo import demo_log, identify_demo, write_log
    from ..report import make_folder, save_identification

    log = demo_log(seed)
    can_be_folder(out)
    fit = identify_demo(log, seed=seed)
    rest = fit.score(log.full[fit.data.t[-1] :], offset=fit.offset)
    folder = make_folder(out)
    written = [write_log(log, folder / "log.csv"), *save_identification(fit, folder, shown=log)]
    print("A stage with second-order Dahl hysteresis, driven 12 s with 0.25 Hz, 0 to 75 V.")
    print("Mass, damping, stiffness and piezo coefficient are searched on the first 4 s;")
    print("the hysteresis is held, and with it the scale of the forces.\n")
    print(fit.summary())
    print(f"\nthe other 8 s, not fitted: {rest}")
    _compare(fit)
    list_files(written)


def _compare(fit: Identification) -> None:
    """Show what the stage of the demonstration really has."""
    from ..models import DahlStage

    true = DahlStage.xu_li_2010()
    found = fit.model
    for name, symbol in (("damping", "D"), ("stiffness", "K"), ("piezo_coefficient", "T")):
        share = 100.0 * (getattr(found, name) / getattr(true, name) - 1.0)
        print(
            f"  {symbol} found {getattr(found, name):.6g}, true {getattr(true, name):.6g}: "
            f"{round(share, 3) + 0.0:+.3f} %"
        )
