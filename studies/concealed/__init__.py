r"""A forge of concealed cases: does `softnn diagnose` name the physics left out?

Nothing in here but `trial.py` knows softnn. The forge has its own material laws,
its own integrators and its own functional form for every effect, so that a diagnosis
cannot succeed by meeting its own formulae again. One fine uniform clock
(`programmes.STEP_S`) carries all signals; what is written down is sampled from it.

    programmes.py   what the machine is told to do, and when samples are taken
    bases.py        hyperelastic springs and Maxwell branches: the physics left in
    planting.py     what an effect is here: hooks at the stages it acts in
    rig.py, material.py, sensor.py     the nineteen effects
    unlisted.py     things that are on no list
    noises.py       noise: white, coloured, heteroscedastic, quantised
    oracle.py       what a refit absorbs, and whether the rest can be seen at all
    forge.py        a case: drawn, run, written; answers to the sealed key
    scoring.py      diagnoses against the key
    trial.py        forge, diagnose, open the key, score, record
"""
