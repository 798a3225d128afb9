"""`python -m gibiane`."""

from gibiane.cli import main

raise SystemExit(main())
