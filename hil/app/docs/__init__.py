"""Generated parts of the documentation: the keys of the input files and the catalogue of effects."""
