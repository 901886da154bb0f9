r"""Levenberg-Marquardt for many small least-squares problems at once.

Minimises :math:`\beta E_D + \alpha E_W` per problem, with :math:`E_D` the sum of
squared errors and :math:`E_W` the sum of squared parameters. `alpha` and `beta` are
fixed, or re-estimated at every accepted step by MacKay's evidence updates in the
Gauss-Newton form of Foresee and Hagan (1997, doi:10.1109/ICNN.1997.614194):

.. math:: \gamma = P - \alpha\, \mathrm{tr}(\beta J^T J + \alpha I)^{-1}, \quad
          \alpha = \gamma / 2 E_W, \quad \beta = (N - \gamma) / 2 E_D .

The defaults are those of MATLAB's `trainbr`: mu 0.005, x0.1 and x10, mu_max 1e10,
gradient 1e-7, 1000 epochs. There are two additions. Steps use the exact Hessian (gamma
keeps the Gauss-Newton form), and training may stop when `settled`.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol

import torch
from torch import Tensor

from softnn.contracts import InputError


@dataclass(frozen=True)
class Settings:
    """When to damp and when to stop.

    `settled_nats`: stop when the log evidence (for fixed `alpha` and `beta` the log
    posterior with the noise profiled out) has gained less than this over the last
    `settled_epochs` accepted steps. 0 never stops so, as in `trainbr`.

    `grid`: parameters are multiples of it, or any number if it is 0, as in `trainbr`.
    Processors round differently, and each step enlarges the difference. A grid of some
    1e-4 absorbs it before the next step.
    """

    mu: float = 0.005
    mu_decrease: float = 0.1
    mu_increase: float = 10.0
    mu_max: float = 1e10
    gradient: float = 1e-7
    epochs: int = 1000
    settled_nats: float = 0.1
    settled_epochs: int = 10
    patience: int = 6  # epochs of rising validation error, with early stopping
    grid: float = 0.0


DEFAULTS = Settings()
STEADY = Settings(grid=2.0**-12)  # ends alike on processors that round differently
SINGULAR = 1e-12  # of the largest element, by which a singular matrix is moved off


def device_of(name: str) -> str:
    """Return torch's name of a device; auto is a GPU if a usable one is found.

    Raises `InputError` for a device that is not here. Only CUDA has float64.
    """
    able = torch.cuda.is_available()
    if name == "auto":
        return "cuda" if able else "cpu"
    here = ["cpu", *(["cuda"] if able else [])]
    if name not in here:
        raise InputError(f"device is {name!r}; here is {', '.join(here)}, or auto")
    return name


class Problem(Protocol):
    """B independent least-squares problems; `which` (b,) picks some of them."""

    count: Tensor  # (B,) residuals of each
    size: Tensor  # (B,) parameters of each; the rest of the P columns are padding

    def sse(self, parameters: Tensor, which: Tensor) -> Tensor:
        """Sum of squared errors (b,) at parameters (b, P)."""

    def normal(
        self, parameters: Tensor, which: Tensor
    ) -> tuple[Tensor, Tensor, Tensor]:
        """J'J (b, P, P), J'e (b, P) with e = predicted - measured, and half the exact
        Hessian of the squared error, J'J + sum e f'' (b, P, P)."""

    def validation(self, parameters: Tensor, which: Tensor) -> Tensor | None:
        """Sum of squared validation errors (b,), or None where there is no such set."""


@dataclass
class Result:
    """Parameters (B, P) and, per problem, how the training ended."""

    parameters: Tensor
    alpha: Tensor
    beta: Tensor
    gamma: Tensor
    sse: Tensor
    evidence: Tensor
    iterations: Tensor
    stopped: list[str]


