"""Pictures and text of datasets."""
