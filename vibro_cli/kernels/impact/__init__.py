"""Impact laws, simultaneous impacts and accumulations of impacts."""
