"""Options as people type them after `--set` and the like."""

from collections.abc import Iterable

from maipp.errors import InputError


def assignments(settings: Iterable[Iterable[str]], flag: str = "--set") -> dict[str, str]:
    """The `--set KEY=VALUE` items as a mapping; raises `InputError` for one that is none, and for a key given twice."""
    found: dict[str, str] = {}
    for item in (item for group in settings for item in group):
        key, equals, value = item.partition("=")
        if not (equals and key.strip()):
            raise InputError(f"{flag} {item}: not an assignment; give KEY=VALUE, such as seed=1")
        key = key.strip().replace("-", "_")
        if key in found:
            raise InputError(f"{flag} {key}: given twice; keep one")
        found[key] = value.strip()
    return found
