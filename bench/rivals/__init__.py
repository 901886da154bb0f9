"""Rivals on real recordings: what a user would pick instead, on the same splits.

Each rival gets the recordings that softnn fits, thinned as softnn's search thins them,
with the scales of specimens taken out, and predicts the recordings that softnn
predicts. Its options are chosen by folds over the fitted recordings alone.

    problem.py      recordings of a split as every rival gets them, and the inner folds
    features.py     what a learner may know of a strain history
    laws.py         piecewise-linear and Prony fits, and published laws
    network_b.py    Bergstroem and Boyce's network with a power-law dashpot
    learners.py     trees, a Gaussian process, a network of histories, PySINDy
    choice.py       options by inner folds, then the fit to all fitted recordings
    methods.py      all rivals, in the order of the table
    table.py        errors against softnn's: table and summary
    page.py         the page docs/rivals.md
    trial.py        the command
"""
