"""Success on development objects, measured while a policy trains."""

from collections.abc import Sequence
from pathlib import Path

from artiskill.evaluation.evaluate import evaluate
from artiskill.evaluation.report import EpisodeResult
from artiskill.learning.run import RunInfo
from artiskill.learning.stopping import StopSignal
from artiskill.learning.train_config import TrainConfig
from artiskill.learning.trainer import Develop


def make_develop(config: TrainConfig, objects: Sequence[str], workers: int, info: RunInfo) -> Develop:
    """Return what measures a checkpoint's success on development objects.

    Args:
        config: of the run.
        objects: see `check_development`.
        workers: processes.
        info: of the run.
    """
    wanted = config.development

    def develop(weights: Path, stop: StopSignal) -> list[tuple[str, int, int]]:
        def on_episode(result: EpisodeResult) -> None:
            stop.check()

        report = evaluate(
            config.task,
            str(weights),
            list(objects),
            wanted.episodes,
            wanted.first_level,
            config=info.overrides,
            workers=workers,
            on_episode=on_episode,
        )
        return [(row.object, row.stats.episodes, row.stats.successes) for row in report.rows]

    return develop
