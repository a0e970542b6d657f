"""Tables of a sweep, beside the source's."""
