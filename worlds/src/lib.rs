//! Terrain, roadmaps and sensor networks for Farside.
