"""Equations as MathML, which browsers draw without scripts, fonts or a network."""

from __future__ import annotations

from typing import Any
from xml.etree import ElementTree

from docutils import nodes
from latex2mathml.converter import convert
from sphinx.util import logging
from sphinx.util.math import get_node_equation_number

LOG = logging.getLogger(__name__)

NAMESPACE = "http://www.w3.org/1998/Math/MathML"
OPERATOR, SPACE = f"{{{NAMESPACE}}}mo", f"{{{NAMESPACE}}}mspace"
FUNCTIONS = {"sin", "cos", "tan", "tanh", "ln", "log", "exp", "max", "min"}  # set apart by a space
ElementTree.register_namespace("", NAMESPACE)


def mathml(latex: str, *, display: str) -> str:
    """Return a `<math>` element. Raises ValueError for LaTeX that has no MathML equivalent here."""
    try:
        root = ElementTree.fromstring(convert(latex, display=display))
    except Exception as error:  # the converter raises errors of many kinds
        raise ValueError(f"equation {latex!r} cannot be converted: {error}") from error
    # The converter passes on, as an identifier, a command that it does not know.
    for row in root.iter():
        for index in range(len(row) - 1, 0, -1):
            pair = row[index - 1], row[index]
            has_function = any(element.text in FUNCTIONS for element in pair)
            if has_function and all(element.tag != OPERATOR for element in pair):
                row.insert(index, ElementTree.Element(SPACE, width="0.167em"))
    unknown = [element.text for element in root.iter() if (element.text or "").startswith("\\")]
    if unknown:
        raise ValueError(f"equation {latex!r} has {', '.join(map(str, unknown))}, which is unknown")
    return ElementTree.tostring(root, encoding="unicode")


def _convert(node: nodes.math | nodes.math_block, display: str) -> str:
    try:
        return mathml(node.astext(), display=display)
    except ValueError as error:
        LOG.warning("%s", error, location=node, type="mathml")
        return ""


def visit_inline(self: Any, node: nodes.math) -> None:
    """Write an equation within a line."""
    self.body.append(_convert(node, "inline"))
    raise nodes.SkipNode


def visit_block(self: Any, node: nodes.math_block) -> None:
    """Write an equation of its own, with its number if it has one."""
    self.body.append(self.starttag(node, "div", CLASS="math"))
    self.body.append(_convert(node, "block"))
    if node["number"]:
        number = get_node_equation_number(self, node)
        self.body.append(f'<span class="eqno">({number})')
        self.add_permalink_ref(node, "Link to this equation")
        self.body.append("</span>")
    self.body.append("</div>\n")
    raise nodes.SkipNode


def setup(app: Any) -> dict[str, Any]:
    """Register the renderer, which `html_math_renderer` names."""
    app.add_html_math_renderer("mathml", (visit_inline, None), (visit_block, None))
    return {"version": "1", "parallel_read_safe": True, "parallel_write_safe": True}
