"""One attempt at a demonstration, and blocks of them as workers make them."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from artiskill.assets.articulated_object import ArticulatedObject
from artiskill.assets.catalog import load_object, object_id_of
from artiskill.demos.demonstrator import Demonstrator
from artiskill.demos.recording import Recording, record
from artiskill.demos.settings import Settings
from artiskill.envs.manipulation import ManipulationEnv
from artiskill.errors import ArtiSkillError, DivergedError, PolicyError

# what becomes of single episodes; anything else is a fault of the program, and ends the collection
FAULTS = (DivergedError, ArithmeticError, np.linalg.LinAlgError)


def fault_text(error: BaseException) -> str:
    """What ended an episode, as reports and tables of attempts have it; it begins with the kind."""
    return f"{type(error).__name__}: {error}"


def fault_kind(text: str) -> str:
    """`DivergedError`, say; empty where nothing did."""
    return text.partition(":")[0]


@dataclass(frozen=True, eq=False)
class Attempt:
    """What came of one episode.

    Attributes:
        object: id.
        target: link.
        level: of the episode.
        success: whether it was solved.
        steps: how many it took.
        fault: what ended it, where that was not the episode's end: a text; else empty.
        recording: None of a failed one, unless failures are kept.
    """

    object: str
    target: str
    level: int
    success: bool
    steps: int
    fault: str
    recording: Recording | None


@dataclass(frozen=True, eq=False)
class Block:
    """Levels that one worker plays at a stretch.

    Attributes:
        settings: of the collection.
        object: an id, or the object itself where no id leads to it.
        target: link.
        levels: of the episodes.
    """

    settings: Settings
    object: str | ArticulatedObject
    target: str
    levels: tuple[int, ...]

    @property
    def label(self) -> str:
        """As errors call it."""
        return f"object {object_id_of(self.object)}, target {self.target}, levels from {self.levels[0]}"


def run_block(block: Block, tell: Callable[[Attempt], None]) -> None:
    """Make the attempts of a block, and tell each."""
    obj = load_object(block.object) if isinstance(block.object, str) else block.object
    env = block.settings.make_env([obj])
    player = Demonstrator(env, block.settings.variety, block.settings.store.action_bits)
    for level in block.levels:
        tell(make_attempt(env, obj, player, block, level))


def make_attempt(
    env: ManipulationEnv, obj: ArticulatedObject, player: Demonstrator, block: Block, level: int
) -> Attempt:
    """Play one level.

    Raises:
        PolicyError: what cannot be an episode's fault; it names the episode.
    """
    settings, name = block.settings, obj.id
    episode = f"object {name}, target {block.target}, level {level}"
    try:
        recording = record(env, obj, level, block.target, player, settings.store)
    except FAULTS as error:
        return Attempt(name, block.target, level, False, 0, fault_text(error), None)
    except ArtiSkillError as error:
        raise PolicyError(f"{episode}: {error}") from error
    except Exception as error:
        error.add_note(episode)
        raise
    kept = recording if recording.success or settings.keep_failures else None
    return Attempt(name, block.target, level, recording.success, len(recording.actions), "", kept)
