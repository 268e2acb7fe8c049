"""What is wrong, what is there, and what will fit: questions about a bus that no single device answers."""
