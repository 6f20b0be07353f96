"""Models on servers: send requests in the protocols of providers, and explain failures."""
