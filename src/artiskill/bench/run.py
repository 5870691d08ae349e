"""A case in a process of its own, so that its memory is its own."""

from artiskill.bench.cases import Case
from artiskill.bench.measure import Measurement, measure_case
from artiskill.jobs.parallel import run_jobs


def measure_alone(case: Case) -> Measurement:
    """`measure_case` in a new process.

    Raises:
        ArtiSkillError: what it raised.
        PolicyError: the process ended by itself: memory ran out.
    """
    return run_jobs(measure_case, [case], workers=1, isolated=True)[0]
