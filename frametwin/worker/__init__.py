"""A process of its own for what is heavy: ``python -m frametwin.worker``, spoken to in JSON lines.

Blender's Python has numpy alone; what needs scipy, numba or torch runs in a worker, in the project's environment. A
crash there leaves Blender alone, and cancelling at worst is killing. `frametwin.worker.client` starts one and talks to
it; `frametwin.worker.protocol` says what is said; `frametwin.worker.job_table` is the table of what it can do.
"""
