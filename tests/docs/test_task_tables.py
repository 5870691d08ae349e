"""The tasks' pages have the tables of the code. `python tests/docs/test_task_tables.py [task ...]` prints them."""

import re
import sys
from pathlib import Path

import pytest

from artiskill.tasks.registry import make_task, task_names
from artiskill.tasks.staged_reward import STAGE_TERM, Ramp

PAGES = Path(__file__).resolve().parents[2] / "docs" / "tasks"


def page_of(task: str) -> Path:
    """`OpenCabinetDrawer` -> `docs/tasks/open_cabinet_drawer.md`."""
    return PAGES / f"{re.sub('(?<!^)(?=[A-Z])', '_', task).lower()}.md"


def field_rows(task: str) -> list[str]:
    rows, start = ["| Numbers | What | Unit | At most |", "|---|---|---|---|"], 0
    for field in make_task(task).state_fields:
        numbers = f"{start}" if field.size == 1 else f"{start}-{start + field.size - 1}"
        rows.append(f"| {numbers} | {field.name} | {field.unit} | {field.bound:g} |")
        start += field.size
    return rows


def term_rows(task: str) -> list[str]:
    made = make_task(task)
    rows = ["| Term | Weight | Measure | 0 at | 1 at | Asked in |", "|---|---|---|---|---|---|"]
    for name, ramp in made.reward_table.terms.items():
        asked = ", ".join(str(k) for k, stage in enumerate(made.reward_table.stages) if name in stage.asks)
        weight = made.reward_weights.get(name, 0)
        rows.append(f"| `{name}` | {weight:g} | {ramp.measure} | {ramp.zero:g} | {ramp.one:g} | {asked} |")
    return [*rows, f"| `{STAGE_TERM}` | {made.reward_weights[STAGE_TERM]:g} | see below | | | all |"]


def flag_rows(task: str) -> list[str]:
    """The head of a table whose second column a person writes."""
    return ["| Condition | Holds when |", "|---|---|", *(f"| `{flag}` | |" for flag in make_task(task).flag_names)]


def stage_rows(task: str) -> list[str]:
    made = make_task(task)
    rows = ["| Stage | Bonus | Entered | Leaving |", "|---|---|---|---|"]
    for k, (stage, bonus) in enumerate(zip(made.reward_table.stages, made.config.reward.stage_bonus, strict=True)):
        rows.append(f"| {k} {stage.name} | {bonus:g} | {_ramps(stage.enters)} | {_ramps(stage.leaves)} |")
    return rows


def _ramps(ramps: tuple[Ramp, ...]) -> str:
    return ", ".join(f"{r.measure} {r.zero:g} .. {r.one:g}" for r in ramps)


@pytest.mark.parametrize("task", task_names())
def test_the_page_has_the_tables_of_the_code(task: str) -> None:
    text = page_of(task).read_text(encoding="utf-8")
    for rows in (field_rows(task), term_rows(task), stage_rows(task)):
        assert "\n".join(rows) in text
    for flag in make_task(task).flag_names:
        assert f"| `{flag}` |" in text


if __name__ == "__main__":
    for name in sys.argv[1:] or task_names():
        for piece in ([f"# {name}"], flag_rows(name), field_rows(name), term_rows(name), stage_rows(name)):
            print(*piece, "", sep="\n")
