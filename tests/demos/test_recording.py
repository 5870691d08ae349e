import json

import numpy as np

from artiskill.demos.recording import Columns, joined


def test_there_and_back(rng: np.random.Generator) -> None:
    arrays = {"a": rng.normal(size=(2, 3)), "none": np.zeros((0, 3)), "b": rng.normal(size=4)}
    columns = Columns.from_list(json.loads(json.dumps(Columns.of(arrays).to_list())))
    assert columns == Columns.of(arrays)
    assert columns.width == 10
    rows = np.stack([joined(arrays), joined(arrays)])
    for name, value in columns.split(rows).items():
        np.testing.assert_array_equal(value, np.stack([arrays[name]] * 2))
