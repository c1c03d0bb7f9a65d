"""Networks of springs and dashpots between masses: the structure known, the numbers not."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from identification.errors import NotSecondOrderError
from identification.recording import Array
from identification.structures import LinearStructure, in_three_parts

WORLD = "world"
"""The ground that a spring or dashpot may hold on to."""

Element = tuple[str, str] | Mapping[str, float]
"""What a spring or dashpot spans: two DOF (or one and `WORLD`), or the row that gives its extension."""


def spring_network(
    dofs: Sequence[str],
    springs: Sequence[Element],
    *,
    dashpots: Sequence[Element] | None = None,
    masses: Mapping[str, float] | None = None,
) -> LinearStructure:
    """One mass on each degree of freedom, springs and dashpots between named places.

    Args:
        dofs: names of the degrees of freedom.
        springs: a pair of DOF, a DOF and "world", or a mapping from DOF to the extension per unit of its motion,
            as for a bar in the plane.
        dashpots: likewise; one beside each spring when None.
        masses: the known mass on each degree of freedom [kg]; parameters when None.

    Returns:
        The parameters m(dof), c(element) and k(element), in this order.

    Raises:
        NotSecondOrderError: an element holds on to something that is not among `dofs`.
    """
    n = len(dofs)
    if masses is not None and set(masses) != set(dofs):
        raise NotSecondOrderError(
            f"masses are given for {', '.join(masses) or 'none'}; expected one for each of {', '.join(dofs)}"
        )
    M = np.zeros((n, n)) if masses is None else np.diag([masses[dof] for dof in dofs])
    free = list(dofs) if masses is None else []
    parts = (
        np.array([np.outer(row, row) for row in np.eye(n)[: len(free)]]).reshape(-1, n, n),
        np.array([_pattern(e, dofs) for e in (springs if dashpots is None else dashpots)]).reshape(-1, n, n),
        np.array([_pattern(e, dofs) for e in springs]).reshape(-1, n, n),
    )
    names = (
        *(f"m({dof})" for dof in free),
        *(f"c({_label(e)})" for e in (springs if dashpots is None else dashpots)),
        *(f"k({_label(e)})" for e in springs),
    )
    return in_three_parts(names, dofs, parts, M)


def _pattern(element: Element, dofs: Sequence[str]) -> Array:
    """The matrix g gᵀ of a unit element, where g q is its extension."""
    extension = element if isinstance(element, Mapping) else {element[0]: -1.0, element[1]: 1.0}
    g = np.zeros(len(dofs))
    for dof, coefficient in extension.items():
        if dof not in (*dofs, WORLD):
            raise NotSecondOrderError(
                f"an element holds on to {dof!r}; expected {WORLD} or one of {', '.join(dofs)}"
            )
        if dof != WORLD:
            g[dofs.index(dof)] = coefficient
    return np.outer(g, g)


def _label(element: Element) -> str:
    return "|".join(element)
