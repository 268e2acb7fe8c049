"""The doctor: findings about a bus or a machine, from the port to the machine file. It writes nothing to a device."""
