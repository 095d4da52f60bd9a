"""What Linux control groups allow this process: the quotas of a container, a batch job or a service."""

from collections.abc import Iterator
from pathlib import Path


def cpu_quota(root: Path = Path("/")) -> float | None:
    """Processors' worth of time that this process may use at most; None where nothing limits it.

    Control groups of version 2 (`cpu.max`) and 1 (`cpu.cfs_quota_us`), the tightest of those that the process is in.
    `root` is where `proc` and `sys` are.
    """
    quotas = []
    for group in _groups(root, "cpu"):
        quota, period = [*_words(group / "cpu.max"), "", ""][:2]
        if not period:
            quota, period = ("".join(_words(group / f"cpu.cfs_{name}_us")) for name in ("quota", "period"))
        if quota.isdigit() and period.isdigit() and int(quota) > 0 and int(period) > 0:  # not `max` or -1
            quotas.append(int(quota) / int(period))
    return min(quotas, default=None)


def memory_limit(root: Path = Path("/")) -> int | None:
    """Bytes of memory that this process and those it shares a group with may use; None where nothing limits them."""
    limits = [
        int(word)
        for group in _groups(root, "memory")
        for name in ("memory.max", "memory.limit_in_bytes")
        for word in _words(group / name)
        if word.isdigit()  # not `max`
    ]
    return min(limits, default=None)


def _groups(root: Path, controller: str) -> Iterator[Path]:
    """The folders of the groups that this process is in, the innermost first, as far as they can be seen.

    Inside a container the file system begins at the container's own group, whatever path `/proc` tells.
    """
    mounts = root / "sys" / "fs" / "cgroup"
    for line in _text(root / "proc" / "self" / "cgroup").splitlines():
        number, _, rest = line.partition(":")
        controllers, _, path = rest.partition(":")
        if number == "0" or controller in controllers.split(","):
            parts = [part for part in path.split("/") if part]
            for mount in (mounts,) if number == "0" else (mounts / controllers, mounts / controller):
                yield from (mount.joinpath(*parts[:depth]) for depth in range(len(parts), -1, -1))


def _words(path: Path) -> list[str]:
    return _text(path).split()


def _text(path: Path) -> str:
    try:
        return path.read_text(encoding="ascii", errors="replace")
    except OSError:
        return ""
