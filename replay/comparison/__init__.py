"""`replay compare`: what differs between two runs, beyond tolerances. Reports in, values out; nothing is read here."""
