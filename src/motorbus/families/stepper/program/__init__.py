"""A project as a file with units and names, its checks and its duration, and a backup of all projects."""
