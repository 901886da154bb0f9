"""A strip in a finite-element code, made of the text of an Abaqus card.

felupe solves it; the material is written here from the card's text alone and from the
theory that Abaqus documents: Marlow's energy of the first invariant, and a Prony series
of the deviatoric stress (Simo 1987). None of it uses softnn.
"""

import felupe as fem
import numpy as np

BULK = 2e3  # times the stiffness: as good as incompressible
NUDGE = 1e-7


def parsed(text):
    """Rows of numbers below each keyword of a card, and the line of the keyword."""
    found = {}
    for line in text.splitlines():
        if line.startswith("**") or not line.strip():
            continue
        if line.startswith("*"):
            rows = found.setdefault(line.lower().split(",")[0], (line.lower(), []))[1]
        else:
            rows.append([float(v) for v in line.split(",")])
    return found


class Strip:
    """An incompressible strip of a card, pulled along x; its sides are free."""

    def __init__(self, text):
        card = parsed(text)
        data = np.array(card["*uniaxial test data"][1])
        data = np.vstack([data, [0, 0]])
        self.stress, self.strain = data[np.argsort(data[:, 1])].T
        rows = card.get("*viscoelastic", ("", []))[1]
        self.shares = np.array([r[0] for r in rows])
        self.times = np.array([r[2] for r in rows])
        line = card["*hyperelastic"][0]
        # The curve is the relaxed one unless the card says otherwise.
        self.lift = 1.0
        if len(rows) and "moduli=instantaneous" not in line:
            self.lift = 1 / (1 - self.shares.sum())
        self.step = 0.0
        self.bulk = BULK * np.max(np.gradient(self.stress, self.strain))

    def slope(self, invariant):
        """dW/dI1 of Marlow's energy, from the uniaxial curve in tension."""
        stretches = np.linspace(1 + 1e-6, 1 + self.strain[-1] * 1.02, 4000)
        nominal = self.lift * np.interp(stretches - 1, self.strain, self.stress)
        slopes = nominal / (2 * (stretches - stretches**-2))
        return np.interp(invariant, stretches**2 + 2 / stretches, slopes)

    def deviatoric(self, c, inverse, volume):
        """Second Piola-Kirchhoff stress (3, 3, ...) that changes the shape."""
        trace = np.einsum("ii...->...", c)
        eye = np.eye(3)[(...,) + (None,) * (c.ndim - 2)]
        slope = 2 * self.slope(volume ** (-2 / 3) * trace) * volume ** (-2 / 3)
        return slope * (eye - trace / 3 * inverse)

    def piola(self, f, state):
        """First Piola-Kirchhoff stress and the new state."""
        c = np.einsum("ki...,kj...->ij...", f, f)
        back, volume = fem.math.inv(c), np.sqrt(fem.math.det(c))
        now = self.deviatoric(c, back, volume)
        old = state[:9].reshape(c.shape)
        s = (1 - self.shares.sum()) * now
        new = [now.reshape(9, *c.shape[2:])]
        for i, (share, time) in enumerate(zip(self.shares, self.times, strict=True)):
            h = state[9 * (i + 1) : 9 * (i + 2)].reshape(c.shape)
            x = self.step / time
            gain = -np.expm1(-x) / x if x > 1e-12 else 1.0
            h = np.exp(-x) * h + share * gain * (now - old)
            s = s + h
            new.append(h.reshape(9, *c.shape[2:]))
        s = self.without_pressure(s, c, back)
        s = s + self.bulk * (volume - 1) * volume * back
        return np.einsum("ik...,kj...->ij...", f, s), np.concatenate(new)

    def without_pressure(self, s, c, back):
        """What relaxes stays without pressure at the shape that it has now."""
        return s - np.einsum("ij...,ij...->...", s, c) / 3 * back

    def material(self):
        def gradient(x, **_):
            return list(self.piola(x[0], x[-1]))

        def hessian(x, **_):
            f, state = x[0], x[-1]
            here = self.piola(f, state)[0]
            out = np.zeros((3, 3, *f.shape))
            for k in range(3):
                for m in range(3):
                    moved = f.copy()
                    moved[k, m] += NUDGE
                    out[:, :, k, m] = (self.piola(moved, state)[0] - here) / NUDGE
            return [out]

        return fem.Material(gradient, hessian, nstatevars=9 * (1 + len(self.shares)))

    def pulled(self, time, strain):
        """Nominal stress (n,), MPa, at these strains."""
        mesh = fem.Cube(n=(3, 2, 2))
        field = fem.FieldContainer([fem.Field(fem.RegionHexahedron(mesh), dim=3)])
        solid = fem.SolidBody(self.material(), field)
        return pulled(field, solid, strain, np.diff(time, prepend=time[0]), self)


def pulled(field, solid, strain, steps=None, clock=None, clamped=False):
    """Nominal stress (n,), MPa, of a cube of 1 mm; `clock` gets each time step."""
    ends = fem.dof.uniaxial(field, clamped=clamped, move=0, return_loadcase=False)
    out = []
    for i, e in enumerate(strain):
        if clock is not None:
            clock.step = steps[i]
        ends["move"].update(e)
        fixed, free = fem.dof.partition(field, ends)
        moved = fem.dof.apply(field, ends, fixed)
        done = fem.newtonraphson(
            items=[solid], dof0=fixed, dof1=free, ext0=moved, verbose=0, tol=1e-7
        )
        out.append(fem.tools.force(field, done.fun, ends["move"])[0])
    return np.array(out)
