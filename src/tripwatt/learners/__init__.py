"""Learners for rows that come in groups: boosting, forest and an additive Gaussian process, independent of cars."""
