"""The article's Tables 2 to 5 over its unstated parameters: priors, and simulated tables."""
