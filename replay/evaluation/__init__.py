"""`replay evaluate`: how far a run is from known truth."""
