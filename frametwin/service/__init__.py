"""What the worker process does when it is asked: one function a job, named in `frametwin.worker.job_table`."""
