"""Mutation testing: change one line of a copy of the source, and see whether a test that reaches the line fails.

    PYTHONPATH=tools python -m mutants --seed 1 --count 200

mutmut and cosmic-ray change Python alone, and functions alone or with all tests for each change; a third of what
pretouch computes is C++. A mutant is drawn among the lines that decide something: arithmetic, comparisons, constants,
conditions, results and statements of src/ and native/; no words, types, imports or settings of a drawing.

All work is done in build/mutants/: a copy of the tree, the map of which test reaches which line (`reach/`), and one
line for each mutant that was tried (`tried.jsonl`). A run that was stopped goes on where it was.
"""
