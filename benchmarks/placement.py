"""Where sensors go: the truss and its rivals verified by virtual tests, a large structure timed, peers on the same shapes.

    python benchmarks/placement.py [--patterns 60] [--parts truss scale peers] [--figure docs/placement.svg]

truss   ranks every rival of the layout of De Angelis et al. (2002), section 5.4, and holds the bound of the best, the
        paper's and the worst layout against the scatter of maximum-likelihood estimates over noise patterns.
scale   a plate of 1000 degrees of freedom with 3000 candidate channels, 50 of which are chosen, from MJCF to placement.
peers   effective independence of SDynPy and the pivots of PySensors on the same shapes (`pip install --group peers`).
"""

from __future__ import annotations

import argparse
import importlib.util
import os
import sys
import time
from pathlib import Path

# Matrices here are small: threads would cost more than they bring.
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
# SDynPy loads Qt, which looks for a screen.
os.environ.setdefault("QT_QPA_PLATFORM", "offscreen")
sys.path.insert(0, str(Path(__file__).resolve().parent.parent))

import numpy as np

from identification.information import cramer_rao_bound, planned, predict
from identification.likelihood import refine
from identification.recording import Array, Record
from identification.structures import free_matrices
from lab.placement.criteria import CRITERIA
from lab.placement.independence import effective_independence
from lab.placement.outcome import Placement, Ranked
from lab.placement.place import place
from lab.placement.plan import Plan
from lab.placement.search import exchange, greedy
from lab.rig import Rig
from lab.scenario import load_scenario

ROOT = Path(__file__).resolve().parent.parent
NOISE_PERCENT = 1.0
PARTS = ("truss", "scale", "peers")


def truss_ranking() -> tuple[Placement, Rig, Plan]:
    """All rivals of the paper's layout, by the bound."""
    scenario = load_scenario(ROOT / "scenarios/truss_random.toml")
    rig = Rig.load(ROOT / "models/truss.xml")
    rig = rig.connected(outputs=rig.responding)
    plan = Plan(
        scenario.drive(), scenario.test.sample_rate, scenario.test.duration, noise_percent=NOISE_PERCENT
    )
    layout = (scenario.channels.outputs, scenario.channels.inputs)
    found = place(
        rig, 5, n_actuators=4, target="matrices", quantity="acceleration", plan=plan, planned=layout
    )
    return found, rig, plan


def scatter(
    row: Ranked, rig: Rig, plan: Plan, n_patterns: int, rng: np.random.Generator
) -> tuple[Array, Array]:
    """Bound and Monte Carlo scatter of every entry of M, C and K, relative to the largest of its matrix."""
    structure, unknown = rig.second_order(), free_matrices(rig.dofs)
    names = [channel.name for channel in rig.inputs]
    chosen = [names.index(name) for name in row.actuators]
    connected = rig.connected(inputs=row.actuators, outputs=row.sensors)
    signals = [u[chosen] for _, u in plan.signals(rig)]
    test = planned(signals, connected.inputs, connected.outputs, sample_rate=plan.sample_rate, kind="random")
    clean = predict(structure, test, parameterization=unknown)
    y = np.asarray(clean.records[0].outputs[:, :])
    std = np.sqrt(np.mean(y**2, axis=1)) * plan.noise_percent / 100
    bound = cramer_rao_bound(structure, clean, noise_std=std, parameterization=unknown)
    units = np.repeat(
        [np.max(np.abs(x)) for x in (structure.mass, structure.damping, structure.stiffness)],
        len(bound.names) // 3,
    )
    estimates = []
    for _ in range(n_patterns):
        noisy = Record("random", signals[0], y + std[:, None] * rng.standard_normal(y.shape))
        recording = type(clean)((noisy,), clean.inputs, clean.outputs, clean.sample_rate)
        estimates.append(refine(recording, structure, parameterization=unknown).values)
    return bound.std / units, np.std(estimates, axis=0, ddof=1) / units


def show_truss(n_patterns: int, figure: Path | None) -> None:
    """The ranking, and the bound of three layouts against what virtual tests give."""
    start = time.perf_counter()
    found, rig, plan = truss_ranking()
    seconds = time.perf_counter() - start
    print(f"truss: {found.n_layouts} layouts, {found.n_possible} can give M, C, K; ranked in {seconds:.1f} s")
    rng = np.random.default_rng(2002)
    for row in found.ranking:
        if row.name not in ("best", "planned", "worst"):
            continue
        bound, spread = scatter(row, rig, plan, n_patterns, rng)
        rms = [float(np.sqrt(np.mean(x**2))) for x in (bound, spread)]
        mean = float(np.mean(spread / bound))
        print(
            f"  {row.name:8s} rank {row.rank:4d}  bound {100 * row.figure:.4f} %  scatter {100 * rms[1]:.4f} %  "
            f"ratio {rms[1] / row.figure:.3f} (entries on average {mean:.3f})  {', '.join((*row.sensors, *row.actuators))}"
        )
    if figure is not None:
        from lab.show.figures.placement import ranking_figure

        drawing = ranking_figure(found)
        assert drawing is not None
        figure.write_text(
            drawing.svg.replace("<svg", '<svg xmlns="http://www.w3.org/2000/svg"', 1) + "\n", "utf-8"
        )


