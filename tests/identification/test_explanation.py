"""The paragraph that explains a result."""

from identification.explanation import PHRASES, explanation
from identification.identify import identify
from identification.stability import RULES
from tests.ambient import ambient
from tests.systems import paper_chain3, pulse_recording, with_noise


def test_every_rule_that_rejects_a_pole_has_a_phrase():
    assert PHRASES.keys() == RULES.keys()


def test_it_tells_method_order_horizon_and_the_fate_of_every_pole():
    found = identify(ambient(20_000, 3), uncertainty=False)
    text = found.explanation
    assert "\n" not in text
    assert text.startswith("The method is ssi_cov, since forces act that were not measured.")
    assert "block rows" in text
    labels = found.stabilization.label
    assert (
        f"Of {len(labels)} poles of all orders, {labels.count('stable')} stay put and make up 7 modes" in text
    )
    for rule in set(labels) - {"stable"}:
        assert f"{labels.count(rule)} for {PHRASES[rule]}" in text
    assert text.count("Mass, damping and stiffness are left out") == 1


def test_modes_that_did_not_settle_are_counted_and_nothing_is_said_twice():
    recording = with_noise(pulse_recording(paper_chain3(), 200), 0.05, 7)
    found = identify(recording, order=10, orders=range(2, 15, 2), uncertainty=False)
    loose = len(found.stable) - sum(found.stable)
    assert loose > 0
    assert f"{loose} mode{'s' if loose > 1 else ''} did not stay put" in found.explanation
    assert explanation(("A.", "A."), None, (True,), ("A.", "B.")) == "A. B."
