"""Writers of the docs: published results, generated parts of pages, pictures, the site."""