def minimise(
    problem: Problem,
    start: Tensor,
    *,
    evidence: bool,
    alpha: Tensor | float = 0.0,
    beta: Tensor | float = 1.0,
    settings: Settings = DEFAULTS,
) -> Result:
    """Train all problems from `start` (B, P); finished ones cost nothing more.

    With `evidence` alpha and beta are re-estimated and the given ones are not used.
    """
    theta = start.clone()
    batch = theta.shape[0]
    everyone = torch.arange(batch, device=theta.device)
    sse = problem.sse(theta, everyone)
    hessian, gradient, exact = problem.normal(theta, everyone)
    count, size = problem.count.to(theta), problem.size.to(theta)
    mu = theta.new_full((batch,), settings.mu)
    a = torch.as_tensor(alpha).to(theta).expand(batch).clone()
    b = torch.as_tensor(beta).to(theta).expand(batch).clone()
    if evidence:
        a = size / (2 * _square(theta)).clamp_min(1e-300)
        b = (count - size) / (2 * sse)
        b = torch.where((b > 0) & torch.isfinite(b), b, torch.ones_like(b))
    gamma, log_evidence = _evidence(hessian, theta, sse, a, b, count, size, evidence)
    iterations = torch.zeros(batch, dtype=torch.long, device=theta.device)
    window = settings.settled_epochs
    history = theta.new_full((batch, window), -torch.inf)
    held_out = problem.validation(theta, everyone)
    best_held_out, best_theta = held_out, theta.clone()
    fails = torch.zeros(batch, dtype=torch.long, device=theta.device)
    stopped = [""] * batch
    alive = torch.ones(batch, dtype=torch.bool, device=theta.device)

    def stop(which: Tensor, reason: str) -> None:
        for i in which.tolist():
            stopped[i] = reason
        alive[which] = False

    while alive.any():
        w = alive.nonzero().squeeze(1)
        slope = b[w, None] * gradient[w] + a[w, None] * theta[w]
        flat = 2 * slope.norm(dim=1) < settings.gradient
        stop(w[flat], "gradient below minimum")
        w, slope = w[~flat], slope[~flat]
        if not len(w):
            continue
        step = _step(exact[w], slope, a[w], b[w], mu[w])
        trial = theta[w] - step
        if settings.grid:
            trial = (trial / settings.grid).round_() * settings.grid
        trial_sse = problem.sse(trial, w)
        now = b[w] * sse[w] + a[w] * _square(theta[w])
        then = b[w] * trial_sse + a[w] * _square(trial)
        better = then < now  # NaN is not better
        worse = w[~better]
        mu[worse] *= settings.mu_increase
        stop(worse[mu[worse] > settings.mu_max], "mu at maximum")
        g = w[better]
        if not len(g):
            continue
        theta[g], sse[g] = trial[better], trial_sse[better]
        mu[g] = (mu[g] * settings.mu_decrease).clamp_min(1e-20)
        iterations[g] += 1
        hessian[g], gradient[g], exact[g] = problem.normal(theta[g], g)
        gamma[g], log_evidence[g] = _evidence(
            hessian[g], theta[g], sse[g], a[g], b[g], count[g], size[g], evidence
        )
        if evidence:
            # Zero of either sum would divide by zero; the floor is a perfect fit.
            floor = torch.finfo(theta.dtype).tiny
            a[g] = gamma[g].clamp_min(1e-12) / (2 * _square(theta[g])).clamp_min(floor)
            b[g] = (count[g] - gamma[g]).clamp_min(1e-9) / (2 * sse[g]).clamp_min(floor)
        if held_out is not None and best_held_out is not None:
            error = problem.validation(theta[g], g)
            assert error is not None
            improved = error < best_held_out[g]
            best_held_out[g[improved]] = error[improved]
            best_theta[g[improved]] = theta[g[improved]]
            fails[g] = torch.where(improved, torch.zeros_like(fails[g]), fails[g] + 1)
            stop(g[fails[g] >= settings.patience], "validation error rises")
        slot = iterations[g] % window
        past = history[g, slot]
        history[g, slot] = log_evidence[g]
        settled = log_evidence[g] - past < settings.settled_nats
        if held_out is None and settings.settled_nats > 0:
            stop(g[settled], "settled")
        stop(g[alive[g] & (iterations[g] >= settings.epochs)], "epochs at maximum")
    if held_out is not None:
        theta = best_theta
        sse = problem.sse(theta, everyone)
    return Result(theta, a, b, gamma, sse, log_evidence, iterations, stopped)


