"""Set up an arm: number its servos, calibrate its joints, verify them, exchange calibrations with LeRobot."""
