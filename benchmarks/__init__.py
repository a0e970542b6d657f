"""Benchmarks of time, memory and error, reported by a command, never asserted."""
