"""Many runs in a batch, one after another or in the lanes of registers."""
