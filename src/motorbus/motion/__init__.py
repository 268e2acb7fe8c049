"""Motion in SI units, blind to families. So far: the gate that every motion command passes."""
