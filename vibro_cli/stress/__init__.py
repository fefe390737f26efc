"""The stability suite: every mark of the solver, what was tried against it and what was reached."""
