"""Reports as web pages, made from stored results without any simulation."""
