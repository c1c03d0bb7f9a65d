"""Every table of the founding papers beside what the lab finds, and beside the bound where there is one.

python benchmarks/papers.py                    all
python benchmarks/papers.py a b c --patterns 50    some, with fewer noise patterns
"""

from __future__ import annotations

import argparse
import sys
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).resolve().parent.parent))

from identification.era import era
from identification.pulse import markov_parameters
from identification.second_order import scaled_eigenvectors, second_order
from lab.rig import Rig
from tests.papers import paper_a, paper_b, paper_c


def table(title: str, heads: list[str], rows: list[tuple[str, list[float]]], digits: int = 3) -> None:
    """Prints one table; a dash stands for what is missing."""
    print(f"\n{title}")
    print(" " * 16 + "".join(f"{head:>14}" for head in heads))
    for name, values in rows:
        cells = (f"{value:14.{digits}f}" if np.isfinite(value) else f"{'-':>14}" for value in values)
        print(f"{name:<16}" + "".join(cells))


def print_a(n_patterns: int) -> None:
    """Sections 5.1 to 5.4 of De Angelis et al. (2002)."""
    for number, damping in (("5.1", "uncoupled"), ("5.2", "coupled")):
        system = era(markov_parameters(paper_a.pulse_test(damping)), 6).system
        modes = scaled_eigenvectors(system, dofs=paper_a.DOFS)
        printed = scaled_eigenvectors(paper_a.printed_system(damping), dofs=paper_a.DOFS)
        psi, theirs = paper_a.aligned(modes.psi[:, ::2], paper_a.PSI[damping]), paper_a.PSI[damping]
        rows = [
            (f"psi{j + 1}({dof})", [psi[i, j].real, theirs[i, j].real, psi[i, j].imag, theirs[i, j].imag])
            for j in range(3)
            for i, dof in enumerate(paper_a.DOFS)
        ]
        table(f"A {number}, {damping}: eigenvectors", ["real", "paper", "imaginary", "paper"], rows)
        size = np.abs(printed.scaling[::2])
        rows = [(f"|T{j + 1}|", [size[j], abs(paper_a.SCALING[damping][j])]) for j in range(3)]
        table("  |T| from the printed state-space model", ["found", "paper"], rows)
        report_matrices(second_order(system, dofs=paper_a.DOFS), paper_a.three_masses(damping).second_order())
    monte_carlo(n_patterns)
    rig = Rig.load(paper_a.MODELS / "truss.xml")
    model = paper_a.truss_model()
    psi = paper_a.aligned(
        100 * scaled_eigenvectors(model, dofs=rig.dofs).psi[:, ::2], paper_a.TABLE_9 * (1 - 1j)
    )
    print(f"\nA 5.4, Table 9: largest difference of 100 psi {np.max(np.abs(psi.real - paper_a.TABLE_9)):.1e}")
    report_matrices(second_order(model, dofs=rig.dofs), rig.second_order())


def report_matrices(found, truth) -> None:
    """Largest errors of M, C, K relative to the largest entry."""
    for name in ("mass", "damping", "stiffness"):
        a, b = getattr(found, name), getattr(truth, name)
        print(
            f"  {name:<10} largest error {np.max(np.abs(a - b)) / np.max(np.abs(b)):.1e} of the largest entry"
        )


def monte_carlo(n_patterns: int) -> None:
    """Tables 5 to 7, with maximum likelihood and the bound beside them."""
    runs = paper_a.monte_carlo(n_patterns)
    entries = [(m, i, j) for m in range(3) for i in range(3) for j in range(i, 3)]
    where = [("MCK"[m] + f"{i + 1}{j + 1}", (m, i, j)) for m, i, j in entries if runs.truth[m, i, j]]
    bias = [100 * np.abs(np.mean(x, axis=0) - runs.truth) for x in (runs.era, runs.likelihood)]
    bias = [x / np.abs(np.where(runs.truth == 0, np.nan, runs.truth)) for x in bias]
    rows = [(name, [paper_a.TABLE_6[at], bias[0][at], bias[1][at]]) for name, at in where]
    table(
        f"A 5.3, Table 6: error of the mean over {n_patterns} patterns [%]",
        ["paper", "plain ERA", "likelihood"],
        rows,
        2,
    )
    plain, best = (runs.variation(np.std(x, axis=0, ddof=1)) for x in (runs.era, runs.likelihood))
    bound = runs.variation(runs.bound)
    rows = [
        (name, [paper_a.TABLE_7[at], plain[at], best[at], bound[at], best[at] / bound[at]])
        for name, at in where
    ]
    heads = ["paper", "plain ERA", "likelihood", "bound", "ratio"]
    table(f"A 5.3, Table 7: coefficient of variation [%], {runs.lost} patterns lost", heads, rows, 2)


