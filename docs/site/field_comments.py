"""An extension of griffe, which reads the code for the API pages: a field's comment is its description.

Fields of dataclasses, modules and named tuples say their shape and unit in a comment beside them, or above where there
is no room.
"""

import ast
import io
import re
import tokenize
from pathlib import Path
from typing import Any

import griffe

_cache: dict[Path, dict[int, str]] = {}


def comments(path: Path) -> dict[int, str]:
    """The comments of a file by line; alone on their lines they have a line break in front."""
    if path not in _cache:
        text = path.read_text(encoding="utf-8")
        _cache[path] = {
            token.start[0]: ("\n" if token.line.lstrip().startswith("#") else "") + token.string.lstrip("# ").strip()
            for token in tokenize.generate_tokens(io.StringIO(text).readline)
            if token.type == tokenize.COMMENT
        }
    return _cache[path]


def comment_of(path: Path, first: int, last: int) -> str | None:
    """What is said beside the lines of a field, or else in the lines above it."""
    found = comments(path)
    beside = [found[line] for line in range(first, last + 1) if line in found]
    if not beside:
        while found.get(first - 1, "").startswith("\n"):
            first -= 1
            beside.insert(0, found[first])
    text = " ".join(part.strip() for part in beside)
    text = re.sub(r"(?:type: ignore|noqa)\S*( *#)?", "", text).strip()
    return text or None


class FieldComments(griffe.Extension):
    """Describes attributes of classes by their comments."""

    def on_attribute_instance(
        self, *, node: ast.AST | griffe.ObjectNode, attr: griffe.Attribute, agent: Any, **kwargs: Any
    ) -> None:
        """Give an attribute that has no docstring its comment."""
        inside_class = attr.parent is not None and attr.parent.is_class
        if attr.docstring or not inside_class or attr.lineno is None or not isinstance(attr.filepath, Path):
            return
        text = comment_of(attr.filepath, attr.lineno, attr.endlineno or attr.lineno)
        if text:
            sentence = text[0].upper() + text[1:] + ("" if text.endswith(".") else ".")
            attr.docstring = griffe.Docstring(sentence, parent=attr)
