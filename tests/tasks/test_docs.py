"""The task's page says what the code does. `python tests/tasks/test_docs.py` prints the tables anew."""

from pathlib import Path

import pytest

from artiskill.tasks.open_cabinet.reward import TERMS
from artiskill.tasks.registry import make_task

PAGE = Path(__file__).resolve().parents[2] / "docs" / "tasks" / "open_cabinet_drawer.md"


def field_rows() -> list[str]:
    rows, start = ["| Numbers | What | Unit | At most |", "|---|---|---|---|"], 0
    for field in make_task("OpenCabinetDrawer").state_fields:
        numbers = f"{start}" if field.size == 1 else f"{start}-{start + field.size - 1}"
        rows.append(f"| {numbers} | {field.name} | {field.unit} | {field.bound:g} |")
        start += field.size
    return rows


def term_rows() -> list[str]:
    config = make_task("OpenCabinetDrawer").config.reward
    rows = [
        "| Term | Weight | start | width | low | high | Asked in | Elsewhere |",
        "|---|---|---|---|---|---|---|---|",
    ]
    for number, (name, term) in enumerate(TERMS.items()):
        elsewhere = ", ".join(
            f"{config.elsewhere[stage, number]:g} in {stage}" for stage in range(4) if stage not in term.asked_in
        )
        asked = ", ".join(map(str, term.asked_in)) or "none"
        numbers = f"{term.start:g} | {term.width:g} | {term.low:g} | {term.high:g}"
        rows.append(f"| `{name}` | {config.weights[name]:g} | {numbers} | {asked} | {elsewhere} |")
    return rows


@pytest.mark.parametrize("rows", [field_rows(), term_rows()])
def test_the_page_has_the_tables_of_the_code(rows: list[str]) -> None:
    assert "\n".join(rows) in PAGE.read_text(encoding="utf-8")


if __name__ == "__main__":
    print("\n".join([*field_rows(), "", *term_rows()]))
