"""Which shapes are drawn, and that true ones lie on estimates that agree with them."""

from dataclasses import replace

import numpy as np
import pytest

from lab.show.shapes import shape_table, shown_modes, within_reach
from tests.lab.showcase import chain_result, chain_rig

MIXED = ["pos1", "vel2", "acc3.x"]


@pytest.mark.parametrize("recovered", [True, False])
def test_truth_lies_on_the_estimate_when_both_agree(recovered):
    rig = chain_rig("chain3_coupled", outputs=MIXED)
    result = chain_result(rig, error=1e-13)
    table = shape_table(result if recovered else replace(result, second_order=None))
    assert table.labels == (rig.dofs if recovered else tuple(MIXED))
    np.testing.assert_allclose(table.truth, table.estimate, atol=1e-9)  # 1e-13 through eigenvectors


def test_modes_without_partner_have_no_truth():
    result = chain_result(chain_rig("chain3_coupled", outputs=MIXED))
    table = shape_table(replace(result, comparison=None))
    assert np.isnan(table.truth).all()


def test_true_modes_far_above_the_identified_ones_are_left_out():
    truth = chain_rig("chain3_coupled", outputs=MIXED).modes()
    assert len(within_reach(truth, truth)) == 3
    assert len(within_reach(truth, truth.take([0]))) == 1
    assert len(within_reach(truth, truth.take([]))) == 3  # nothing to go by


def test_stable_modes_are_shown_before_others():
    result = replace(chain_result(chain_rig("chain3_coupled", outputs=MIXED)), stable=(False, True, True))
    assert shown_modes(result, 2) == [1, 2]
    assert shown_modes(result, 12) == [0, 1, 2]
