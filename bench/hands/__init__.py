r"""Cases by other hands: published laws, noise and machines of many kinds, two sides.

Nothing in here knows softnn. Every family stands on one side,
development or held out (docs/hands.md), and a case draws from one side only.

    families.py     sides, effects, the hooks by which a law acts
    kernels.py      integrators
    materials.py    springs and spectra
    programmes.py   what the machine does
    noises.py       noise and logging
    testing.py      a test run: rig, material, sensor
    bases.py        what the base named leaves at its best
    rig.py, softening.py, flowing.py, straining.py, warming.py, sensing.py    laws
    strangers.py, strange_machines.py    what is on no list
    bending.py      laws that are wrong
    orders.py       what is concealed in which case
    drawing.py      a case
    grid.py         a case of a chosen strength, in noise of a chosen level and memory
    power.py        what the likelihood-ratio test sees
    forging.py      cases and answers on disk
"""
