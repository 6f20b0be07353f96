"""The engine's side of isolated processes: their code, start, messages and end."""
