"""Movements of several axes that begin together and end together: move, pose, park, replay, and those of one axis.

verbs     what people have
plan      which way everybody goes, and in what time
along     the plan that follows a trajectory, and what is judged of it
journey   what the parts of one movement share, and what comes of them
parts     the part of a bus whose axes are led, and that of an axis with a profile of its own
stream    small goals along a course, on a grid of time
forgiving what is lost on the way and goes on
moved     what came of it, as values
"""
