"""The catalogue is what its tool selects."""

from collections.abc import Callable
from types import ModuleType

import pytest

from artiskill.assets.articulated_object import CATEGORIES, Category
from artiskill.assets.catalog import CATALOG_DIR


@pytest.mark.slow
@pytest.mark.parametrize("category", CATEGORIES)
def test_the_same_catalogue_is_selected_again(category: Category, load_tool: Callable[[str], ModuleType]) -> None:
    tool = load_tool("select_objects")
    written = (CATALOG_DIR / f"{category}.yaml").read_text(encoding="utf-8")
    assert tool.catalog_yaml(category, tool.select(category)) == written
