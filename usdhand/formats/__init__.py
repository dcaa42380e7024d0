"""Motion files: read into clips, written from clips. The only package that knows file formats."""
