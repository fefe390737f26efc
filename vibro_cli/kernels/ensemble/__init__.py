"""Many runs of one system, one after another or in the lanes of registers."""
