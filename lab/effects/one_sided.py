"""A spring that acts on one side of a point only: an extra tendon with a deadband on the other side."""

from __future__ import annotations

from lab.effects.edits import copy_of, numbers, with_tendon
from lab.mjcf import number
from lab.rig import Rig, Spring

FAR = 1e6
"""A length [m] that no structure reaches; the deadband ends there."""


def one_sided(rig: Rig, spring: Spring, name: str, stiffness: float, touch: float, side: int) -> Rig:
    """The rig with a spring of `stiffness` that acts where the extension of `spring` is past `touch`.

    Args:
        rig: the rig.
        spring: whose extension counts.
        name: of the new tendon.
        stiffness: [N/m].
        touch: extension at which it starts to act [m].
        side: 1 to act above `touch`, -1 to act below.
    """
    tendon = copy_of(rig, spring, name)
    at = spring.reference + touch
    tendon.set("springlength", numbers([-FAR, at] if side > 0 else [at, FAR]))
    tendon.set("stiffness", number(stiffness))
    return with_tendon(rig, tendon)
