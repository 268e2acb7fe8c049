"""The program `motorbus`: commands that parse words, call the library and show the result."""

from motorbus.cli.main import main

__all__ = ["main"]
