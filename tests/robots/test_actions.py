import numpy as np
import pytest

from artiskill.errors import ActionError
from artiskill.robots.actions import action_scale, check_action, check_actions
from artiskill.robots.config import load_robot


@pytest.fixture(scope="module")
def scale():
    return action_scale(load_robot("one_arm"))


def test_full_actions_mean_what_the_specification_says(scale):
    full = [0.5, 0.5, 3.14, 0.5, *[3.14] * 7, 0.04, 0.04]
    assert scale.to_targets(np.ones(13)) == pytest.approx(full)
    assert scale.to_targets(-np.ones(13)) == pytest.approx([*(-x for x in full[:11]), 0, 0])
    assert scale.to_targets(np.zeros(13)) == pytest.approx([*[0] * 11, 0.02, 0.02])


def test_actions_beyond_one_are_clipped(scale):
    assert np.array_equal(scale.to_targets(np.full(13, 7.0)), scale.to_targets(np.ones(13)))
    assert np.array_equal(scale.to_targets(np.full(13, -7.0)), scale.to_targets(-np.ones(13)))


def test_targets_and_actions_are_each_others_inverse(scale, rng):
    actions = rng.uniform(-1, 1, (4, 5, 13))
    assert scale.to_actions(scale.to_targets(actions)) == pytest.approx(actions, abs=1e-12)


def test_targets_out_of_reach_become_the_nearest_action(scale):
    targets = scale.to_targets(np.zeros(13))
    targets[0], targets[11] = 9.0, -0.5
    actions = scale.to_actions(targets)
    assert actions[0] == 1.0
    assert actions[11] == -1.0
    assert np.all(actions[[*range(1, 11), 12]] == 0)


@pytest.mark.parametrize(
    ("given", "says"),
    [
        (np.zeros(3) + 1j, r"an action is 3 real numbers, not complex ones"),
        ([0, 1j, 0], "not complex ones"),
        (np.array([0, 1j, 0], dtype=object), "an action is 3 real numbers, not"),
        ([[0, 0], 0, 0], "an action is 3 real numbers, not"),
        ("abc", "an action is 3 real numbers, not 'abc'"),
    ],
)
def test_what_is_no_real_numbers_is_refused(given, says):
    with pytest.raises(ActionError, match=says):
        check_action(given, 3)
    with pytest.raises(ActionError, match="real numbers of shape"):
        check_actions(given, 1, 3)
