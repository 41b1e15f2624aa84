"""What the exit codes mean."""

EXIT_CLEAN = 0
EXIT_FINDINGS = 1
"""`diff` found a difference, `validate` a fault, `dataset check` a problem."""
EXIT_FAILURE = 2
"""Anything else went wrong. An interrupted command has 128 + the signal: 130 for Ctrl-C."""
