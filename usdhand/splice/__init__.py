"""Method 3: splice a hand clip onto a body clip (Majkowska, Zordan & Faloutsos 2006)."""
