"""Figs. 5 and 8 to 11: block diagrams of the controllers as implemented here."""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

__all__ = ["draw"]


class Block(NamedTuple):
    """A block, or a signal where `boxed` is false, at a place in units of a column and a row."""

    text: str
    x: float
    y: float
    boxed: bool = True


class Diagram(NamedTuple):
    """Blocks by name, and arrows between them; a sign or a name stands beside an arrow."""

    title: str
    blocks: dict[str, Block]
    arrows: tuple[tuple[str, str, str], ...]


STAGE = "stage"
DIAGRAMS = (
    Diagram(
        "Fig. 5: Dahl hysteresis in feedback on the mechanics, (2), (7), (8)",
        {
            "u": Block("u", 0, 1, False),
            "T": Block("T", 1, 1),
            "sum": Block("+", 2, 1),
            "plant": Block("1 / (M s$^2$ + D s + K)", 3.3, 1),
            "x": Block("x", 5, 1, False),
            "dahl": Block("V' = A$_h$ V x' + B$_h$ u$_p$ x',  F$_h$ = C$_h$ V", 3.3, 0),
        },
        (("u", "T", ""), ("T", "sum", ""), ("sum", "plant", ""), ("plant", "x", ""),
         ("plant", "dahl", ""), ("dahl", "sum", "-")),
    ),
    Diagram(
        "Figs. 8 and 9: feedforward by the inverse, (21)",
        {
            "xd": Block("x$_d$", 0, 1, False),
            "mech": Block("M s$^2$ + D s + K", 1.3, 1),
            "dahl": Block("Dahl along x$_d$", 1.3, 0),
            "sum": Block("+", 2.5, 1),
            "T": Block("1 / T", 3.3, 1),
            STAGE: Block("stage", 4.4, 1),
            "x": Block("x", 5.4, 1, False),
        },
        (("xd", "mech", ""), ("xd", "dahl", ""), ("mech", "sum", ""), ("dahl", "sum", "F$_h$"),
         ("sum", "T", ""), ("T", STAGE, "u$_{FF}$"), (STAGE, "x", "")),
    ),
    Diagram(
        "Fig. 10: PID with back-calculation, (22) to (25)",
        {
            "e": Block("e", 0, 1, False),
            "pid": Block("PID, incremental", 1.3, 1),
            "sum": Block("+", 2.7, 1),
            "clip": Block("limits", 3.7, 1),
            "v": Block("v", 5.0, 1, False),
            "back": Block("T$_s$ / T$_t$", 2.7, 0),
            "ff": Block("u$_{FF}$ + u$_{RC}$", 2.0, 1.8, False),
        },
        (("e", "pid", ""), ("pid", "sum", "u$_{FB}$"), ("ff", "sum", ""), ("sum", "clip", "u"),
         ("clip", "v", ""), ("clip", "back", "     v - u"), ("back", "pid", "")),
    ),
    Diagram(
        "Fig. 11: feedforward, feedback and the plugged-in repetitive part, (26) to (30)",
        {
            "xd": Block("x$_d$", 0, 1, False),
            "e": Block("-", 1, 1),
            "inv": Block("inverse", 2.2, 1.9),
            "pid": Block("PID", 2.2, 1),
            "rc": Block("K$_q$ Q / (1 - Q)", 2.2, 0.1),
            "sum": Block("+", 3.3, 1),
            "clip": Block("limits", 4.1, 1),
            STAGE: Block("stage, sensor", 5.2, 1),
            "x": Block("x", 6.2, 1, False),
            "back": Block("", 5.2, -0.6, False),
        },
        (("xd", "e", ""), ("xd", "inv", ""), ("e", "pid", "e"), ("e", "rc", ""),
         ("inv", "sum", "u$_{FF}$"), ("pid", "sum", "u$_{FB}$"), ("rc", "sum", "u$_{RC}$"),
         ("sum", "clip", "u"), ("clip", STAGE, "v"), (STAGE, "x", "")),
    ),
)  # fmt: skip


def draw() -> Figure:
    """Draw the four diagrams.

    Returns
    -------
    matplotlib.figure.Figure
        Two by two.
    """
    import matplotlib.pyplot as plt

    figure = plt.figure(figsize=(12.0, 5.0), layout="constrained")
    for diagram, ax in zip(DIAGRAMS, figure.subplots(2, 2).flat, strict=True):
        _draw(diagram, ax)
    return figure


def _draw(diagram: Diagram, ax: Axes) -> None:
    ax.set_title(diagram.title, fontsize="medium", loc="left")
    ax.set(xlim=(-0.4, 6.5), ylim=(-0.8, 2.3))
    ax.axis("off")
    shown = {}
    for name, block in diagram.blocks.items():
        frame = {"boxstyle": "round,pad=0.35", "facecolor": "white", "edgecolor": "0.2"}
        shown[name] = ax.text(
            block.x,
            block.y,
            block.text,
            ha="center",
            va="center",
            fontsize="small",
            bbox=frame if block.boxed else {"boxstyle": "round,pad=0.2", "alpha": 0.0},
            zorder=3,
        )
    for start, end, label in diagram.arrows:
        tail, head = diagram.blocks[start], diagram.blocks[end]
        ax.annotate(
            "",
            (head.x, head.y),
            (tail.x, tail.y),
            arrowprops={
                "arrowstyle": "-|>",
                "color": "0.2",
                "patchA": shown[start].get_bbox_patch(),
                "patchB": shown[end].get_bbox_patch(),
            },
        )
        slanted = tail.x != head.x and tail.y != head.y
        middle = (0.5 * (tail.x + head.x) + 0.3 * slanted, 0.5 * (tail.y + head.y) + 0.2)
        ax.text(*middle, label, ha="center", va="center", fontsize="small", color="0.2")
    if "back" in diagram.blocks and not diagram.blocks["back"].boxed:
        # Around the loop: from the sensor back to the error.
        below = diagram.blocks["back"]
        e = diagram.blocks["e"]
        ax.plot([below.x, below.x, e.x], [0.75, below.y, below.y], color="0.2", linewidth=1.0)
        arrow = {"arrowstyle": "-|>", "color": "0.2", "patchB": shown["e"].get_bbox_patch()}
        ax.annotate("", (e.x, e.y), (e.x, below.y), arrowprops=arrow)
