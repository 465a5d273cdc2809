"""The page: from a log to a controller in the browser, over what scripts call."""
