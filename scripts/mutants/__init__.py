"""Mutation testing: each small fault that can be put into a module, and whether a fast test of it notices."""
