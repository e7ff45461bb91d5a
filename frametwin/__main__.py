"""``python -m frametwin``: the same as the command ``frametwin``."""

from __future__ import annotations

from frametwin.cli.main import main

if __name__ == "__main__":
    main()
