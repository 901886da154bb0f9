r"""What a base is: the part of a model that a fit solves for exactly.

The stress of a base is a sum of columns with non-negative stiffnesses, for fixed other
parameters. The first columns are of the equilibrium (springs); each other column is
that of one branch, which relaxes with its own time. So a new family of models needs
one file: a subclass of `Base`, and a line in `softnn.models.bases`.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Mapping, Sequence
from typing import Any, Self

import numpy as np
from numpy.typing import NDArray

from softnn.contracts import Array, Chunk, InputError, Parameter, increments


class Base(ABC):
    """Columns of a strain history, and the few parameters that are no stiffness.

    Instances are frozen and hashable: an engine caches columns by them. Stiffnesses
    and stresses are in MPa, times in s, strains are engineering strains.
    """

    name: str
    relaxation_times: tuple[float, ...]  # s, one a branch

    # -- what it is --------------------------------------------------------------------

    @property
    @abstractmethod
    def segments(self) -> int:
        """Number of columns of the equilibrium."""

    @property
    @abstractmethod
    def reach(self) -> tuple[float, float]:
        """Lowest and highest strain that it was made for."""

    @property
    @abstractmethod
    def corners(self) -> Array:
        """Strains between which its springs are straight, or may be taken to be."""

    @property
    @abstractmethod
    def has(self) -> frozenset[str]:
        """Ids of the effects that it has already: they are no candidates for it."""

    @property
    def columns(self) -> int:
        return self.segments + len(self.relaxation_times)

    @property
    def nonlinear(self) -> tuple[Parameter, ...]:
        """The free parameters that are no stiffness; `default` is the present value."""
        return ()

    def having(self, values: Mapping[str, float]) -> Self:
        """Return the same base with other values of `nonlinear` parameters."""
        if values:
            raise InputError(f"{self.name} has no parameter {next(iter(values))!r}")
        return self

    def starts(self) -> Sequence[Self]:
        """Return the bases from which a fit starts; the best one counts."""
        return (self,)

    def remarks(self) -> tuple[str, ...]:
        """Return sentences that limit the trust in this base."""
        return ()

    def finer(self) -> Self:
        """Return the base on a finer grid of strains and times, if it has a grid."""
        return self

    @abstractmethod
    def only(self, branches: NDArray[np.integer]) -> Self:
        """Return the same base with these branches (indices) alone."""

    @abstractmethod
    def to_dict(self) -> dict[str, Any]:
        """Return its part of model.json; `softnn.models.bases` takes it back."""

    # -- what it does ------------------------------------------------------------------

    @abstractmethod
    def springs(self, strain: Array) -> Array:
        """Return the columns (n, segments) of the equilibrium for strains (n,)."""

    @abstractmethod
    def spring_stress(self, strain: Array, stiffness: Array) -> Array:
        """Return the equilibrium stress for strains of any shape."""

    @abstractmethod
    def undamped(self, strain: Array) -> Array:
        """Return the stress (n,) of a branch of unit stiffness before it relaxes."""

    @abstractmethod
    def branches(
        self, decays: tuple[Array, Array], strain: Array, state: Any = None
    ) -> tuple[Array, Any]:
        """Return unit branch stresses (n, branches) for strains (n,), and the state."""

    @abstractmethod
    def branch_stress(
        self,
        decays: tuple[Array, Array],
        strain: Array,
        stiffness: Array,
        state: tuple[Array, Array] | None = None,
    ) -> tuple[Array, tuple[Array, Array]]:
        """Return stress (n, sets) of all branches for strains (n, sets), and the state.

        Both arrays of the state have the sets as their first axis; None is rest.
        """

    # -- how it is written elsewhere ---------------------------------------------------

    @abstractmethod
    def in_c(self, stiffness: Array) -> tuple[str, dict[str, Any]]:
        """Return its family in the template `base.c`, and values for the places there.

        `stiffness` (columns,) is in MPa. The exporter adds times and stiffnesses of the
        branches. Raises `InputError` where no C is written.
        """

    # -- what all bases share ----------------------------------------------------------

    def decays(self, time_s: Array, before_s: float | None) -> tuple[Array, Array]:
        """Return decay and gain (n, branches) of each step.

        The first step counts from `before_s` [s]; times are in s.
        """
        first = time_s[0] if before_s is None else before_s
        step = increments(time_s, first)
        x = step[:, None] / np.array(self.relaxation_times)
        lost = -np.expm1(-x)
        return 1 - lost, np.where(x > 1e-9, lost / np.maximum(x, 1e-300), 1 - x / 2)

    def followed(
        self, decays: tuple[Array, Array], chunk: Chunk, state: Any = None
    ) -> tuple[Array, Any]:
        """Unit branch stresses (n, branches) for the branch strain, and the state."""
        if not chunk.branch_parts:
            given = chunk.branch_strain
            return self.branches(
                decays, chunk.strain if given is None else given, state
            )
        states = state or (None,) * len(chunk.branch_parts)
        total, out = np.zeros(1), []
        for (weight, strain), own in zip(chunk.branch_parts, states, strict=True):
            part, own = self.branches(decays, strain, own)
            total = total + weight[:, None] * part
            out.append(own)
        return total, tuple(out)

    def respond(self, chunk: Chunk, state: Any = None) -> tuple[Array, Array, Any]:
        """Return spring columns, branch columns and the state at the end of the chunk.

        Columns are stresses per unit stiffness, (n, segments) and (n, branches).
        """
        last, inner = (None, None) if state is None else state
        decays = self.decays(chunk.time_s, last)
        branch, inner = self.followed(decays, chunk, inner)
        return self.springs(chunk.strain), branch, (float(chunk.time_s[-1]), inner)
