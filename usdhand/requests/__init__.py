"""What a run is to do, as values: a request a verb, each option declared once."""
