"""The conformance suite: what other people's engines make of our files, measured. `make conformance` runs it."""
