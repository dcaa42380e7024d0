"""Phase alignment by dynamic time warping: kernels on numbers, imported where they are used."""
