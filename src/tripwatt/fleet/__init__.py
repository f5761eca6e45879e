"""Many vehicles: a map over a trip store, and a hierarchical model on sums that add up."""
