"""Writers of the pages of the documentation."""
