"""`softnn app`: pages on this machine for those who do not use a terminal.

`project.py` is a visitor's folder, `work.py` what other processes do for it, `runs.py`
starts and ends these processes, `guard.py` decides who may come in and how much they
may send, `pages.py` and `parts.py` are what a visitor sees. No figure is computed here:
`work.py` calls what the commands call.
"""
