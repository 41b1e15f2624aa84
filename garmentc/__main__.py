"""`python -m garmentc` is the `garmentc` command."""

import sys

from garmentc.cli import main

sys.exit(main())
