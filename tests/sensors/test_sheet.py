import numpy as np

from artiskill.sensors.pictures.compose import GAP_PX, below, beside, of_width


def filled(height, width, value):
    return np.full((height, width, 3), value, dtype=np.uint8)


def test_pictures_stand_beside_and_below_each_other():
    row = beside([filled(4, 5, 10), filled(4, 7, 20)])
    assert row.shape == (4, 12 + GAP_PX, 3)
    assert (row[:, :5] == 10).all()
    assert (row[:, 5 : 5 + GAP_PX] == 255).all()
    assert (row[:, 5 + GAP_PX :] == 20).all()
    sheet = below([row, filled(3, row.shape[1], 30)])
    assert sheet.shape == (7 + GAP_PX, row.shape[1], 3)
    assert (sheet[-3:] == 30).all()


def test_width_is_fitted_in_proportion():
    picture = filled(10, 30, 7)
    assert of_width(picture, 30) is picture
    assert of_width(picture, 60).shape == (20, 60, 3)
    assert (of_width(picture, 12) == 7).all()
