"""The command ``frametwin``. Nothing heavy is imported before a command runs."""
