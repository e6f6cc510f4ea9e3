"""Many crushers at once: engines, grids, stores, clusters."""
