"""`python -m multipendula`."""

import sys

from multipendula.cli import main

sys.exit(main())
