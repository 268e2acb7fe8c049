"""One module for each library; each runs in a process of its own."""
