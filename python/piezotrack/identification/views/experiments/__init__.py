"""Views of experiments: a step, the noise of a sensor."""
