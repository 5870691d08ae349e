"""Measurements with the machine they were made on, and the files of both."""

import json
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from artiskill.bench.measure import Measurement
from artiskill.bench.plot import draw
from artiskill.errors import ConfigError
from artiskill.files import atomic_write, output_path

JSON_FILE, PLOT_FILE = "bench.json", "bench.png"


@dataclass(frozen=True)
class BenchReport:
    """What a run of `artiskill bench` found.

    Attributes:
        machine: `machine_facts` at its start.
        measurements: in the order of the cases.
    """

    machine: dict[str, Any]
    measurements: Sequence[Measurement]

    def to_mapping(self) -> dict[str, Any]:
        """Plain values, for JSON."""
        return {"machine": self.machine, "cases": [one.to_mapping() for one in self.measurements]}


def write_bench(report: BenchReport, folder: Path, plot: bool = True) -> list[Path]:
    """Write `bench.json` and, if wanted, `bench.png`.

    Raises:
        ConfigError: the folder cannot be written to.
        MissingExtraError: a plot without the extra `bench`.
    """
    paths = [output_path(folder) / JSON_FILE]
    try:
        folder.mkdir(parents=True, exist_ok=True)
        with atomic_write(paths[0]) as temporary:
            temporary.write_text(json.dumps(report.to_mapping(), indent=1) + "\n", encoding="utf-8")
        if plot:
            paths.append(folder / PLOT_FILE)
            with atomic_write(paths[1]) as temporary:
                draw(report.measurements, temporary)
    except OSError as error:
        raise ConfigError(f"cannot write to {str(folder)!r}: {error.strerror or error}") from error
    return paths
