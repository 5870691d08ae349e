"""What figures depend on besides the program: processor, memory, versions, and what else was going on."""

import os
import platform
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

from artiskill.jobs.parallel import available_cores
from artiskill.versions import versions

_CPU_FILE, _MEMORY_FILE, _STATUS_FILE = Path("/proc/cpuinfo"), Path("/proc/meminfo"), Path("/proc/self/status")
_MB_PER_KB = 1024 / 1e6


def machine_facts() -> dict[str, Any]:
    """What to write beside figures; what cannot be known is None."""
    load = os.getloadavg()[0] if hasattr(os, "getloadavg") else None
    return {
        "time": datetime.now(UTC).isoformat(timespec="seconds"),
        "processor": _entry(_CPU_FILE, "model name") or platform.processor() or None,
        "cores": available_cores(),
        "memory_mb": _megabytes(_MEMORY_FILE, "MemTotal"),
        "load": load,
        "system": platform.platform(),
        "versions": versions(),
    }


def resident_mb() -> float | None:
    """Memory that this process has in use (MB, 10^6 bytes); None where the system does not say."""
    return _megabytes(_STATUS_FILE, "VmRSS")


def _megabytes(path: Path, key: str) -> float | None:
    entry = _entry(path, key)
    return None if entry is None else int(entry.split()[0]) * _MB_PER_KB


def _entry(path: Path, key: str) -> str | None:
    """The value of the first line `key: value` of one of Linux's files."""
    try:
        lines = path.read_text(encoding="utf-8").splitlines()
    except OSError:  # another system
        return None
    return next((line.split(":", 1)[1].strip() for line in lines if line.startswith(key)), None)
