"""Linear systems in the forms that identification passes around, and how one gives the other."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
import scipy.linalg
from numpy.typing import NDArray

from identification.errors import IdentificationError, OrderError
from identification.modes import Modes, oscillating
from identification.recording import Array, Channel, frozen

Complex = NDArray[np.complex128]


@dataclass(frozen=True, eq=False, repr=False)
class MarkovParameters:
    """Responses to a unit pulse held for one sample: D, CB, CAB, CA²B and so on.

    Attributes:
        values: shape (n_lags, n_outputs, n_inputs) [output unit / input unit].
        dt: sample time [s].
        inputs: input channels; for free decays one per release.
        outputs: output channels.
    """

    values: Array
    dt: float
    inputs: tuple[Channel, ...]
    outputs: tuple[Channel, ...]

    def __post_init__(self) -> None:
        object.__setattr__(self, "values", frozen(self.values))
        if self.values.ndim != 3 or self.values.shape[1:] != (len(self.outputs), len(self.inputs)):
            raise IdentificationError(
                f"Markov parameters have shape {self.values.shape}; expected (n_lags, {len(self.outputs)}, "
                f"{len(self.inputs)})"
            )
        if not np.all(np.isfinite(self.values)):
            raise IdentificationError(
                "Markov parameters are not all finite; leave the channel or the lags out"
            )

    @property
    def n_lags(self) -> int:
        """Number of Markov parameters, the direct term D included."""
        return int(self.values.shape[0])

    def __repr__(self) -> str:
        n_lags, n_outputs, n_inputs = self.values.shape
        return f"MarkovParameters({n_lags} lags, {n_outputs} outputs, {n_inputs} inputs, dt = {self.dt:g} s)"


@dataclass(frozen=True, eq=False, repr=False)
class StateSpace:
    """x' = A x + B u, y = C x + D u; sampled when dt > 0, continuous in time when dt = 0.

    Attributes:
        A: shape (n_states, n_states).
        B: shape (n_states, n_inputs); no columns for a model identified from outputs alone.
        C: shape (n_outputs, n_states).
        D: shape (n_outputs, n_inputs).
        dt: sample time [s], or 0.
        inputs: input channels.
        outputs: output channels.
    """

    A: Array
    B: Array
    C: Array
    D: Array
    dt: float
    inputs: tuple[Channel, ...]
    outputs: tuple[Channel, ...]

    def __post_init__(self) -> None:
        for name in "ABCD":
            object.__setattr__(self, name, frozen(getattr(self, name)))
        n, n_inputs, n_outputs = self.A.shape[0], len(self.inputs), len(self.outputs)
        shapes = {"A": (n, n), "B": (n, n_inputs), "C": (n_outputs, n), "D": (n_outputs, n_inputs)}
        for name, shape in shapes.items():
            if getattr(self, name).shape != shape:
                raise IdentificationError(f"{name} has shape {getattr(self, name).shape}; expected {shape}")

    @property
    def n_states(self) -> int:
        """Number of states."""
        return int(self.A.shape[0])

    def eigen(self) -> tuple[Complex, Complex]:
        """Continuous-time poles λ [rad/s], (n_states,), and eigenvectors of A, (n_states, n_states)."""
        z, vectors = np.linalg.eig(self.A)
        if self.dt == 0.0:
            return z, vectors
        with np.errstate(divide="ignore"):
            return np.log(z.astype(complex)) / self.dt, vectors

    def modes(self) -> Modes:
        """Oscillating modes, one for each conjugate pair of poles, sorted by frequency."""
        poles, vectors = self.eigen()
        own = oscillating(poles, self.dt)
        return Modes.from_poles(poles[own], self.C @ vectors[:, own], self.outputs)

    def markov(self, n_lags: int) -> MarkovParameters:
        """The first `n_lags` Markov parameters of a sampled model: D, CB, CAB and so on.

        Raises:
            IdentificationError: the model is continuous in time.
        """
        self._require_sampled("Markov parameters")
        values = np.empty((n_lags, *self.D.shape))
        values[:1] = self.D
        X = self.B
        for k in range(1, n_lags):
            values[k] = self.C @ X
            X = self.A @ X
        return MarkovParameters(values, self.dt, self.inputs, self.outputs)

    def frequency_response(self, frequency_hz: Array) -> Complex:
        """H(f) = C (s I - A)⁻¹ B + D with s = i 2π f, or z = exp(i 2π f dt) in its place when sampled.

        Returns:
            Shape (n_frequencies, n_outputs, n_inputs).
        """
        s = 2j * np.pi * np.asarray(frequency_hz)
        points = np.exp(s * self.dt) if self.dt else s
        eye = np.eye(self.n_states)
        H = [self.C @ np.linalg.solve(p * eye - self.A, self.B) + self.D for p in points]
        return np.array(H, dtype=np.complex128).reshape(len(H), *self.D.shape)

    def simulate(self, inputs: Array, initial: Array | None = None) -> Array:
        """Outputs (n_outputs, n_samples) of a sampled model under inputs (n_inputs, n_samples).

        Args:
            inputs: held over each sample.
            initial: state at the first sample; rest when None.

        Raises:
            IdentificationError: the model is continuous in time.
        """
        self._require_sampled("a simulation")
        x = np.zeros(self.n_states) if initial is None else np.asarray(initial, dtype=float)
        n_samples = inputs.shape[1]
        states = np.empty((self.n_states, n_samples))
        forcing = self.B @ inputs
        for k in range(n_samples):
            states[:, k] = x
            x = self.A @ x + forcing[:, k]
        return np.asarray(self.C @ states + self.D @ inputs)

    def sampled(self, dt: float) -> StateSpace:
        """The continuous model seen through a zero-order hold: exact for inputs held over each sample.

        Raises:
            IdentificationError: the model is sampled already.
        """
        if self.dt:
            raise IdentificationError(
                f"the model is sampled at dt = {self.dt} s already; expected a continuous one"
            )
        n, m = self.B.shape
        block = scipy.linalg.expm(np.block([[self.A, self.B], [np.zeros((m, n + m))]]) * dt)
        return replace(self, A=block[:n, :n], B=block[:n, n:], dt=dt)

    def continuous(self) -> StateSpace:
        """The continuous model whose zero-order-hold samples this is: A_c = ln(A) / dt.

        Raises:
            IdentificationError: a pole lies on the negative real axis or at zero, where the logarithm
                is not real.
        """
        if not self.dt:
            return self
        z = scipy.linalg.eigvals(self.A)
        if np.any((z.imag == 0) & (z.real <= 0)):
            raise IdentificationError(
                "a sampled pole lies on the negative real axis, so no real continuous model exists; "
                "change the order or sample faster"
            )
        n, m = self.B.shape
        block = np.block([[self.A, self.B], [np.zeros((m, n)), np.eye(m)]])
        log = np.real(scipy.linalg.logm(block)) / self.dt
        return replace(self, A=log[:n, :n], B=log[:n, n:], dt=0.0)

    def _require_sampled(self, what: str) -> None:
        if not self.dt:
            raise IdentificationError(f"{what} needs a sampled model; call sampled(dt) first")

    def __repr__(self) -> str:
        time = f"dt = {self.dt:g} s" if self.dt else "continuous"
        sides = f"{len(self.outputs)} outputs, {len(self.inputs)} inputs"
        return f"StateSpace({self.n_states} states, {sides}, {time})"


@dataclass(frozen=True, eq=False, repr=False)
class SecondOrder:
    """M q̈ + C_d q̇ + K q = f.

    Attributes:
        mass: shape (n_dofs, n_dofs) [kg, or kg m^2 on a rotation].
        damping: shape (n_dofs, n_dofs) [N s/m].
        stiffness: shape (n_dofs, n_dofs) [N/m].
        dofs: names of the degrees of freedom.
        mass_std, damping_std, stiffness_std: one standard deviation of each entry; None where none was
            estimated.
    """

    mass: Array
    damping: Array
    stiffness: Array
    dofs: tuple[str, ...]
    mass_std: Array | None = None
    damping_std: Array | None = None
    stiffness_std: Array | None = None

    def __post_init__(self) -> None:
        n = len(self.dofs)
        for name in ("mass", "damping", "stiffness", "mass_std", "damping_std", "stiffness_std"):
            value = getattr(self, name)
            if value is None:
                continue
            value = frozen(value)
            if value.shape != (n, n):
                raise IdentificationError(f"{name} has shape {value.shape}; expected ({n}, {n})")
            object.__setattr__(self, name, value)

    def state_space(
        self,
        input_matrix: Array,
        displacement: Array,
        velocity: Array,
        acceleration: Array,
        inputs: tuple[Channel, ...],
        outputs: tuple[Channel, ...],
    ) -> StateSpace:
        """Continuous model of y = C_p q + C_v q̇ + C_a q̈ under f = B u, with the state (q, q̇).

        Args:
            input_matrix: B, shape (n_dofs, n_inputs).
            displacement: C_p, shape (n_outputs, n_dofs).
            velocity: C_v, shape (n_outputs, n_dofs).
            acceleration: C_a, shape (n_outputs, n_dofs).
            inputs: input channels.
            outputs: output channels.

        Source: De Angelis et al. (2002), J. Appl. Mech. 69, eq. (1) and (7).
        """
        n = len(self.dofs)
        minus_K, minus_C, force = (
            scipy.linalg.solve(self.mass, X, assume_a="pos")
            for X in (-self.stiffness, -self.damping, np.asarray(input_matrix, dtype=float))
        )
        A = np.block([[np.zeros((n, n)), np.eye(n)], [minus_K, minus_C]])
        B = np.vstack([np.zeros_like(force), force])
        C = np.hstack([displacement + acceleration @ minus_K, velocity + acceleration @ minus_C])
        return StateSpace(A, B, C, acceleration @ force, 0.0, inputs, outputs)

    def modes(self) -> Modes:
        """Modes of displacement at every degree of freedom."""
        n = len(self.dofs)
        channels = tuple(Channel(dof, "m", dof) for dof in self.dofs)
        eye, zero = np.eye(n), np.zeros((n, n))
        return self.state_space(np.zeros((n, 0)), eye, zero, zero, (), channels).modes()

    def __repr__(self) -> str:
        return f"SecondOrder({len(self.dofs)} dofs: {', '.join(self.dofs)})"


@dataclass(frozen=True, eq=False, repr=False)
class Realization:
    """State-space models of every order up to a highest one, from one factorization of the data.

    Leading columns of an observability matrix give the model of any lower order, so one decomposition
    serves a whole stabilization diagram.

    Attributes:
        method: name of the method, as in `METHODS`.
        systems: one model per order, by rising order.
        singular_values: all of them, largest first, to judge the order by.
        order: the order that the singular values or the caller chose.
        settings: what the method was run with, by name (horizon, block rows, observer length, …).
        notes: what the method decided by itself and why, one sentence each.
    """

    method: str
    systems: tuple[StateSpace, ...]
    singular_values: Array
    order: int
    settings: dict[str, int | float | str]
    notes: tuple[str, ...] = ()

    def __post_init__(self) -> None:
        object.__setattr__(self, "singular_values", frozen(self.singular_values))
        self.at(self.order)

    @property
    def orders(self) -> tuple[int, ...]:
        """Orders for which there is a model."""
        return tuple(system.n_states for system in self.systems)

    @property
    def system(self) -> StateSpace:
        """The model of the chosen order."""
        return self.at(self.order)

    def at(self, order: int) -> StateSpace:
        """The model with `order` states.

        Raises:
            OrderError: there is none.
        """
        for system in self.systems:
            if system.n_states == order:
                return system
        raise OrderError(f"order {order} was not realized; there are {_ranges(self.orders)}")

    def __repr__(self) -> str:
        return f"Realization({self.method}, order {self.order} of {_ranges(self.orders)})"


def _ranges(orders: Sequence[int]) -> str:
    if len(orders) > 6:
        return f"{orders[0]}, {orders[1]}, … {orders[-1]}"
    return ", ".join(str(order) for order in orders) or "none"
