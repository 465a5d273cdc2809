"""Links: to the reference from names as `Dataset.cut` and ``pt.identify``, to files beside docs.

Markdown outside of the site, as ../benches/README.md, is a file to download.
"""

from __future__ import annotations

import re
from typing import TYPE_CHECKING, Any

from docutils import nodes
from sphinx import addnodes
from sphinx.transforms import SphinxTransform
from sphinx.util.nodes import make_refnode

if TYPE_CHECKING:
    from sphinx.application import Sphinx
    from sphinx.environment import BuildEnvironment

__all__ = ["setup"]

NAME = re.compile(r"pt((?:\.[A-Za-z_]\w*)+)(\(.*\))?")


class CodeToReference(SphinxTransform):
    """Make a link of each code in a line that begins with ``pt.``, and of no word of a type."""

    default_priority = 400

    def apply(self, **_: Any) -> None:
        """Put a reference in place of each, which stays code where nothing has that name."""
        # Of "array_like, shape (records, n)" Sphinx looks for something public called `records`.
        for word in list(self.document.findall(addnodes.pending_xref)):
            if word["reftype"] == "class" and word["reftarget"].islower():
                word.replace_self(word.children)
        # As in `import piezotrack as pt`.
        for prefix in self.document.findall(addnodes.desc_addname):
            text = prefix.astext().replace("piezotrack", "pt", 1)
            prefix.clear()
            prefix += nodes.Text(text)
        for node in list(self.document.findall(nodes.literal)):
            found = NAME.fullmatch(node.astext())
            if found is None or isinstance(node.parent, addnodes.pending_xref | nodes.reference):
                continue
            link = addnodes.pending_xref(
                "",
                refdomain="py",
                reftype="obj",
                reftarget=f"piezotrack{found[1]}",
                refexplicit=True,
                refwarn=False,
                refdoc=self.env.docname,
            )
            node.replace_self(link)
            link += node


def resolve(
    app: Sphinx, env: BuildEnvironment, node: addnodes.pending_xref, content: nodes.Element
) -> nodes.Element | None:
    """Find the public name that a short one means, as `cut` of `Dataset.cut`, if it is one only."""
    if node.get("refdomain") != "py":
        return None
    target = node["reftarget"].removeprefix("pt.").removeprefix("piezotrack.").removesuffix("()")
    objects = env.get_domain("py").objects  # type: ignore[attr-defined]
    ends = f".{target}"
    found = [name for name, entry in objects.items() if name.endswith(ends) and not entry.aliased]
    if len(found) != 1:
        return None
    entry = objects[found[0]]
    # A word in quotes, as the argument `models`, is not some attribute of that name.
    if "." not in target and entry.objtype in ("attribute", "method", "property"):
        return None
    return make_refnode(
        app.builder, node["refdoc"], entry.docname, entry.node_id, content, found[0]
    )


def outside(_: Sphinx, docname: str, source: list[str]) -> None:
    """Name a Markdown file outside of the site as a file."""
    if "/" not in docname:
        source[0] = re.sub(r"\]\((\.\./[^)#\s]+\.md)(#[^)\s]*)?\)", r"](path:\1)", source[0])


def setup(app: Sphinx) -> dict[str, bool]:
    """Connect all three."""
    app.add_transform(CodeToReference)
    app.connect("source-read", outside)
    app.connect("missing-reference", resolve)
    return {"parallel_read_safe": True, "parallel_write_safe": True}
