"""Run time against error of every rendering engine."""
