"""FBX characters, read with the ufbx library."""
