"""A network for rates never seen, chosen without them.

Members are convex networks fitted in several ways (`softnn.neural.convex`) and the
piecewise-linear models, each of which is such a network too. They are weighed by what
they say of rates that are left out of the training recordings one by one (stacking:
Breiman 1996, doi:10.1007/BF00117832): nothing that judges the result is used.

Where the training recordings have one rate, nothing in them tells a branch from a
spring but their holds, and no rate can be left out. The members that take branches from
holds then count alike.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from scipy.optimize import nnls

from softnn import prepare
from softnn.contracts import Array, InputError
from softnn.crossval import Folds, make_folds, score
from softnn.models.fit_piecewise import PiecewiseFit, fit_jointly
from softnn.neural import Samples, Seen, StoredNetwork, convex
from softnn.neural.convex import ConvexNetwork
from softnn.recording import Recording
from softnn.study.baselines import (
    JOINT_BRANCHES,
    MODELS,
    cyclic_fits,
    training_fits,
)
from softnn.study.material_data import Data, whole

ARCHITECTURE = "CONVEX"
NAME = "convex network"
SAMPLES = 120  # of a hold, at most
MOST = 5  # rates or recordings left out, one group each
ONE = 1e3  # weight of the condition that weights sum to 1
LEAST = 1e-3  # a smaller weight is rounding


@dataclass(frozen=True)
class Held:
    """The mixed network, the weight of each member, and the folds that give them."""

    network: ConvexNetwork
    weights: dict[str, float]
    chosen_by: str

    def stored(self, tensile: Sequence[Recording]) -> StoredNetwork:
        """The network as it is kept, with the ranges it has seen."""
        return stored(self.network, tensile)


def stored(network: ConvexNetwork, tensile: Sequence[Recording]) -> StoredNetwork:
    """A convex network fitted to recordings, as it is kept."""
    return StoredNetwork(network, ARCHITECTURE, None, Seen.of(tensile))


def held(
    tensile: Sequence[Recording],
    holds: Sequence[Recording] = (),
    cycles: bool = False,
) -> Held:
    """The network of these recordings, for rates that are not among them.

    Raises `InputError` where nothing can be fitted.
    """
    found = members(tensile, holds, cycles)
    weights, chosen_by = weighed(found, tensile, holds, cycles)
    return Held(convex.mixed(found, weights, tensile), weights, chosen_by)


def members(
    tensile: Sequence[Recording], holds: Sequence[Recording], cycles: bool
) -> dict[str, ConvexNetwork]:
    """Every member, fitted to recordings and holds.

    Where the thesis's ways to branches cannot read the holds, piecewise-linear models
    are fitted without.
    """
    thinned = [whole(r, SAMPLES) for r in holds]
    found = convex.fitted(tensile, thinned)
    fit_all = cyclic_fits if cycles else training_fits
    try:
        fits = fit_all(tensile, holds, {})
    except InputError:
        fits = fit_all(tensile, [], {})
    for key, fit in fits.items():
        found[", ".join(key)] = of_piecewise(fit, tensile)
    for model in MODELS:
        # Of one rate it is one fit of many. Yet where two rates leave one when the
        # other is left out, a member that is not fitted then would never be chosen.
        if (model, "joint") not in fits:
            fit = fit_jointly(prepare.unify(tensile), JOINT_BRANCHES[model])
            found[f"{model}, joint"] = of_piecewise(fit, tensile)
    return found


def of_piecewise(fit: PiecewiseFit, seen: Sequence[Recording]) -> ConvexNetwork:
    """Return the convex network equal to a PL-SLS or PL-Wiechert fit."""
    rows = [(knot, 0.0, 0.0) for knot in fit.knots]
    rows += [(0.0, 0.0, tau) for tau in fit.relaxation.relaxation_time]
    weights = [*fit.springs, *fit.relaxation.stiffness]
    return convex.network(np.array(rows), np.array(weights), seen)


def weighed(
    found: Mapping[str, ConvexNetwork],
    tensile: Sequence[Recording],
    holds: Sequence[Recording],
    cycles: bool,
) -> tuple[dict[str, float], str]:
    """Return the weights of members, of sum 1, and in words how they were chosen."""
    owner = np.repeat(np.arange(len(tensile)), [len(r) for r in tensile])
    rates = True
    try:
        folds = make_folds(tensile, owner, "rate", MOST)
    except InputError:
        rates = False
        taught = [n for n in found if _by_holds(n)]
        if taught:
            return dict.fromkeys(taught, 1 / len(taught)), "holds; one rate"
        if len(tensile) < 2:
            return dict.fromkeys(found, 1 / len(found)), "nothing: one recording"
        folds = make_folds(tensile, owner, "recording", MOST)
    said: list[dict[str, Array]] = []
    measured: list[Array] = []
    for test in folds.test:
        out = set(owner[test].tolist())
        kept = [r for i, r in enumerate(tensile) if i not in out]
        names = {tensile[i].name for i in out}
        others = members(kept, [r for r in holds if r.name not in names], cycles)
        asked = [tensile[i] for i in sorted(out)]
        stress = np.concatenate([r.stress_MPa for r in asked])
        size = float(np.sqrt(np.sum(stress**2))) or 1.0
        measured.append(stress / size)
        said.append({n: _over(one, asked) / size for n, one in others.items()})
    names_of_all = [n for n in found if all(n in one for one in said)]
    columns = np.column_stack(
        [np.concatenate([s[n] for s in said]) for n in found if n in names_of_all]
    )
    weights = stacked(columns, np.concatenate(measured))
    kept_weights = {
        n: float(w) for n, w in zip(names_of_all, weights, strict=True) if w
    }
    return kept_weights, "rates left out" if rates else "recordings left out"


def stacked(said: Array, measured: Array) -> Array:
    """Return non-negative weights (m,) of sum 1 that fit columns (n, m) best to (n,).

    >>> stacked(np.array([[1.0, 3.0], [1.0, 3.0]]), np.array([2.0, 2.0])).round(3)
    array([0.5, 0.5])
    """
    rows = np.vstack([said, np.full((1, said.shape[1]), ONE)])
    weights, _ = nnls(rows, np.append(measured, ONE), maxiter=10_000)
    weights[weights < LEAST] = 0.0
    return weights / weights.sum()


def errors(
    data: Data, known: Samples, folds: Folds
) -> tuple[dict[str, list[float]], list[dict[str, float]]]:
    """NRMSE and R2 by fold of the network, and its weights fold by fold.

    `known` are samples that `folds` split. Everything is fitted, and weighed, without
    the held-out samples; holds of a recording held out whole are not used.
    """
    predicted = np.full(folds.test.shape, np.nan)
    weights = []
    for row, test in zip(predicted, folds.test, strict=True):
        found = without(data, known, test)
        weights.append(found.weights)
        for i in np.unique(known.recording[test]):
            mine = test & (known.recording == i)
            asked = _over(found.network, [data.tensile[i]])
            row[mine] = asked[known.position[mine]]
    scores = score(folds, predicted, known.target)
    return {"nrmse": scores.nrmse.tolist(), "r2": scores.r2.tolist()}, weights


def without(data: Data, known: Samples, test: np.ndarray) -> Held:
    """The network of a material without the samples in `test` (n,)."""
    left = [
        known.position[(known.recording == i) & ~test] for i in range(len(data.tensile))
    ]
    tensile = [
        r.take(rows) for r, rows in zip(data.tensile, left, strict=True) if len(rows)
    ]
    gone = {r.name for r, rows in zip(data.tensile, left, strict=True) if not len(rows)}
    holds = [r for r in data.relaxation if r.name not in gone]
    return held(tensile, holds, data.cycles)


def _by_holds(name: str) -> bool:
    """Whether a member takes branches from holds."""
    if name.startswith("convex"):
        return convex.HOLDS[0] not in name
    return "joint" not in name


def _over(one: ConvexNetwork, recordings: Sequence[Recording]) -> Array:
    return np.concatenate(
        [one.predict(np.column_stack([r.strain, r.time_s])) for r in recordings]
    )
