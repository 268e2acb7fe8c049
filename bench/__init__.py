"""motorbus and other libraries measured side by side: `make bench`."""
