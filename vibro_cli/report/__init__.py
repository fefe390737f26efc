"""Reports of runs as web pages; they read what is stored and never simulate."""
