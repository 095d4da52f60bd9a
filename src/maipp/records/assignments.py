"""Options as people type them after `--set`."""

from collections.abc import Iterable

from maipp.errors import InputError


def assignments(settings: Iterable[Iterable[str]]) -> dict[str, str]:
    """The `--set KEY=VALUE` items as a mapping; raises `InputError` for one that is none, and for a key given twice."""
    found: dict[str, str] = {}
    for item in (item for group in settings for item in group):
        key, equals, value = item.partition("=")
        if not (equals and key.strip()):
            raise InputError(f"--set {item}: not an assignment; give KEY=VALUE, such as seed=1")
        key = key.strip().replace("-", "_")
        if key in found:
            raise InputError(f"--set {key}: given twice; keep one")
        found[key] = value.strip()
    return found
