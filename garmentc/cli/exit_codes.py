"""What the exit codes mean."""

EXIT_CLEAN = 0
EXIT_FINDINGS = 1
"""`diff` found a difference, `validate` a fault."""
EXIT_FAILURE = 2
EXIT_INTERRUPTED = 130
EXIT_TERMINATED = 143
