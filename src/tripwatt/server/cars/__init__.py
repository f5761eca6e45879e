"""One car: its trips, the model adapted to them, its diary, and what it sends while it drives."""
