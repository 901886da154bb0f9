"""Models where controllers and finite-element codes run: C, FMU, ONNX, material cards.

`softnn.export.files` has it; nothing is imported here, so that the command line starts
at once.
"""
