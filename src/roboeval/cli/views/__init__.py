"""What commands draw on a terminal, from the numbers that `analysis` gives."""
