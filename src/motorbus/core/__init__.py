"""Values and pure functions that all other packages use. No I/O, no clock, no threads."""
