"""The version of the client, the one place its distribution reads it from."""

__version__ = "0.1.0"
