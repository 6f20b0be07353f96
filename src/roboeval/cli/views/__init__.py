"""Tables and texts for a terminal, drawn from the numbers of `analysis`."""
