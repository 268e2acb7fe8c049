"""The ground floor: values and pure functions every other floor is built of. No I/O, no clock, no threads."""
