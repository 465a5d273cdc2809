"""Draw the architecture from the code: packages in layers, each with its docstring's first line."""

from __future__ import annotations

import ast
import re
import tomllib
from pathlib import Path
from textwrap import shorten
from typing import TYPE_CHECKING, Any

import matplotlib as mpl
import matplotlib.pyplot as plt
from matplotlib.patches import Rectangle

if TYPE_CHECKING:
    from matplotlib.axes import Axes

HERE = Path(__file__).parent
ROOT = HERE.parent
PACKAGE = ROOT / "python" / "piezotrack"
ROAD = (
    ("log", "data/"),
    ("problem", "problem/"),
    ("method", "methods/, solve/"),
    ("core", "rust/core"),
    ("result", "fitted/"),
    ("view", "views/"),
)


def first_line(folder: Path) -> str:
    """Return the first line of a package's docstring."""
    return (
        ast.get_docstring(ast.parse((folder / "__init__.py").read_text("utf-8"))) or ""
    ).partition("\n")[0]


def layers(container: str) -> list[list[str]]:
    """Read the layers of a package from the contracts of import-linter, from the top down."""
    contracts = tomllib.loads((ROOT / "pyproject.toml").read_text("utf-8"))["tool"]["importlinter"]
    for contract in contracts["contracts"]:
        if contract["type"] == "layers" and container in contract["containers"]:
            return [re.split(r" [|:] ", layer) for layer in contract["layers"]]
    folder = ROOT / "python" / Path(*container.split("."))
    return [[room.name] for room in sorted(folder.iterdir()) if (room / "__init__.py").exists()]


def draw() -> None:
    """Draw the layers of the package, with the rooms of the two largest, and the road."""
    mpl.rcParams |= {"svg.hashsalt": "piezotrack", "svg.fonttype": "none", "font.size": 8.0}
    figure, ax = plt.subplots(figsize=(10.0, 8.2))
    ax.set_axis_off()
    top = layers("piezotrack")
    inner = {name: layers(f"piezotrack.{name}") for name in ("identification", "control")}
    y = 0.0
    for number, (name, where) in enumerate(ROAD):
        x = number / len(ROAD)
        box(ax, (x + 0.005, y + 0.25), (1 / len(ROAD) - 0.03, 0.75), name, where, "#dfeaf7")
        if number:
            ax.annotate("", (x + 0.003, y + 0.62), (x - 0.022, y + 0.62),
                        arrowprops={"arrowstyle": "-|>", "color": "0.3"})  # fmt: skip
    y += 1.35
    for layer in top:
        height = 0.8
        for place, name in enumerate(layer):
            width = 1.0 / len(layer)
            if name in inner:
                height = 0.42 * len(inner[name]) + 0.5
                box(ax, (0.0, y), (1.0, height), f"{name}/", "", "#f4f4f4")
                for row, beside in enumerate(inner[name]):
                    for column, room in enumerate(beside):
                        wide = 0.78 / len(beside)
                        folder = PACKAGE / name / room
                        said = first_line(folder) if folder.is_dir() else ""
                        label = f"{room}/" if folder.is_dir() else f"{room}.py"
                        corner = (0.2 + wide * column, y + 0.2 + 0.42 * row)
                        row_of(ax, corner, wide - 0.01, label, said)
            else:
                folder = PACKAGE / name
                said = first_line(folder) if folder.is_dir() else ""
                label = f"{name}/" if folder.is_dir() else f"{name}.py"
                box(ax, (place * width, y), (width - 0.01, height), label, said, "#eef5ea")
        y += height + 0.15
    ax.set_xlim(-0.01, 1.01)
    ax.set_ylim(y, 0.0)
    figure.savefig(HERE / "architecture.svg", bbox_inches="tight", metadata={"Date": None})
    plt.close(figure)


def box(
    ax: Axes,
    corner: tuple[float, float],
    size: tuple[float, float],
    name: str,
    text: str,
    colour: str,
) -> None:
    """Draw a room with its name and a line of text."""
    ax.add_patch(Rectangle(corner, *size, facecolor=colour, edgecolor="0.5", lw=0.6))
    ax.text(corner[0] + 0.008, corner[1] + 0.32, name, weight="bold", va="center")
    style: dict[str, Any] = {"fontsize": 6.5, "va": "center", "color": "0.25"}
    shown = shorten(text, max(int(140 * size[0]), 18), placeholder="...")
    ax.text(corner[0] + 0.008, corner[1] + 0.6, shown, **style)


def row_of(ax: Axes, corner: tuple[float, float], width: float, name: str, text: str) -> None:
    """Draw an inner room as one row."""
    ax.add_patch(Rectangle(corner, width, 0.36, facecolor="white", edgecolor="0.6", lw=0.5))
    ax.text(corner[0] + 0.006, corner[1] + 0.18, name, weight="bold", va="center", fontsize=7)
    if width > 0.4:
        ax.text(corner[0] + 0.13, corner[1] + 0.18, text, va="center", fontsize=6.5, color="0.25")


if __name__ == "__main__":
    draw()
