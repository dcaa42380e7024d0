"""Method 1, reduce: a hand rig of a few channels (Joerg & O'Sullivan 2009)."""
