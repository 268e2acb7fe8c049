"""Motion: the machine file, the safety gate, the control loop, moves, and the robot that every face uses."""
