"""``python -m frametwin.worker``: requests on standard input, events on standard output, nothing else on either."""

from __future__ import annotations

from frametwin.worker.streams import take_standard_streams

if __name__ == "__main__":
    streams = take_standard_streams()  # before anything is imported that might print
    from frametwin.worker.server import main

    main(*streams)
