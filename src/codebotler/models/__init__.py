"""Language models: on servers, in this process, or recorded."""
