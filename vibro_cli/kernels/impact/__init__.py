"""Impact laws, impacts at one instant, accumulations of impacts."""
