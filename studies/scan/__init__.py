"""Search of a field of regard: passive detection, laser-radar visits, and their schedule."""
