"""garmentc: an asset compiler for clothing."""
