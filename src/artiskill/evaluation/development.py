"""Success on development objects, measured while a policy trains."""

from pathlib import Path

from artiskill.evaluation.evaluate import evaluate
from artiskill.evaluation.report import EpisodeResult
from artiskill.learning.run import RunInfo
from artiskill.learning.stopping import StopSignal
from artiskill.learning.train_config import TrainConfig, check_development
from artiskill.learning.trainer import Develop


def make_develop(config: TrainConfig, info: RunInfo, workers: int = 1) -> Develop | None:
    """Return what measures a checkpoint's success on a run's development objects; None if it has none.

    Args:
        config: of the run.
        info: of the run.
        workers: processes.

    Raises:
        UnknownNameError, AssetError: an object that does not exist, or that cannot be used.
        ConfigError: an object of a split that is measured.
    """
    objects, wanted = check_development(config), config.development
    if not objects:
        return None

    def develop(weights: Path, stop: StopSignal) -> list[tuple[str, int, int]]:
        def on_episode(result: EpisodeResult) -> None:
            stop.check()

        report = evaluate(
            config.task,
            str(weights),
            objects,
            wanted.episodes,
            wanted.first_level,
            config=info.overrides,
            workers=workers,
            on_episode=on_episode,
        )
        return [(row.object, row.stats.episodes, row.stats.successes) for row in report.rows]

    return develop
