"""Paths: what a channel did to a signal can be undone, as far as a recording tells."""

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from lab.paths import Path, recorded, structural
from tests.lab.effects.reference import DT

paths = st.builds(
    Path,
    gain=st.floats(0.1, 3.0) | st.floats(-3.0, -0.1),
    delay=st.integers(0, 5).map(lambda n: n * DT),
    hum=st.lists(st.tuples(st.floats(0.1, 9.0), st.floats(-1, 1), st.floats(-1, 1)), max_size=2).map(tuple),
)


@given(st.tuples(paths, paths, paths), st.permutations(range(3)))
def test_paths_can_be_undone(three, order):
    signals = np.random.default_rng(0).standard_normal((3, 30))
    again = structural(three, order, recorded(three, order, signals, DT), DT)
    for i, path in enumerate(three):
        whole = path.parts(DT)[0]
        # What comes after the end of the record was never seen.
        assert np.all(np.isnan(again[i, 30 - whole :]))
        np.testing.assert_allclose(again[i, : 30 - whole], signals[i, : 30 - whole], rtol=0, atol=1e-12)


def test_clipped_samples_are_unknown():
    y = np.array([[0.5, 1.5, -0.2, -3.0]])
    path = (Path(limit=1.0),)
    again = structural(path, (), recorded(path, (), y, DT), DT)
    np.testing.assert_array_equal(again, [[0.5, np.nan, -0.2, np.nan]])


def test_recording_leaves_the_readings_alone():
    y = np.ones((1, 4))
    recorded((Path(gain=2.0),), (), y, DT)
    np.testing.assert_array_equal(y, np.ones((1, 4)))