def _step(
    exact: Tensor, slope: Tensor, alpha: Tensor, beta: Tensor, mu: Tensor
) -> Tensor:
    """Damped Newton step (b, P), to be subtracted; always a way down for large mu.

    Training stalls at saddles, where two neurons do the same; the Gauss-Newton matrix
    cannot see them and creeps past. Where the exact Hessian is not positive definite
    its eigenvalues are taken by size instead (Dauphin et al. 2014, arXiv:1406.2572).
    """
    eye = torch.eye(slope.shape[1], dtype=slope.dtype, device=slope.device)
    matrix = beta[:, None, None] * exact + alpha[:, None, None] * eye
    factor, info = torch.linalg.cholesky_ex(matrix + mu[:, None, None] * eye)
    step = torch.cholesky_solve(slope.unsqueeze(2), factor).squeeze(2)
    for i in info.nonzero().squeeze(1).tolist():
        # One at a time, in memory of its own: rounding depends on where a matrix lies.
        values, vectors = torch.linalg.eigh(matrix[i].clone())
        # Sums, not products: those of a matrix with a vector are rounded by place, too.
        turned = (vectors * slope[i, :, None]).sum(dim=0) / (values.abs() + mu[i])
        step[i] = (vectors * turned).sum(dim=1)
    return step


def _square(theta: Tensor) -> Tensor:
    return (theta * theta).sum(dim=1)


def _cholesky(matrix: Tensor) -> Tensor:
    """Lower factors (b, p, p); of what rounding made singular, a little off it."""
    factor, failed = torch.linalg.cholesky_ex(matrix)
    if not failed.any():
        return factor
    most = matrix.diagonal(dim1=1, dim2=2).amax(dim=1, keepdim=True)
    shift = torch.where(failed[:, None] > 0, SINGULAR * most, 0.0)
    shift = shift.expand(matrix.shape[:2])
    return torch.linalg.cholesky_ex(matrix + torch.diag_embed(shift))[0]


def _evidence(
    hessian: Tensor,
    theta: Tensor,
    sse: Tensor,
    alpha: Tensor,
    beta: Tensor,
    count: Tensor,
    size: Tensor,
    evidence: bool,
) -> tuple[Tensor, Tensor]:
    """Effective number of parameters (b,) and log evidence (b,), constants left out.

    For fixed hyperparameters the latter is the log posterior, noise profiled out.
    """
    ew = _square(theta)
    if not evidence:
        objective = sse + (alpha / beta) * ew
        return size.clone(), -count / 2 * torch.log(objective.clamp_min(1e-300))
    padding = theta.shape[1] - size
    diagonal = torch.diag_embed(alpha[:, None].expand_as(theta))
    factor = _cholesky(beta[:, None, None] * hessian + diagonal)
    trace = torch.cholesky_inverse(factor).diagonal(dim1=1, dim2=2).sum(dim=1)
    gamma = size + padding - alpha * trace
    # A numerically singular matrix says nothing; take every parameter as effective.
    gamma = torch.where(torch.isfinite(gamma), gamma.clamp_min(0.0), size)
    gamma = torch.minimum(gamma, size)
    log_determinant = 2 * factor.diagonal(dim1=1, dim2=2).log().sum(dim=1)
    log_determinant = log_determinant - padding * alpha.log()
    value = (
        -alpha * ew
        - beta * sse
        - 0.5 * log_determinant
        + 0.5 * size * alpha.log()
        + 0.5 * count * beta.log()
    )
    return gamma, value
