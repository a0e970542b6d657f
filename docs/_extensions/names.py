"""Names of the library in code type, such as `ncti.ladar.range_extent`, link to the reference.

Pages need no markup of Sphinx for it, so that they read as well where they are not built.
"""

from __future__ import annotations

import re
from typing import Any

from docutils import nodes
from sphinx.addnodes import pending_xref
from sphinx.transforms.post_transforms import SphinxPostTransform

NAME = re.compile(r"ncti(\.\w+)+")


class LinkNames(SphinxPostTransform):
    """Make references of names, before references are resolved."""

    default_priority = 5

    def run(self, **kwargs: Any) -> None:
        """Replace each name by a reference to it; one that has no entry stays as it is."""
        for node in list(self.document.findall(nodes.literal)):
            text = node.astext()
            inside = isinstance(node.parent, nodes.reference | pending_xref)
            if inside or not NAME.fullmatch(text):
                continue
            reference = pending_xref(
                "", refdomain="py", reftype="obj", reftarget=text, refdoc=self.env.docname
            )
            node.replace_self(reference)
            reference += node


def setup(app: Any) -> dict[str, Any]:
    """Register the transform."""
    app.add_post_transform(LinkNames)
    return {"version": "1", "parallel_read_safe": True, "parallel_write_safe": True}
