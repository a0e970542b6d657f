"""Every stage of the corrections of a flight, beside the truth: flight.py STORE PICTURE."""

import sys

from sweeps.report.pictures import draw_flights

store, picture = sys.argv[1:]
figure = next(iter(draw_flights(store).values()))()
figure.savefig(picture, dpi=150)
