"""Laws of an Abaqus card in two finite-element codes: felupe, and CalculiX as written.

The laws are written here from the Abaqus manual and the text of the card; none of it
uses softnn. CalculiX reads the card itself and leaves out its series, which it has not.
"""

import re
import subprocess

import felupe as fem
import numpy as np
from strip_made import BULK, Strip, parsed, pulled

POWERS = np.arange(1, 6)
CHAIN = np.array([1 / 2, 1 / 20, 11 / 1050, 19 / 7000, 519 / 673750])


def kirchhoff(line, m, stretch):
    """Kirchhoff stresses of principal stretches (..., 3), up to a pressure."""
    if "ogden" in line:
        count = int(re.search(r"n=(\d)", line)[1])
        pairs = zip(m[0 : 2 * count : 2], m[1 : 2 * count : 2], strict=True)
        return sum(2 * mu / a * stretch**a for mu, a in pairs)
    square = stretch**2
    i = square.sum(-1, keepdims=True) - 3
    one, two = 0.0, 0.0
    if "yeoh" in line:
        one = m[0] + 2 * m[1] * i + 3 * m[2] * i**2
    elif "arruda" in line:
        terms = m[0] * POWERS * CHAIN / m[1] ** (2 * POWERS - 2)
        one = (terms * (i + 3) ** (POWERS - 1)).sum(-1, keepdims=True)
    elif "mooney" in line:
        one, two = m[0], m[1]
    elif "neo hooke" in line:
        one = m[0]
    return 2 * (one * square - two / square)


class LawStrip(Strip):
    """An incompressible body of a card that holds a law."""

    def __init__(self, text):
        card = parsed(text)
        self.line, rows = card["*hyperelastic"]
        self.moduli = [x for row in rows for x in row]
        rows = card.get("*viscoelastic", ("", []))[1]
        self.shares = np.array([r[0] for r in rows])
        self.times = np.array([r[2] for r in rows])
        self.lift = 1.0
        if len(rows) and "moduli=instantaneous" not in self.line:
            self.lift = 1 / (1 - self.shares.sum())
        self.step = 0.0
        tiny = np.array([1.001, 1.001**-0.5, 1.001**-0.5])
        t = kirchhoff(self.line, self.moduli, tiny)
        self.bulk = BULK * (t[0] - t[1]) / 0.001

    def deviatoric(self, c, inverse, volume):
        square, axes = np.linalg.eigh(np.moveaxis(c, (0, 1), (-2, -1)))
        own = np.sqrt(square) * volume[..., None] ** (-1 / 3)
        t = self.lift * kirchhoff(self.line, self.moduli, own)
        t = (t - t.mean(-1, keepdims=True)) / square
        s = np.einsum("...ik,...k,...jk->...ij", axes, t, axes)
        return np.moveaxis(s, (-2, -1), (0, 1))

    def bonded(self, time, strain, cells, mean=True):
        """Force over section of a body bonded at its ends, an eighth of it: uneven."""
        mesh = fem.Cube(n=cells + 1)
        field = fem.FieldContainer([fem.Field(fem.RegionHexahedron(mesh), dim=3)])
        if mean:  # the pressure is that of the mean of each element: nothing locks
            bulk, self.bulk = self.bulk, 0.0
            solid = fem.SolidBodyNearlyIncompressible(self.material(), field, bulk)
        else:  # the element of CalculiX, C3D8
            solid = fem.SolidBody(self.material(), field)
        steps = np.diff(time, prepend=time[0])
        return pulled(field, solid, strain, steps, self, clamped=True)


class FoamStrip(LawStrip):
    """A strip of a foam, which relaxes as a whole and has no pressure of its own."""

    def __init__(self, text):
        card = parsed(text)
        _, rows = card["*hyperfoam"]
        self.moduli = [x for row in rows for x in row]
        self.shares = np.array([r[0] for r in card["*viscoelastic"][1]])
        self.times = np.array([r[2] for r in card["*viscoelastic"][1]])
        assert all(r[0] == r[1] for r in card["*viscoelastic"][1])
        self.step = self.bulk = 0.0

    def deviatoric(self, c, inverse, volume):
        count = len(self.moduli) // 3
        square, axes = np.linalg.eigh(np.moveaxis(c, (0, 1), (-2, -1)))
        stretch, j = np.sqrt(square), volume[..., None]
        t = 0.0
        for k in range(count):
            mu, a = self.moduli[2 * k : 2 * k + 2]
            beta = self.moduli[2 * count + k] / (1 - 2 * self.moduli[2 * count + k])
            t = t + 2 * mu / a * (stretch**a - j ** (-a * beta))
        s = np.einsum("...ik,...k,...jk->...ij", axes, t / square, axes)
        return np.moveaxis(s, (-2, -1), (0, 1))

    def without_pressure(self, s, c, back):
        return s


def calculix(folder, card, strain, cells=1, bonded=False):
    """Force over section (n,) of a cube of 1 mm by CalculiX, with the card as written.

    `strain` (n,) are the ends of its steps.
    """
    n = cells + 1
    lines = ["*NODE, NSET=ALL"]
    number = {}
    for k in range(n):
        for j in range(n):
            for i in range(n):
                number[i, j, k] = len(number) + 1
                at = (x / cells for x in (i, j, k))
                lines.append(f"{number[i, j, k]}, " + ", ".join(f"{x:.9g}" for x in at))
    lines.append("*ELEMENT, TYPE=C3D8, ELSET=CUBE")
    ring = ((0, 0), (1, 0), (1, 1), (0, 1))
    for e, (i, j, k) in enumerate(np.ndindex(cells, cells, cells), start=1):
        corners = [number[i + a, j + b, k + c] for c in (0, 1) for a, b in ring]
        lines.append(f"{e}, " + ", ".join(map(str, corners)))
    lines.append("*NSET, NSET=TOP")
    lines += [str(v) for (i, j, k), v in number.items() if k == cells]
    lines += card.strip().splitlines()
    name = re.search(r"\*Material, name=(\w+)", card)[1]
    lines += [f"*SOLID SECTION, ELSET=CUBE, MATERIAL={name}", "*BOUNDARY"]
    for (i, j, k), v in number.items():
        ends = k == cells  # the bottom is the middle of a bonded body
        if k == 0:
            lines.append(f"{v}, 3, 3, 0.")
        if (bonded and ends) or i == 0:
            lines.append(f"{v}, 1, 1, 0.")
        if (bonded and ends) or j == 0:
            lines.append(f"{v}, 2, 2, 0.")
    for e in strain:
        lines += ["*STEP, NLGEOM, INC=1000", "*STATIC", "0.25, 1.", "*BOUNDARY"]
        lines += [f"TOP, 3, 3, {e:.9g}", "*NODE PRINT, NSET=TOP, TOTALS=ONLY", "RF"]
        lines.append("*END STEP")
    (folder / "cube.inp").write_text("\n".join(lines) + "\n")
    done = subprocess.run(
        ["ccx", "-i", "cube"], cwd=folder, capture_output=True, text=True, timeout=300
    )
    assert done.returncode == 0, done.stdout[-2000:]
    rows = re.findall(
        r"total force.*time\s+(\S+)\s+(\S+)\s+(\S+)\s+(\S+)",
        (folder / "cube.dat").read_text(),
    )
    ends = [float(r[3]) for r in rows if abs(float(r[0]) % 1.0) < 1e-6]
    assert len(ends) == len(strain)
    return np.array(ends)
