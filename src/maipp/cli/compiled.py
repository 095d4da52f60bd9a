"""Compiled programs, kept between runs."""

import os
import sys
from pathlib import Path


def keep_compiled() -> None:
    """Have JAX keep compiled programs, in the processes that this one starts as well; must run before JAX is used."""
    folder = cache_folder()
    # JAX reads both when it is imported; what the user has set for JAX itself wins.
    if folder is not None:
        os.environ.setdefault("JAX_COMPILATION_CACHE_DIR", str(folder))
        os.environ.setdefault("JAX_PERSISTENT_CACHE_MIN_COMPILE_TIME_SECS", "0.5")  # quicker to compile than to read


def cache_folder() -> Path | None:
    """Where compiled programs are kept: `MAIPP_CACHE` (None if it is empty), else below the user's cache folder."""
    chosen = os.environ.get("MAIPP_CACHE")
    if chosen is not None:
        return Path(chosen) if chosen else None
    if sys.platform == "darwin":
        return Path.home() / "Library" / "Caches" / "maipp"
    if sys.platform == "win32":
        return Path(os.environ.get("LOCALAPPDATA") or Path.home() / "AppData" / "Local") / "maipp" / "Cache"
    return Path(os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache") / "maipp"
