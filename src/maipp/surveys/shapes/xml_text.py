"""XML that people bring: bounded, without a document type, so that nothing in it grows or reaches out of the file."""

import re
from collections.abc import Iterator
from xml.etree import ElementTree as Xml

from maipp.surveys.shapes.drawing import wrong

LARGEST = 50_000_000  # bytes of a file; a shore line of a million vertices has half of that
_ENCODING = re.compile(rb"""^<\?xml[^>]{0,200}?encoding\s*=\s*["']([A-Za-z0-9._-]{1,40})["']""")


def parse_xml(content: bytes, where: str, what: str) -> Xml.Element:
    """The root element. Raises `InputError` for what is no XML, is too large or declares a document type."""
    if len(content) > LARGEST:
        wrong(where, f"has {len(content) / 1e6:.0f} MB; simplify it to {LARGEST / 1e6:.0f} MB at most")
    text = _decoded(content, where, what)
    if "<!DOCTYPE" in text:
        wrong(where, f"declares a document type, which {what} has none of; save it again without")
    try:
        # A text, not bytes: what its first line says of the encoding is past.
        return Xml.fromstring(text.strip())
    except Xml.ParseError as error:
        wrong(where, f"is no {what}, or is damaged ({error})")


def _decoded(content: bytes, where: str, what: str) -> str:
    told = _ENCODING.match(content)
    wide = content[:2] in (b"\xff\xfe", b"\xfe\xff")
    encoding = "utf-16" if wide else told[1].decode() if told else "utf-8-sig"
    try:
        return content.decode("utf-8-sig" if encoding.lower() in ("utf-8", "utf8") else encoding)
    except (UnicodeError, LookupError):
        wrong(where, f"is no {what}: not text in {encoding}; save it again as UTF-8")


def local_name(element: Xml.Element) -> str:
    """The name of an element without its namespace."""
    return element.tag.rpartition("}")[2] if isinstance(element.tag, str) else ""


def children(element: Xml.Element, name: str) -> Iterator[Xml.Element]:
    """The elements of this name right below."""
    return (child for child in element if local_name(child) == name)


def text_of(element: Xml.Element, name: str) -> str:
    """The text of the first element of this name right below, in one line; empty without any."""
    return next((" ".join((child.text or "").split()) for child in children(element, name)), "")
