"""The chain as data: kept to the last digit, and refused where its stages cannot act."""

import json
import math

import pytest

from lab.chain import PLACES, Chain
from lab.errors import RigError, UnknownNameError
from lab.stages import ALL, Delay, Dropout, Gain, Hum, Lag, LowPass, Noise, Resolution, Saturation

WHOLE = Chain(
    inputs=("u",),
    outputs=("b", "a"),
    swaps=(("a", "b"),),
    actuators=(Lag("u", math.pi), Delay("u", 1 / 3)),
    disturbances=(Hum("x", 50.0, 0.1),),
    sensors=(LowPass(ALL, 2 / 3, 6), Gain("a", -2.0), Saturation("b", 5.0)),
    force_sensors=(Noise("u", std=1e-3), Resolution("u", 0.1)),
    force_measured=True,
    acquisition=(Noise("a", density=math.e), Dropout(ALL, 1e-3)),
)


@pytest.mark.parametrize("chain", [Chain(), WHOLE, Chain(outputs=()), Chain(inputs=("u",))])
def test_chain_survives_json_to_the_last_digit(chain):
    data = json.loads(json.dumps(chain.to_data()))
    assert Chain.from_data(data) == chain


def test_whole_chain_uses_every_field():
    assert all(getattr(WHOLE, place) for place in PLACES)


def test_ideal_chain_is_empty_data():
    assert Chain().to_data() == {}
    assert repr(Chain()) == "Chain(ideal)"


def test_stages_meet_their_channels():
    assert [s.name for s in WHOLE.for_channel("sensors", "a")] == ["low_pass", "gain"]
    assert [s.name for s in WHOLE.for_channel("sensors", "b")] == ["low_pass", "saturation"]
    assert Chain().adding("sensors", Gain("a", 1.0)).adding("sensors", Gain("a", 2.0)).sensors == (
        Gain("a", 1.0),
        Gain("a", 2.0),
    )


@pytest.mark.parametrize(
    ("data", "message"),
    [
        ({"sensor": []}, r"unknown key 'sensor'; expected inputs, outputs"),
        ({"sensors": [{"stage": "blur", "channel": "a"}]}, r"'blur' is unknown; expected one of gain, sat"),
        ({"sensors": [{"channel": "a"}]}, r"stage None is unknown"),
        (
            {"sensors": [{"stage": "gain", "channel": "a", "gain": 2}]},
            r"'gain' was given .*; expected channel, rel",
        ),
        (
            {"sensors": [{"stage": "gain", "channel": "a", "relative_change": "2"}]},
            r"'2'; expected a finite number",
        ),
        (["gain"], r"expected a table"),
    ],
)
def test_data_that_is_no_chain(data, message):
    with pytest.raises(RigError, match=message):
        Chain.from_data(data)


def test_names_are_checked():
    names = (["u", "v"], ["a", "b"], ["x"])
    WHOLE.check(*names)
    for chain, wrong in (
        (Chain(inputs=("w",)), "input channel 'w'.*there are u, v"),
        (Chain(outputs=("c",)), "output channel 'c'.*there are a, b"),
        (Chain(swaps=(("a", "c"),)), "output channel 'c'"),
        (Chain(actuators=(Gain("a", 1.0),)), "input channel 'a'"),
        (Chain(disturbances=(Hum("u", 1.0, 1.0),)), "degree of freedom 'u'.*there are x"),
        (Chain(acquisition=(Noise("u", std=1.0),)), "output channel 'u'"),
    ):
        with pytest.raises(UnknownNameError, match=wrong):
            chain.check(*names)


def test_stages_in_places_where_they_cannot_act():
    names = (["u"], ["a"], ["x"])
    for place in ("acquisition", "force_sensors", "disturbances"):
        with pytest.raises(RigError, match="'lag' cannot act on samples"):
            Chain().adding(place, Lag(ALL, 1.0)).check(*names)
    for place in ("actuators", "sensors"):
        for stage in (Noise(ALL, std=1.0), Dropout(ALL, 0.1)):
            with pytest.raises(RigError, match=f"'{stage.name}' acts on samples only"):
                Chain().adding(place, stage).check(*names)


def test_both_swapped_channels_must_be_connected():
    chain = Chain(outputs=("a",), swaps=(("a", "b"),))
    with pytest.raises(RigError, match="'b' is not connected"):
        chain.check([], ["a", "b"], [])
