# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Memory of the machine and of this process, and how much of it results may take.

Only the standard library: Linux has files for it, macOS and Windows are asked through ctypes. What a system does not
tell is None, and then nothing is limited that the artist has not limited.
"""

import ctypes
import math
import os
import sys
from contextlib import suppress
from ctypes import byref, c_size_t, c_uint32, c_uint64, sizeof
from functools import lru_cache
from pathlib import Path

#: Bytes of the gigabytes that settings and panels are in.
GIGABYTE = 1e9
#: Fraction of the machine's memory that Blender may take where the artist sets no limit.
AUTOMATIC = 0.5
#: Bytes that a renderer needs for each pixel of the picture: its passes; and what its denoiser adds (Cycles with Open
#: Image Denoise at 1920 × 1080; from there on it works in tiles and takes less).
BYTES_PER_PIXEL = 90
BYTES_PER_DENOISED_PIXEL = 800
#: Bytes that results are always allowed: with none, an artist would see nothing and not know why.
LEAST = 64e6

_CGROUPS = Path("/sys/fs/cgroup")
_OWN_GROUPS = Path("/proc/self/cgroup")
_STATM = Path("/proc/self/statm")
_TASK_BASIC_INFO = 20  # MACH_TASK_BASIC_INFO of mach/task_info.h


class _Task(ctypes.Structure):
    """``struct mach_task_basic_info``."""

    _fields_ = [(name, c_uint64) for name in ("virtual_size", "resident_size", "resident_size_max")]
    _fields_ += [("other", c_uint32 * 6)]


class _Status(ctypes.Structure):
    """``MEMORYSTATUSEX``."""

    _fields_ = [("length", c_uint32), ("load", c_uint32), ("total", c_uint64), ("others", c_uint64 * 6)]


class _Counters(ctypes.Structure):
    """``PROCESS_MEMORY_COUNTERS``."""

    _fields_ = [("length", c_uint32), ("faults", c_uint32), ("peak", c_size_t), ("working_set", c_size_t)]
    _fields_ += [("others", c_size_t * 6)]


@lru_cache(maxsize=1)
def total() -> int | None:
    """Bytes of memory that this machine has, or that the container in which it runs may use; None if not known."""
    ask = {"win32": _windows_total, "darwin": _mac_total}.get(sys.platform, _unix_total)
    with suppress(OSError, ValueError, AttributeError):
        size = ask()
        return size if size > 0 else None
    return None


def resident() -> int | None:
    """Bytes of memory that this process takes now; None if not known."""
    ask = {"win32": _windows_resident, "darwin": _mac_resident}.get(sys.platform, _unix_resident)
    with suppress(OSError, ValueError, AttributeError, ImportError):
        size = ask()
        return size if size > 0 else None
    return None


def limit(max_memory: float) -> float:
    """Bytes that the whole process may take.

    Parameters
    ----------
    max_memory : float
        `RefinementSettings.max_memory`: gigabytes, or 0 for half of the machine's memory.

    Returns
    -------
    float
        Infinite where neither the artist sets a limit nor the memory of the machine is known.
    """
    if max_memory > 0.0:
        return max_memory * GIGABYTE
    machine = total()
    return math.inf if machine is None else AUTOMATIC * machine


def picture_bytes(pixels: int, denoised: bool = False) -> int:
    """Bytes that a renderer needs for a picture of so many pixels, whatever is in it."""
    return pixels * (BYTES_PER_PIXEL + (BYTES_PER_DENOISED_PIXEL if denoised else 0))


def allowance(max_memory: float, reserve: float = 0.0) -> float:
    """Bytes that are left for results, in Blender and the renderer together.

    Parameters
    ----------
    max_memory : float
        As of `limit`.
    reserve : float
        Bytes that will be needed beside results, see `picture_bytes`.

    Returns
    -------
    float
        At least `LEAST`, and infinite without a limit. Of a process whose memory is not known the whole limit is left.
    """
    return max(limit(max_memory) - (resident() or 0) - reserve, LEAST)


def give_back() -> None:
    """Return memory that is free to the system; some C libraries keep it, and renderers would be charged for it.

    Windows gives large blocks back by itself.
    """
    with suppress(OSError, ValueError, AttributeError):
        if sys.platform == "darwin":
            ctypes.CDLL(None).malloc_zone_pressure_relief(None, c_size_t(0))
        elif sys.platform != "win32":
            ctypes.CDLL(None).malloc_trim(c_size_t(0))


def _unix_total() -> int:
    return min([os.sysconf("SC_PAGE_SIZE") * os.sysconf("SC_PHYS_PAGES"), *_container_limits()])


def _container_limits() -> list[int]:
    """Limits of the control groups that this process is in, of both versions; groups within groups have several."""
    limits: list[int] = []
    try:
        groups = [line.split(":", 2) for line in _OWN_GROUPS.read_text(encoding="utf-8").splitlines()]
    except OSError:
        return limits
    for group in groups:
        if len(group) != 3 or (group[1] and "memory" not in group[1].split(",")):
            continue
        root, name = (_CGROUPS / "memory", "memory.limit_in_bytes") if group[1] else (_CGROUPS, "memory.max")
        innermost = root / group[2].lstrip("/")
        for folder in (innermost, *innermost.parents):
            with suppress(OSError, ValueError):  # a group without a limit has the word max, the topmost no file
                limits.append(int((folder / name).read_text(encoding="utf-8")))
            if folder == root:
                break
    return limits


def _unix_resident() -> int:
    try:
        return int(_STATM.read_text(encoding="ascii").split()[1]) * os.sysconf("SC_PAGE_SIZE")
    except (OSError, IndexError):
        import resource  # Windows has none

        return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss * 1024  # the most so far: rather too much


def _mac_total() -> int:
    value, length = c_uint64(), c_size_t(sizeof(c_uint64))
    failed = ctypes.CDLL(None).sysctlbyname(b"hw.memsize", byref(value), byref(length), None, c_size_t(0))
    return 0 if failed else value.value


def _mac_resident() -> int:
    system, task, count = ctypes.CDLL(None), _Task(), c_uint32(sizeof(_Task) // 4)
    port = c_uint32.in_dll(system, "mach_task_self_")
    return 0 if system.task_info(port, _TASK_BASIC_INFO, byref(task), byref(count)) else task.resident_size


def _windows_total() -> int:
    status = _Status(length=sizeof(_Status))
    return status.total if ctypes.windll.kernel32.GlobalMemoryStatusEx(byref(status)) else 0


def _windows_resident() -> int:
    kernel, counters = ctypes.windll.kernel32, _Counters(length=sizeof(_Counters))
    process = ctypes.c_void_p(-1)  # what GetCurrentProcess returns
    return counters.working_set if kernel.K32GetProcessMemoryInfo(process, byref(counters), counters.length) else 0
