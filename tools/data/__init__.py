"""Makers of the data that the package ships: tables of cars, machines and schedules, the model."""
