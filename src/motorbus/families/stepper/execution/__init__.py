"""How a controller carries out a project: the ramp of one move, the order of the steps, and the machine over time.

Times are seconds, positions pulses with forward positive. Every value is in closed form: a pause of four hours costs
what one of a millisecond does.
"""
