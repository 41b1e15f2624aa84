"""What tells the body from the outfits in a file: a word in the extras of its mesh's node."""

from __future__ import annotations

ROLE = "GARMENTC_role"
BODY = "body"
