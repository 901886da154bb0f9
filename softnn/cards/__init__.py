"""Material cards of finite-element codes: read, written, and how far one is off.

`read` makes a model of a card of Abaqus, Ansys or FEBio; `written` makes cards of a
model; `loss` compares a card with its model. Codes in which cards are written are in
`WRITERS`.
"""
