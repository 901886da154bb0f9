"""What the pages of `make docs` are generated from: effects, tables and results.

`hook.py` is called by mkdocs; `gallery.py` makes a page an effect, `thesis.py` one a
chapter, `notebook.py` one of the notebook; `maths.py` and `chart.py` turn formulas
and curves into markup that needs no script and no network.
"""
