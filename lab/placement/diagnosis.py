"""Target "diagnosis": the sensors with which the causes of the catalogue are hardest to mistake for one another."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from itertools import combinations

import numpy as np

from identification.recording import Array
from lab.errors import LabError
from lab.placement.candidates import Candidates, require_number
from lab.placement.confusion import confusion, lengths_and_cosines, without
from lab.placement.modes import choose_actuators
from lab.placement.outcome import CauseFigure, Drive, Placement, Ranked
from lab.placement.plan import Plan, alternatives, driving_level, peak, total_duration
from lab.placement.search import count
from lab.placement.suspects import Suspects, suspects
from lab.rig import Rig

LIMIT = 200
"""Layouts up to this number are all compared, which proves the best."""
PARALLEL = 1e-4
"""Two effects at a smaller angle, squared, cannot be told apart in any test of reasonable length."""
OFF = 5.0
"""A parameter that is a cause is off by so many of its tolerances: within one, it is calibration and no cause."""
LEVELS = (0.1, 1.0, 10.0)
"""Forces compared, as shares of the planned ones."""
MEASURE = "mean over all causes of the probability of naming the likeliest wrong one"


@dataclass(frozen=True, eq=False)
class Arena:
    """Causes, and how well each layout tells them apart.

    Attributes:
        suspects: effects of the causes.
        sizes: of each effect, as a multiple of the probe.
        products: of slopes and effects at each output, over its noise; (n_outputs, n, n), slopes first.
        keys: the causes, each once.
        of_key: number of the cause of each effect.
        alike: whether two causes cannot be told apart, shape (n_keys, n_keys).
    """

    suspects: Suspects
    sizes: Array
    products: Array
    keys: tuple[tuple[str, str], ...]
    of_key: np.ndarray
    alike: np.ndarray

    @classmethod
    def of(cls, found: Suspects, noise_std: Array, sizes: Array) -> Arena:
        """The arena of causes with effects of these sizes."""
        products = _products(found, noise_std, sizes)
        keys = tuple(dict.fromkeys(found.keys))
        of_key = np.array([keys.index(key) for key in found.keys])
        arena = cls(found, sizes, products, keys, of_key, np.eye(len(keys), dtype=bool))
        return replace(arena, alike=arena._alike())

    def compared(self, channels: Sequence[int]) -> tuple[Array, Array, np.ndarray]:
        """Lengths and cosines of all effects, and which of them are suspects, where these outputs are connected."""
        total = self.products[list(channels)].sum(axis=0)
        length, cosine = lengths_and_cosines(
            without(total, len(self.suspects.slopes), self.suspects.precision)
        )
        here = np.array([set(needs) <= set(channels) for needs in self.suspects.needs])
        return length, cosine, here

    def confusions(self, channels: Sequence[int]) -> tuple[Array, Array, np.ndarray]:
        """For every cause: length of its least visible effect, its likeliest confusion, and the rival, -1 for none.

        Causes in channels that are not connected have the confusion nan.
        """
        length, cosine, here = self.compared(channels)
        P = confusion(length[:, None], cosine)
        P[:, ~here] = 0.0
        P[self.alike[np.ix_(self.of_key, self.of_key)]] = 0.0
        rival, worst = np.argmax(P, axis=1), np.max(P, axis=1)
        n = len(self.keys)
        visible, confused, whose = np.full(n, np.nan), np.full(n, np.nan), np.full(n, -1)
        for i in np.flatnonzero(here):
            k = self.of_key[i]
            if not confused[k] >= worst[i]:
                confused[k], whose[k] = worst[i], self.of_key[rival[i]] if worst[i] > 0 else -1
            visible[k] = np.nanmin([visible[k], length[i]])
        return visible, confused, whose

    def figure(self, channels: Sequence[int]) -> float:
        """Mean over the causes of the likeliest confusion."""
        return float(np.nanmean(self.confusions(channels)[1]))

    def _alike(self) -> np.ndarray:
        """Causes whose effects are parallel at all outputs together; alike to one is alike to all that it is alike to."""
        first = len(self.suspects.slopes)
        cosine = lengths_and_cosines(self.products.sum(axis=0)[first:, first:])[1]
        n = len(self.keys)
        alike = np.eye(n, dtype=bool)
        for i, j in np.argwhere(1 - cosine**2 < PARALLEL):
            alike[self.of_key[i], self.of_key[j]] = alike[self.of_key[j], self.of_key[i]] = True
        while True:
            wider = (alike.astype(int) @ alike.astype(int)) > 0
            if np.array_equal(wider, alike):
                return alike
            alike = wider


def place_diagnosis(
    rig: Rig,
    sensors: Candidates,
    actuators: Candidates,
    n_sensors: int,
    n_actuators: int,
    plan: Plan,
    *,
    size: float = 0.01,
    causes: Sequence[str] = (),
    planned: tuple[Sequence[int], Sequence[int]] | None = None,
    limit: int = LIMIT,
) -> Placement:
    """The sensors with which causes are hardest to mistake for one another.

    Args:
        rig: with every candidate channel connected.
        sensors, actuators: candidates.
        n_sensors, n_actuators: how many to choose; the actuators are those that drive all modes best.
        plan: the test.
        size: of the effects: RMS change of the outputs, as a share of their RMS, over all candidates.
        causes: names of the causes to tell apart; the whole catalogue when empty.
        planned: sensors and actuators of a layout to be ranked too, with its own actuators.
        limit: number of layouts up to which all are compared.

    Raises:
        LabError: impossible numbers, or more effects than fit into memory.
    """
    require_number("sensor", n_sensors, sensors)
    if not (np.isfinite(size) and size > 0):
        raise LabError(f"size is {size}; expected a positive share of the response, such as 0.01")
    inputs = choose_actuators(rig, actuators, n_actuators)
    driven = rig.connected(inputs=[rig.inputs[i].name for i in actuators.channels_of(inputs)])
    arena, std = _arena(driven, plan, size, causes)
    n_layouts = count(len(sensors), n_sensors, n_fixed=len(sensors.fixed))
    proven = n_layouts <= limit
    chosen, figures = (
        _all(arena, sensors, n_sensors) if proven else (_searched(arena, sensors, n_sensors), {})
    )
    named = actuators.named(inputs)
    best = arena.figure(sensors.channels_of(chosen))
    values = np.sort(np.array(list(figures.values())))
    ranking = [Ranked("best", sensors.named(chosen), named, best, 1 if proven else None, {})]
    if planned is not None:
        same = tuple(planned[1]) == tuple(inputs)
        other = arena
        if not same:
            names = [rig.inputs[i].name for i in actuators.channels_of(planned[1])]
            other = _arena(rig.connected(inputs=names), plan, size, causes)[0]
        value = other.figure(sensors.channels_of(planned[0]))
        rank = int(np.sum(values < value * (1 - 1e-9))) + 1 if same and proven else None
        ranking.append(
            Ranked("planned", sensors.named(planned[0]), actuators.named(planned[1]), value, rank, {})
        )
    if len(figures) > 1:
        last = max(figures, key=lambda choice: figures[choice])
        ranking.append(Ranked("worst", sensors.named(last), named, figures[last], len(figures), {}))
    everything = arena.figure(sensors.channels_of(range(len(sensors))))
    ranking.append(Ranked("all candidates", sensors.names, named, everything, None, {}))
    return Placement(
        "diagnosis",
        rig.name,
        "confusion",
        MEASURE,
        sensors.named(chosen),
        named,
        best,
        proven,
        best if proven else None,
        n_layouts,
        n_layouts,
        values,
        tuple(ranking),
        drives=tuple(_drives(driven, plan, arena, std, sensors.channels_of(chosen))),
        causes=tuple(_told(arena, sensors.channels_of(chosen))),
        inseparable=tuple(_groups(arena)),
        warnings=tuple(_warnings(rig, plan, actuators, n_actuators, size, proven)),
    )


def _arena(rig: Rig, plan: Plan, size: float, causes: Sequence[str]) -> tuple[Arena, Array]:
    """The causes at the size asked for, and the noise of every output."""
    found = suspects(rig, plan, causes=causes)
    power = np.mean(found.outputs**2, axis=1)
    std = plan.noise_std(rig.outputs, np.sqrt(power)[None])[0]
    felt = power > 0
    change = np.mean(found.effects[:, felt] ** 2, axis=2) / power[felt]
    sizes = size / np.sqrt(np.mean(change, axis=1))
    # Channels are swapped or not: that has no size.
    for i, probe in enumerate(found.probes):
        if isinstance(probe, int):
            sizes[i] = OFF
        elif not probe.n:
            sizes[i] = 1.0
    return Arena.of(found, std, sizes), std


def _products(found: Suspects, noise_std: Array, sizes: Array) -> Array:
    columns = np.concatenate([found.slopes, found.effects * sizes[:, None, None]])
    return np.stack([x @ x.T / s**2 for x, s in zip(columns.transpose(1, 0, 2), noise_std, strict=True)])


def _all(arena: Arena, sensors: Candidates, n: int) -> tuple[tuple[int, ...], dict[tuple[int, ...], float]]:
    """The best of all layouts, and the figure of each."""
    free = [i for i in range(len(sensors)) if i not in sensors.fixed]
    figures = {}
    for rest in combinations(free, n - len(sensors.fixed)):
        choice = tuple(sorted((*sensors.fixed, *rest)))
        figures[choice] = arena.figure(sensors.channels_of(choice))
    return min(figures, key=lambda choice: figures[choice]), figures


def _searched(arena: Arena, sensors: Candidates, n: int) -> tuple[int, ...]:
    """Sensors left when those that help least are taken away one by one, then exchanged while that helps."""
    chosen = list(range(len(sensors)))

    def value(choice: Sequence[int]) -> float:
        return arena.figure(sensors.channels_of(choice))

    while len(chosen) > n:
        loose = [i for i in chosen if i not in sensors.fixed]
        least = min(loose, key=lambda i: value([j for j in chosen if j != i]))
        chosen.remove(least)
    best, improved = value(chosen), True
    while improved:
        improved = False
        for old in [i for i in chosen if i not in sensors.fixed]:
            rest = [i for i in range(len(sensors)) if i not in chosen]
            trials = {new: value(sorted({*chosen, new} - {old})) for new in rest}
            new = min(trials, key=lambda i: trials[i]) if trials else old
            if trials and trials[new] < best * (1 - 1e-9):
                chosen, best, improved = sorted({*chosen, new} - {old}), trials[new], True
    return tuple(chosen)


def _told(arena: Arena, channels: Sequence[int]) -> Iterator[CauseFigure]:
    """Every cause with its likeliest confusion, worst first."""
    visible, confused, rival = arena.confusions(channels)
    for k in np.argsort(-np.nan_to_num(confused, nan=-1.0), kind="stable"):
        if np.isfinite(confused[k]):
            taken = " at ".join(arena.keys[rival[k]]) if rival[k] >= 0 else ""
            cause, location = arena.keys[k]
            yield CauseFigure(cause, location, float(visible[k]), taken, float(confused[k]))


def _groups(arena: Arena) -> Iterator[tuple[str, ...]]:
    """Causes that are alike in all outputs of all candidates, two or more at a time."""
    seen: set[int] = set()
    for k, row in enumerate(arena.alike):
        members = [int(i) for i in np.flatnonzero(row)]
        if len(members) > 1 and k not in seen:
            seen |= set(members)
            yield tuple(" at ".join(arena.keys[i]) for i in members)


def _drives(rig: Rig, plan: Plan, arena: Arena, std: Array, channels: Sequence[int]) -> Iterator[Drive]:
    """Other signals, and other levels of the planned one; causes of the same physical size, noise as planned."""

    def drive(name: str, other: Plan) -> Drive:
        found = suspects(rig, other, like=arena.suspects)
        products = _products(found, std, arena.sizes)
        value = replace(arena, suspects=found, products=products).figure(channels)
        signals = other.signals(rig)
        return Drive(name, total_duration(signals, other.sample_rate), peak(signals), value)

    for kind, other in alternatives(rig, plan, rig.second_order().modes().frequency_hz):
        yield drive(kind, other)
    for level in LEVELS:
        other = plan.driven(driving_level(plan.excitation, level))
        yield drive(f"{plan.excitation.kind} as planned, times {level:g}", other)


def _warnings(
    rig: Rig, plan: Plan, actuators: Candidates, n_actuators: int, size: float, proven: bool
) -> Iterator[str]:
    yield (
        f"a cause is taken to change the outputs by {100 * size:g} % of their RMS over all candidates, and the noise is "
        + (f"{plan.noise_percent:g} % of the RMS of each output" if not plan.noise else "as given")
        + f"; masses, stiffnesses and dampings are {OFF:g} tolerances off; other sizes and noises may favour other places"
    )
    if n_actuators < len(actuators):
        yield "the actuators are those that drive the faintest mode most, whatever the causes"
    if not proven:
        yield "the best layout found is not proven: sensors were taken away one by one, then exchanged"
    if not rig.linear:
        yield "the model is not linear: effects are those about its planned motion"
