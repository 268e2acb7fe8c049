"""A control loop over axes of several buses, `robot.loop(rate)`: states in, goals out, on a fixed grid of time.

faces     what people have: `Loop`, `AsyncLoop`, and the verbs that are made of a loop
rounds    one piece of work after the other, for both faces
cycle     goals out and positions in on one bus: the hot path
place     one axis in it, and its next small goal
braking   how those who are on their way come to rest when it is left
readings  what one cycle brought
grid      the moments at which cycles begin, and how well they kept to them
"""
