"""Figs. 5 and 8 to 11: block diagrams of the controllers as implemented here."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, NamedTuple

from ..._support.display.look import look
from ..._support.display.plot_style import drawing, heading, is_narrow, sheet, whole

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure, SubFigure

__all__ = ["plot_block_diagrams"]

# Width of a diagram, height of a block and radius of a summing point, in its own units.
WIDTH, TALL, RADIUS = 12.0, 1.0, 0.26
MINUS = "\N{MINUS SIGN}"
INK = "0.15"

Point = tuple[float, float]


class Block(NamedTuple):
    """A block: its middle, its width, and what it does."""

    x: float
    y: float
    width: float
    text: str


class Label(NamedTuple):
    """A signal or a sign: where it stands, and its name."""

    x: float
    y: float
    text: str


class Diagram(NamedTuple):
    """Blocks, summing points, paths of signals that end in an arrow, branches and labels."""

    title: str
    blocks: tuple[Block, ...]
    sums: tuple[Point, ...]
    paths: tuple[tuple[Point, ...], ...]
    branches: tuple[Point, ...]
    labels: tuple[Label, ...]


DAHL = Diagram(
    title="Fig. 5: Dahl hysteresis in feedback on the mechanics, (2), (7), (8)",
    blocks=(
        Block(2.2, 4.0, 1.2, "$T$"),
        Block(7.0, 4.0, 3.6, "$1 / (M s^2 + D s + K)$"),
        Block(7.0, 1.5, 4.6, "$\\dot V = A_h V \\dot x + B_h u_p \\dot x$,\n$F_h = C_h V$"),
    ),
    sums=((4.0, 4.0),),
    paths=(
        ((0.6, 4.0), (1.6, 4.0)),
        ((2.8, 4.0), (3.74, 4.0)),
        ((4.26, 4.0), (5.2, 4.0)),
        ((8.8, 4.0), (11.4, 4.0)),
        ((10.4, 4.0), (10.4, 1.5), (9.3, 1.5)),
        ((4.7, 1.5), (4.0, 1.5), (4.0, 3.74)),
    ),
    branches=((10.4, 4.0),),
    labels=(
        Label(0.3, 4.0, "$u$"),
        Label(11.7, 4.0, "$x$"),
        Label(4.45, 2.6, "$F_h$"),
        Label(3.7, 3.45, MINUS),
    ),
)
FEEDFORWARD = Diagram(
    title="Figs. 8 and 9: feedforward by the inverse, (21)",
    blocks=(
        Block(3.4, 4.0, 3.0, "$M s^2 + D s + K$"),
        Block(3.4, 1.5, 3.0, "Dahl along $x_d$"),
        Block(7.4, 4.0, 1.3, "$1 / T$"),
        Block(10.0, 4.0, 1.6, "stage"),
    ),
    sums=((5.8, 4.0),),
    paths=(
        ((0.6, 4.0), (1.9, 4.0)),
        ((1.3, 4.0), (1.3, 1.5), (1.9, 1.5)),
        ((4.9, 4.0), (5.54, 4.0)),
        ((4.9, 1.5), (5.8, 1.5), (5.8, 3.74)),
        ((6.06, 4.0), (6.75, 4.0)),
        ((8.05, 4.0), (9.2, 4.0)),
        ((10.8, 4.0), (11.4, 4.0)),
    ),
    branches=((1.3, 4.0),),
    labels=(
        Label(0.25, 4.0, "$x_d$"),
        Label(6.25, 2.6, "$F_h$"),
        Label(6.15, 3.45, "+"),
        Label(8.6, 4.4, "$u_{FF}$"),
        Label(11.7, 4.0, "$x$"),
    ),
)
PID = Diagram(
    title="Fig. 10: PID with back-calculation, (22) to (25)",
    blocks=(
        Block(2.6, 4.0, 2.8, "PID,\nincremental"),
        Block(8.6, 4.0, 1.6, "limits"),
        Block(4.9, 1.2, 1.5, "$T_s / T_t$"),
    ),
    sums=((5.8, 4.0), (8.6, 1.2)),
    paths=(
        ((0.5, 4.0), (1.2, 4.0)),
        ((4.0, 4.0), (5.54, 4.0)),
        ((5.8, 5.4), (5.8, 4.26)),
        ((6.06, 4.0), (7.8, 4.0)),
        ((9.4, 4.0), (11.4, 4.0)),
        ((10.3, 4.0), (10.3, 1.2), (8.86, 1.2)),
        ((7.0, 4.0), (7.0, 2.4), (8.6, 2.4), (8.6, 1.46)),
        ((8.34, 1.2), (5.65, 1.2)),
        ((4.15, 1.2), (2.6, 1.2), (2.6, 3.5)),
    ),
    branches=((10.3, 4.0), (7.0, 4.0)),
    labels=(
        Label(0.25, 4.0, "$e$"),
        Label(4.75, 4.4, "$u_{FB}$"),
        Label(5.8, 5.75, "$u_{FF} + u_{RC}$"),
        Label(6.5, 4.4, "$u$"),
        Label(11.7, 4.0, "$v$"),
        Label(9.2, 0.85, "+"),
        Label(8.95, 1.8, MINUS),
        Label(7.0, 1.55, f"$v {MINUS} u$"),
    ),
)
ALL = Diagram(
    title="Fig. 11: feedforward, feedback and the plugged-in repetitive part, (26) to (30)",
    blocks=(
        Block(4.6, 5.3, 1.9, "inverse"),
        Block(4.6, 3.5, 1.9, "PID"),
        Block(4.6, 1.7, 2.6, f"$K_q Q / (1 {MINUS} Q)$"),
        Block(8.3, 3.5, 1.3, "limits"),
        Block(10.25, 3.5, 1.5, "stage,\nsensor"),
    ),
    sums=((1.9, 3.5), (6.7, 3.5)),
    paths=(
        ((0.6, 3.5), (1.64, 3.5)),
        ((1.1, 3.5), (1.1, 5.3), (3.65, 5.3)),
        ((2.16, 3.5), (3.65, 3.5)),
        ((2.7, 3.5), (2.7, 1.7), (3.3, 1.7)),
        ((5.55, 3.5), (6.44, 3.5)),
        ((5.55, 5.3), (6.7, 5.3), (6.7, 3.76)),
        ((5.9, 1.7), (6.7, 1.7), (6.7, 3.24)),
        ((6.96, 3.5), (7.65, 3.5)),
        ((8.95, 3.5), (9.5, 3.5)),
        ((11.0, 3.5), (11.6, 3.5)),
        ((11.25, 3.5), (11.25, 0.5), (1.9, 0.5), (1.9, 3.24)),
    ),
    branches=((1.1, 3.5), (2.7, 3.5), (11.25, 3.5)),
    labels=(
        Label(0.25, 3.5, "$x_d$"),
        Label(2.45, 3.85, "$e$"),
        Label(1.6, 2.95, MINUS),
        Label(7.15, 4.7, "$u_{FF}$"),
        Label(6.0, 3.9, "$u_{FB}$"),
        Label(7.15, 2.3, "$u_{RC}$"),
        Label(7.25, 3.85, "$u$"),
        Label(9.22, 3.85, "$v$"),
        Label(11.8, 3.5, "$x$"),
    ),
)


DIAGRAMS = {"dahl": DAHL, "feedforward": FEEDFORWARD, "pid": PID, "all": ALL}


@drawing
def plot_block_diagrams(fig: Figure | SubFigure | None = None) -> Figure:
    """Draw the four diagrams, two by two."""
    rows = (("dahl", "feedforward"), ("pid", "all"))
    figure, axes = sheet(fig, (WIDTH, 6.8), rows, heights=(0.8, 1.15))
    for name, ax in axes.items():
        _draw(DIAGRAMS[name], ax)
    return whole(figure)


def _draw(diagram: Diagram, ax: Axes) -> None:
    from matplotlib.patches import Circle, Rectangle

    heading(ax, diagram.title)
    rows = [y for path in diagram.paths for _, y in path]
    ax.set(xlim=(0.0, WIDTH), ylim=(min(rows) - 0.8, max(rows) + 0.8), aspect="equal")
    ax.axis("off")
    # Letters shrink with the diagram, and are read in a column still.
    wide = whole(ax.figure).get_figwidth() / (1 if is_narrow(ax.figure, (WIDTH, WIDTH)) else 2)
    size = max(6.5, 18.0 * wide / WIDTH)
    middle: dict[str, Any] = {"ha": "center", "va": "center", "fontsize": size}
    thin = {"linewidth": 0.7 if look().paper else 1.0}
    outline: dict[str, Any] = {"facecolor": "white", "edgecolor": INK, **thin}
    for block in diagram.blocks:
        corner = (block.x - 0.5 * block.width, block.y - 0.5 * TALL)
        ax.add_patch(Rectangle(corner, block.width, TALL, **outline))
        ax.text(block.x, block.y, block.text, **middle)
    for place in diagram.sums:
        ax.add_patch(Circle(place, RADIUS, **outline))
        ax.text(*place, r"$\Sigma$", **middle)
    arrow = {"arrowstyle": "-|>", "color": INK, "shrinkA": 0.0, "shrinkB": 0.0, **thin}
    arrow["mutation_scale"] = size
    for path in diagram.paths:
        ax.plot(*zip(*path, strict=True), color=INK, linewidth=1.0, solid_joinstyle="miter")
        ax.annotate("", path[-1], path[-2], arrowprops=arrow)
    for place in diagram.branches:
        ax.plot(*place, "o", color=INK, markersize=3.5)
    for label in diagram.labels:
        ax.text(label.x, label.y, label.text, **middle)
