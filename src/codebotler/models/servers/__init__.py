"""Models on servers: the protocols of providers, and the errors of networks."""
