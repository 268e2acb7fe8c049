"""Links move bytes or CAN frames and understand nothing. Every link owns its clock."""
