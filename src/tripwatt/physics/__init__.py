"""The car as pure functions on arrays: road load, drivetrain, battery, and the simulation that chains them."""
