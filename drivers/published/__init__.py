"""Problems that other codes publish: their numbers and ours side by side."""
