import os
import time
from collections.abc import Callable

import pytest

from artiskill.errors import ArtiSkillError, PolicyError
from artiskill.evaluation.parallel import available_cores, run_jobs

Tell = Callable[[object], None]


def square(job: int, tell: Tell) -> int:
    tell(job)
    return job * job


def stumble(job: int, tell: Tell) -> int:
    tell(job)
    if job == 1:
        raise PolicyError("job 1 stumbled")
    for _ in range(200):
        time.sleep(0.05)
        tell(job)
    return job


def vanish(job: int, tell: Tell) -> int:
    os._exit(7)


@pytest.mark.parametrize("workers", [1, 2])
def test_results_keep_their_order_and_all_news_arrives(workers: int) -> None:
    news: list[object] = []
    assert run_jobs(square, [3, 1, 2], workers, news.append) == [9, 1, 4]
    assert sorted(news, key=str) == [1, 2, 3]


def test_an_error_ends_the_other_jobs() -> None:
    start = time.perf_counter()
    with pytest.raises(PolicyError, match="job 1 stumbled"):
        run_jobs(stumble, [0, 1, 2, 3], 2)
    assert time.perf_counter() - start < 8  # one job to its end takes ten seconds


def test_a_vanished_worker_is_explained() -> None:
    with pytest.raises(ArtiSkillError, match="a worker process ended by itself"):
        run_jobs(vanish, [0, 1], 2)


def test_cores() -> None:
    assert 1 <= available_cores() <= (os.cpu_count() or 1)
