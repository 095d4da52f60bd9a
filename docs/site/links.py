"""Hooks of mkdocs: the repository's own pages become pages of the site, and links between them keep working there.

Pages link to each other by plain relative links, which a forge follows. The site holds docs/ alone, so README,
CONTRIBUTING and CHANGELOG are added to it below project/, and links to them are led there. A link to any other file of
the repository becomes plain text, after a look that the file exists.
"""

import logging
import posixpath
import re
from pathlib import Path
from typing import Any

from mkdocs.structure.files import File, Files

ROOT = Path(__file__).parents[2]
PROJECT = {f"{name}.md": f"project/{name.lower()}.md" for name in ("README", "CONTRIBUTING", "CHANGELOG")}

# A link or picture outside of code: [text](target), ![text](target).
_LINK = re.compile(r"(?<!`)(!?)\[([^\[\]]*(?:\[[^\[\]]*\][^\[\]]*)*)\]\(([^()\s]+)\)")
_FENCE = re.compile(r"^(```.*?^```)", re.DOTALL | re.MULTILINE)

_log = logging.getLogger("mkdocs.hooks.links")


def on_files(files: Files, config: Any) -> Files:
    """Add the repository's own pages to the site."""
    for name, page in PROJECT.items():
        files.append(File.generated(config, page, content=(ROOT / name).read_text(encoding="utf-8")))
    return files


def on_page_markdown(markdown: str, page: Any, config: Any, files: Files) -> str:
    """The page with its links led to where their targets are in the site."""
    source = next((name for name, target in PROJECT.items() if target == page.file.src_uri), None)
    here = source or f"docs/{page.file.src_uri}"  # in the repository
    parts = _FENCE.split(markdown)
    return "".join(
        part if part.startswith("```") else _LINK.sub(lambda match: _led(match, here, page.file.src_uri), part)
        for part in parts
    )


def _led(match: re.Match[str], here: str, page: str) -> str:
    """One link, as it must stand on `page` of the site."""
    mark, text, target = match.groups()
    path, hash_, anchor = target.partition("#")
    if not path or "://" in path or path.startswith("mailto:"):
        return match[0]
    wanted = posixpath.normpath(posixpath.join(posixpath.dirname(here), path))  # in the repository
    if not (ROOT / wanted).exists():
        _log.warning("%s: link to %s, and the repository has no %s", here, target, wanted)
        return match[0]
    inside = PROJECT.get(wanted) or (wanted.removeprefix("docs/") if wanted.startswith("docs/") else None)
    if inside is None:
        return text
    return f"{mark}[{text}]({posixpath.relpath(inside, posixpath.dirname(page) or '.')}{hash_}{anchor})"
