"""The engine's side of isolated processes: compiles their code, starts them, talks to them and ends them."""
