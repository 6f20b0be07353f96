"""House rules and contracts, and the guard that checks each skill call against them."""
