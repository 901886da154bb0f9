"""What is missing from simulations of real recordings, and does the literature agree?

    sets.py        what is known about each set: how to read it, what to hold out, what
                   the literature says is in the material
    groups.py      recordings that belong together; which are fitted, which predicted
    predict.py     a diagnosis held against recordings that it has not seen
    faults.py      faults of a rig or a channel, made in copies of real recordings
    slip.py        what a recording would be, had the specimen slipped
    oracle.py      what a fit gains that knows the fault: which can be found at all
    virtual.py     a made-up set for --smoke
    reporting.py   tables, result file, figures, MLflow
    trial.py       the command

Sets, groups, specimens and rates are those found in the folder. Recordings are read in
place; results are figures of numbers, and a figure of a recording is not kept.
"""
