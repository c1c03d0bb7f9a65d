"""Outcome: a placement, what it is worth, and how it stands among its rivals."""

from __future__ import annotations

from dataclasses import dataclass

from identification.recording import Array, frozen


@dataclass(frozen=True)
class Ranked:
    """A layout with its figure.

    Attributes:
        name: what it is: "best", "planned", "worst", or the rule that chose it.
        sensors: names of sensors or channels.
        actuators: names of input channels.
        figure: value of the criterion; smaller is better, infinite where the layout fails.
        rank: its place among all layouts, from 1; None where not all were compared.
        details: further figures, by name.
    """

    name: str
    sensors: tuple[str, ...]
    actuators: tuple[str, ...]
    figure: float
    rank: int | None
    details: dict[str, float]


@dataclass(frozen=True)
class Drive:
    """A way to drive the chosen layout.

    Attributes:
        excitation: kind of signal.
        duration: of all its records together [s].
        peak: largest force [N].
        figure: value of the criterion with it, or of the placement's `drive_measure`.
    """

    excitation: str
    duration: float
    peak: float
    figure: float


@dataclass(frozen=True)
class CauseFigure:
    """How well the chosen layout shows a cause.

    Attributes:
        cause, location: as in the catalogue.
        visibility: size of its effect, in standard deviations of noise and calibration.
        rival: cause and location that it is most easily taken for, of those that can be told apart; empty when none.
        confusion: probability of naming the rival instead.
        mistaken: probability of naming any wrong cause.
    """

    cause: str
    location: str
    visibility: float
    rival: str
    confusion: float
    mistaken: float


@dataclass(frozen=True, eq=False)
class Placement:
    """Where sensors and actuators should go.

    Attributes:
        target: "modes", "matrices" or "diagnosis".
        model: name of the model.
        criterion: name of the criterion.
        measure: what the figure is, in words.
        sensors, actuators: the layout chosen.
        figure: of that layout; smaller is better.
        proven: whether no other layout is better.
        floor: a figure that no layout can go below; None where no such bound is known.
        n_layouts: layouts that there are.
        n_possible: those of them that can give what is asked for.
        figures: of every possible layout, rising; empty where they were not all compared.
        ranking: the best, the planned and the worst layouts, and those of other rules, with their figures.
        drives: other signals and levels for the layout chosen.
        drive_measure: what their figures are, in words, where it is not `measure`; a share.
        causes: for the target "diagnosis", the causes of the catalogue.
        inseparable: groups of causes that no layout of these candidates tells apart.
        setups: sensors of each set-up where they rove, references first.
        frequency_shifts: relative change of each natural frequency by the mass of the sensors, worst set-up.
        warnings: what to know before relying on it, one sentence each.
    """

    target: str
    model: str
    criterion: str
    measure: str
    sensors: tuple[str, ...]
    actuators: tuple[str, ...]
    figure: float
    proven: bool
    floor: float | None
    n_layouts: int
    n_possible: int
    figures: Array
    ranking: tuple[Ranked, ...]
    drives: tuple[Drive, ...] = ()
    drive_measure: str = ""
    causes: tuple[CauseFigure, ...] = ()
    inseparable: tuple[tuple[str, ...], ...] = ()
    setups: tuple[tuple[str, ...], ...] = ()
    frequency_shifts: tuple[float, ...] = ()
    warnings: tuple[str, ...] = ()

    def __post_init__(self) -> None:
        object.__setattr__(self, "figures", frozen(self.figures))

    def __repr__(self) -> str:
        state = "proven best" if self.proven else "best found"
        return (
            f"Placement({self.target}, {len(self.sensors)} sensors, {len(self.actuators)} actuators, {state})"
        )
