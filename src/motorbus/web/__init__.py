"""The page: see, move and tune a machine in a browser. A face: it calls `motion.Robot` and contains no motion code."""
