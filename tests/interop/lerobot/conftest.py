"""These tests run where `make lerobot` gives them an environment."""

import os

collect_ignore = [] if os.environ.get("MOTORBUS_LEROBOT") else ["test_commands.py"]
