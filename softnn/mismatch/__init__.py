"""Mismatch: locate it, explain it, model it, verify it.

`diagnosis.diagnose(case.read_case(folder))` runs all steps. `base` fits the base to the
recordings. `accounts` searches for sets of effects; `evidence` and `posterior` weigh
them. `prediction` judges them on recordings left out where no set reaches the noise.
`decision` names effects. `learn` fits a correction to what no effect explains. `locate`
finds regions. `written` and `words` write the result down.
"""