def print_b(n_patterns: int) -> None:
    """Sections 6.1 and 6.2 of Juang (1992)."""
    found = paper_b.close_modes_realized().singular_values
    printed = era(
        paper_b.as_markov(paper_b.thesis_markov(paper_b.ROWS + paper_b.COLUMNS, paper_b.AS_PRINTED)),
        8,
        n_rows=paper_b.ROWS,
        n_columns=paper_b.COLUMNS,
    ).singular_values
    rows = [(str(k + 1), [paper_b.SIGMA[k], found[k], printed[k]]) for k in range(8)]
    table("B 6.1: singular values", ["paper", "found", "as misprinted"], rows)
    rows = [
        (str(k + 1), [paper_b.ROOT_SIGMA[k], found[k] ** 0.5, paper_b.INVERSE_ROOT[k], found[k] ** -0.5])
        for k in range(8)
    ]
    table("B 6.1: transformations", ["T_ib, paper", "found", "T_ob, paper", "found"], rows)
    modes = paper_b.close_modes_realized().system.modes()
    rows = [
        (
            str(k + 1),
            [
                paper_b.generate_modes4.DAMPED_FREQUENCIES[k],
                modes.frequency_hz[k] * np.sqrt(1 - modes.damping_ratio[k] ** 2),
                paper_b.AS_PRINTED[k],
                modes.damping_ratio[k],
            ],
        )
        for k in range(4)
    ]
    table(
        "B Table 2, no noise: damping as misprinted", ["f_d, paper", "found", "zeta, paper", "found"], rows, 4
    )
    runs = np.array([paper_b.noisy_modes(seed) for seed in range(n_patterns)])
    mean, std = np.mean(runs, axis=0), np.std(runs, axis=0)
    rows = [
        (
            f"{(1, 2, 4)[k]}",
            [
                paper_b.NOISY_FREQUENCY[k],
                mean[0, k],
                std[0, k],
                paper_b.NOISY_DAMPING[k],
                mean[1, k],
                std[1, k],
            ],
        )
        for k in range(3)
    ]
    heads = ["f, paper", "mean", "scatter", "zeta, paper", "mean", "scatter"]
    table(f"B Table 3, 5 % noise, {n_patterns} patterns", heads, rows, 4)
    print_truss()


def print_truss() -> None:
    """Tables 4 and 5 of Juang (1992): the lab's truss, which has that spectrum and not that structure."""
    found = {case: paper_b.found_modes(paper_b.truss_case(case)).frequency for case in paper_b.CASES}
    rows = [
        (
            f"{k + 1:>2} {paper_b.printed_frequencies()[k]:6.2f} Hz",
            [values[k] for case in paper_b.CASES for values in (paper_b.PRINTED[case], found[case])],
        )
        for k in range(20)
    ]
    heads = [head for case in paper_b.CASES for head in (f"{case}, paper", "found")]
    table("B Tables 4 and 5: frequencies [Hz] from 1.3 s (cases 1, 6) and 2.5 s (2, 7)", heads, rows, 2)


def print_c(n_patterns: int) -> None:
    """Tables 1 and 2 of Cambraia and Kurka (2010)."""
    right, wrong = paper_c.chain().modes(), paper_c.chain(2000.0, 5.0).modes()
    rows = [
        (
            str(k + 1),
            [
                paper_c.FREQUENCY[k],
                right.frequency_hz[k],
                wrong.frequency_hz[k],
                paper_c.DAMPING[k],
                right.damping_ratio[k],
                wrong.damping_ratio[k],
            ],
        )
        for k in range(7)
    ]
    heads = ["f, paper", "2500, 2.5", "2000, 5", "zeta, paper", "2500, 2.5", "2000, 5"]
    table("C Table 1: k and c as printed (2000, 5) are wrong", heads, rows, 4)
    f, zeta = paper_c.autoregressive_bound(
        right.frequency_hz, right.damping_ratio, paper_c.N_SAMPLES, paper_c.DT
    )
    runs = paper_c.scatter(n_patterns)
    size = [100 * np.sqrt(np.nanmean(x**2, axis=0)) for x in (runs.frequency, runs.damping)]
    theirs = (
        100 * np.abs(paper_c.FOUND_FREQUENCY / paper_c.FREQUENCY[:3] - 1),
        100 * np.abs(paper_c.FOUND_DAMPING / paper_c.DAMPING[:3] - 1),
    )
    rows = [
        (str(k + 1), [theirs[0][k], size[0][k], 100 * f[k], theirs[1][k], size[1][k], 100 * zeta[k]])
        for k in range(3)
    ]
    heads = ["f, paper", "RMS error", "bound", "zeta, paper", "RMS error", "bound"]
    table(f"C Table 2: errors [%] from 400 samples, {n_patterns} records", heads, rows, 2)


def main() -> None:
    """Prints the tables asked for."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0] if __doc__ else "")
    parser.add_argument("papers", nargs="*", metavar="PAPER", help="a, b or c; all when left out")
    parser.add_argument("--patterns", type=int, default=200, help="noise patterns of each Monte Carlo")
    arguments = parser.parse_args()
    printers = {"a": print_a, "b": print_b, "c": print_c}
    unknown = sorted(set(arguments.papers) - set(printers))
    if unknown:
        parser.error(f"paper {unknown[0]!r} does not exist; there are {', '.join(printers)}")
    for name in arguments.papers or printers:
        printers[name](arguments.patterns)


if __name__ == "__main__":
    main()
