"""Method 2, fill: fingers for body clips from a motion library (Joerg, Hodgins, Safonova 2012)."""
