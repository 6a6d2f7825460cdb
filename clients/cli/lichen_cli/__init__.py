"""The `lichen` command: serve, run operations on files, list them, and find out what works here."""
