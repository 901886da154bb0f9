"""Formulas of docstrings as MathML, which browsers draw by themselves."""

from __future__ import annotations

import re
import textwrap

from latex2mathml.converter import convert

_BLOCK = re.compile(r"^\.\. math:: *(.*(?:\n(?:[ \t]+.*|[ \t]*(?=\n[ \t]+)))*)", re.M)
_INLINE = re.compile(r":math:`([^`]+)`")
_DOI = re.compile(r"\bdoi:(10\.\S+?)(?=[.,;)]*(?:\s|$))")


def shown(latex: str, block: bool = True) -> str:
    r"""A formula as MathML.

    >>> shown(r"\sigma = E \varepsilon", block=False)[:37]
    '<math xmlns="http://www.w3.org/1998/M'
    """
    # Thin spaces are no loss; a pair of & aligns nothing in one line.
    return str(convert(latex.strip(), display="block" if block else "inline"))


def markdown(docstring: str) -> str:
    """A docstring with its formulas shown and its references linked."""

    def block(found: re.Match[str]) -> str:
        latex = " ".join(textwrap.dedent(found[1]).split())
        return f'<div class="formula" tabindex="0">{shown(latex)}</div>\n'

    text = _BLOCK.sub(block, docstring)
    text = _INLINE.sub(lambda m: shown(m[1], block=False), text)
    text = _DOI.sub(r"[doi:\1](https://doi.org/\1)", text)
    return text.replace("``", "`")
