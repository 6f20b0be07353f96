"""House rules and contracts, and the guard that holds each skill call against them."""
