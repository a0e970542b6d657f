"""The benchmark: time, memory and error, reported by a command and asserted nowhere."""