def plate(n_across: int, n_along: int) -> str:
    """A pinned plate as a net of masses and springs, with an accelerometer, a velocimeter and an encoder on each."""
    bodies, tendons, sensors = [], [], []
    for i in range(n_across):
        for j in range(n_along):
            name = f"{i}_{j}"
            bodies.append(
                f'<body name="b{name}" pos="{i} {j} 0"><joint name="w{name}" type="slide" axis="0 0 1" stiffness="5"/>'
                f'<geom size="0.1" mass="1"/><site name="s{name}"/></body>'
            )
            sensors.append(
                f'<accelerometer name="a{name}" site="s{name}"/><velocimeter name="v{name}" site="s{name}"/>'
            )
            sensors.append(f'<jointpos name="p{name}" joint="w{name}"/>')
            for k, (a, b) in enumerate(((i + 1, j), (i, j + 1))):
                if a < n_across and b < n_along:
                    ends = f'<joint joint="w{name}" coef="-1"/><joint joint="w{a}_{b}" coef="1"/>'
                    tendons.append(
                        f'<fixed name="t{name}_{k}" stiffness="{1000 + 200 * k}" damping="0.1">{ends}</fixed>'
                    )
    return (
        '<mujoco model="plate"><option gravity="0 0 0"><flag contact="disable"/></option><default><geom type="sphere"/>'
        f'<tendon springlength="0"/></default><worldbody>{"".join(bodies)}</worldbody><tendon>{"".join(tendons)}</tendon>'
        f"<sensor>{''.join(sensors)}</sensor></mujoco>"
    )


def show_scale() -> None:
    """From MJCF to 50 of 3000 channels."""
    start = time.perf_counter()
    rig = Rig.from_xml(plate(40, 25))
    assert rig.responding
    read = time.perf_counter() - start
    noise = {"m/s^2": 1e-2, "m/s": 1e-3, "m": 1e-4}
    found = place(rig, 50, n_modes=20, noise=noise)
    seconds = time.perf_counter() - start
    assert found.floor is not None
    gain = 100 * (1 - found.floor / found.figure)
    print(
        f"scale: {len(rig.dofs)} DOF, {len(rig.responding)} candidates, {len(found.sensors)} sensors, 20 modes: "
        f"{seconds:.1f} s, of which {read:.1f} s to read the model; at most {gain:.2g} % could be gained"
    )
    for row in found.ranking:
        print(f"  {row.name:24s} {row.figure:.5g}")


def show_peers() -> None:
    """The same shapes given to SDynPy, PySensors and the lab."""
    rng = np.random.default_rng(0)
    smooth = np.cumsum(rng.standard_normal((600, 12)), axis=0)
    shapes = smooth / np.linalg.norm(smooth, axis=0)
    grams, rule = np.einsum("bm,bn->bmn", shapes, shapes), CRITERIA["d"]

    def told(name: str, chosen: object, seconds: float) -> None:
        rows = np.asarray(chosen, dtype=int)
        value = float(rule.figure(rule.score(grams[rows].sum(axis=0)[None]))[0])
        print(f"  {name:36s} {len(rows):3d} sensors  figure {value:9.5g}  {seconds:6.2f} s")

    print("peers: 600 candidates, 12 modes; figure: geometric mean standard deviation of modal coordinates")
    for n in (12, 30):
        start = time.perf_counter()
        own = effective_independence(shapes[:, None], n)
        told("lab, effective independence", own, time.perf_counter() - start)
        if importlib.util.find_spec("sdynpy"):
            from sdynpy.fem.sdynpy_dof import by_effective_independence

            start = time.perf_counter()
            theirs = by_effective_independence(n, shapes)
            told("SDynPy, effective independence", theirs, time.perf_counter() - start)
            print(f"    the same sensors: {sorted(int(i) for i in theirs) == sorted(own)}")
            blocks = shapes.reshape(200, 3, 12)
            same = sorted(by_effective_independence(n, blocks)) == sorted(effective_independence(blocks, n))
            print(f"    the same triaxial sensors: {same}")
        if importlib.util.find_spec("pysensors"):
            import pysensors

            start = time.perf_counter()
            model = pysensors.SSPOR(basis=pysensors.basis.Identity(n_basis_modes=12), n_sensors=n)
            model.fit(shapes.T, quiet=True)
            told("PySensors, pivoted QR", model.get_selected_sensors(), time.perf_counter() - start)
        start = time.perf_counter()
        best = exchange(grams, greedy(grams, n, rule), rule)
        told("lab, greedy and exchange", best, time.perf_counter() - start)


def main() -> None:
    """Print the figures asked for."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--patterns", type=int, default=60)
    parser.add_argument("--parts", nargs="+", choices=PARTS, default=PARTS)
    parser.add_argument("--figure", type=Path, help="where to write the ranking as SVG")
    options = parser.parse_args()
    if "truss" in options.parts:
        show_truss(options.patterns, options.figure)
    if "scale" in options.parts:
        show_scale()
    if "peers" in options.parts:
        show_peers()


if __name__ == "__main__":
    main()
