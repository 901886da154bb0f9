"""Material cards of finite-element codes: read, written, and how far one is off.

`read` makes a model of a card of Abaqus, Ansys or FEBio; `written` makes cards of a
model; `loss` compares a card with its model. Codes in which cards are written are in
`WRITERS`.
"""

# Units of stress that a card may have, in MPa.
UNITS = {"MPa": 1.0, "kPa": 1e-3, "Pa": 1e-6, "GPa": 1e3, "psi": 6.894757e-3}
