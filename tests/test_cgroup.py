"""Quotas as the kernel's files tell them, from folders that look like `/`."""

from pathlib import Path

import pytest

from maipp.cgroup import cpu_quota, memory_limit

GIB = 1 << 30
UNLIMITED = 9223372036854771712  # version 1's word for none, in pages
V2 = {"proc/self/cgroup": "0::/a.slice/job\n"}
V1 = {"proc/self/cgroup": "4:memory:/docker/x\n3:cpu,cpuacct:/docker/x\n1:name=systemd:/\n0::/\n"}
TOP = "sys/fs/cgroup"


def system(root: Path, files: dict[str, str]) -> Path:
    for name, text in files.items():
        path = root / name
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(text, encoding="ascii")
    return root


@pytest.mark.parametrize(
    ("files", "cores", "memory"),
    [
        ({}, None, None),  # no Linux
        (V2, None, None),
        # Version 2: the tightest group on the way up counts.
        (V2 | {f"{TOP}/a.slice/job/cpu.max": "max 100000\n", f"{TOP}/a.slice/job/memory.max": "max\n"}, None, None),
        (V2 | {f"{TOP}/a.slice/job/cpu.max": "150000 100000\n"}, 1.5, None),
        (V2 | {f"{TOP}/a.slice/cpu.max": "200000 100000\n", f"{TOP}/a.slice/job/cpu.max": "max 100000"}, 2.0, None),
        (V2 | {f"{TOP}/a.slice/memory.max": f"{GIB}\n", f"{TOP}/a.slice/job/memory.max": f"{2 * GIB}\n"}, None, GIB),
        # In a container the file system begins at its own group.
        (V2 | {f"{TOP}/cpu.max": "200000 100000\n", f"{TOP}/memory.max": f"{GIB}\n"}, 2.0, GIB),
        ({"proc/self/cgroup": "0::/../outside\n", f"{TOP}/cpu.max": "300000 100000\n"}, 3.0, None),
        # Version 1, on the host and in a container.
        (
            V1
            | {f"{TOP}/cpu,cpuacct/docker/x/cpu.cfs_quota_us": "400000\n"}
            | {f"{TOP}/cpu,cpuacct/docker/x/cpu.cfs_period_us": "100000\n"}
            | {f"{TOP}/memory/docker/x/memory.limit_in_bytes": f"{GIB}\n"},
            4.0,
            GIB,
        ),
        (V1 | {f"{TOP}/cpu/cpu.cfs_quota_us": "50000", f"{TOP}/cpu/cpu.cfs_period_us": "100000"}, 0.5, None),
        (V1 | {f"{TOP}/cpu/cpu.cfs_quota_us": "-1", f"{TOP}/cpu/cpu.cfs_period_us": "100000"}, None, None),
        (V1 | {f"{TOP}/memory/memory.limit_in_bytes": str(UNLIMITED)}, None, UNLIMITED),
        # Nothing that can be read as a quota.
        (V2 | {f"{TOP}/cpu.max": "", f"{TOP}/memory.max": "much"}, None, None),
        (V2 | {f"{TOP}/cpu.max": "100000 0"}, None, None),
        ({"proc/self/cgroup": "nonsense\n\n"}, None, None),
    ],
)
def test_quotas_are_read(tmp_path, files, cores, memory):
    root = system(tmp_path, files)
    assert cpu_quota(root) == cores and memory_limit(root) == memory


def test_this_system_is_read():
    assert (cpu_quota() or 1) > 0 and (memory_limit() or 1) > 0
