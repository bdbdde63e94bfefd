"""`replay check`: what is expected of a run, whether it holds, and that in the forms that CI reads."""
