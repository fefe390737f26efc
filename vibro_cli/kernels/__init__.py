"""The kernels of the solver, and the structs they work on: nothing else is compiled.

A folder for each stage of the event loop; ``docs/kernels.md`` tells what a kernel may contain."""
