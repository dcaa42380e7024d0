"""How near one motion is to another: compare, reconstruction, label agreement."""
