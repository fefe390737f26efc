"""The stability suite: the accuracy marks of the solver, the cases tried and the results."""
