"""Systems other than bodies on a trace: each a package with its kernels, its run and its tables."""
