"""Identification by optimal matching, quick enough for many settings of both sensors at once."""
