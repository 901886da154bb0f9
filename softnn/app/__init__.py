"""`softnn app`: pages on this machine for those who do not use a terminal.

`project.py` holds a visitor's folder. `runs.py` starts and ends the processes that
compute. `work.py` is their work, by the functions that the commands call. `guard.py`
decides who may come in and how much they may send. `pages.py` gives the addresses,
`sheet.py`, `card.py` and `training.py` the contents, `parts.py` the elements.
"""
